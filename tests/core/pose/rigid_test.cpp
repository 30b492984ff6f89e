// SPDX-License-Identifier: Apache-2.0
#include "pose/rigid.hpp"

#include "simulated_markers.hpp"

#include <gmock/gmock.h>

namespace arhost::pose {

TEST(Rigid, ARotationVectorIsTheInverseOfItsRotation) {
    for (const Eigen::Vector3d &vector : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(1e-13, 0, 0),
                                          Eigen::Vector3d(1e-7, 2e-7, -1e-7), Eigen::Vector3d(0.3, -1, 2)})
        EXPECT_LT((rotation_vector(rotation_by(vector)) - vector).norm(), 1e-9) << vector.transpose();
}

TEST(Rigid, TheInverseUndoesATransform) {
    const Rigid pose = pose_at({10, -20, 500}, 40, 30, 20);
    const Eigen::Vector3d point(1, 2, 3);
    EXPECT_LT((pose.inverse() * (pose * point) - point).norm(), 1e-12);
    EXPECT_LT(((pose * pose) * point - pose * (pose * point)).norm(), 1e-12);
}

TEST(Rigid, AFacingMarkerHasTheAbiMatrixOfAPureTranslation) {
    // On the right, below the axis and in front of the camera: x > 0, y < 0 and z < 0 in OpenGL eye space.
    const auto mt = matrix_of(pose_at({50, 100, 1000}, 0));
    EXPECT_THAT(mt, testing::ElementsAre(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 50, -100, -1000, 1));
}

TEST(Rigid, TheAbiMatrixIsReadBack) {
    const Rigid pose = pose_at({10, -20, 500}, 40, 30, 20), read = rigid_of(matrix_of(pose));
    EXPECT_LT((read.rotation - pose.rotation).norm(), 1e-12);
    EXPECT_LT((read.translation_mm - pose.translation_mm).norm(), 1e-12);
}

} // namespace arhost::pose
