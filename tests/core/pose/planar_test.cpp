// SPDX-License-Identifier: Apache-2.0
#include "pose/planar.hpp"

#include "simulated_markers.hpp"

#include <opencv2/calib3d.hpp>

namespace arhost::pose {
namespace {

std::vector<PlanePoint> seen(const Rigid &pose, const std::vector<Eigen::Vector2d> &on_target) {
    std::vector<PlanePoint> points;
    for (const Eigen::Vector2d &p : on_target)
        points.push_back({p, (pose * Eigen::Vector3d(p.x(), p.y(), 0)).hnormalized()});
    return points;
}

const std::vector<Eigen::Vector2d> square{{-40, 40}, {40, 40}, {40, -40}, {-40, -40}};

} // namespace

TEST(PlanarPoses, TheFirstIsTheTrueOneForExactPoints) {
    std::vector<Eigen::Vector2d> grid;
    for (int x = 0; x < 5; ++x)
        for (int y = 0; y < 4; ++y)
            grid.emplace_back(30 * x + 100, 30 * y - 10); // not around the origin
    for (const auto &points : {square, grid})
        for (const double tilt : {0.0, 1e-6, 0.1, 5.0, 30.0, 75.0})
            for (const double axis : {0.0, 90.0, 200.0}) {
                const Rigid truth = pose_at({120, -80, 600}, tilt, axis, 33);
                const auto found = planar_poses(seen(truth, points));
                ASSERT_TRUE(found);
                EXPECT_LT(degrees_between((*found)[0], truth), 1e-3) << tilt << ", " << axis;
                EXPECT_LT(((*found)[0].translation_mm - truth.translation_mm).norm(), 1e-2) << tilt << ", " << axis;
            }
}

TEST(PlanarPoses, TheSecondIsTheFirstReflectedInTheLineOfSight) {
    const Rigid truth = pose_at({0, 0, 5000}, 30);
    const auto found = planar_poses(seen(truth, square));
    ASSERT_TRUE(found);
    EXPECT_LT(degrees_between((*found)[1], pose_at({0, 0, 5000}, -30)), 0.5);
}

TEST(PlanarPoses, AgreeWithOpenCv) {
    Camera camera(intrinsics_of(ARHOST_DISTORTION_NONE, {}), 3);
    for (int round = 0; round < 200; ++round) {
        const Rigid truth = pose_at({camera.between(-200, 200), camera.between(-100, 100), camera.between(300, 2000)},
                                    camera.between(5, 70), camera.between(0, 360), camera.between(0, 360));
        auto points = seen(truth, square);
        std::vector<cv::Point3d> object;
        std::vector<cv::Point2d> image;
        for (PlanePoint &p : points) {
            p.on_image += 1e-4 * camera.normal2();
            object.emplace_back(p.on_target_mm.x(), p.on_target_mm.y(), 0);
            image.emplace_back(p.on_image.x(), p.on_image.y());
        }
        std::vector<cv::Vec3d> rotations, translations;
        cv::solvePnPGeneric(object, image, cv::Matx33d::eye(), cv::noArray(), rotations, translations, false,
                            cv::SOLVEPNP_IPPE_SQUARE);
        const auto found = planar_poses(points);
        ASSERT_TRUE(found);
        // Rotations are equal; OpenCV refines nothing, either, but computes the translation from other equations.
        for (std::size_t i = 0; i < 2; ++i) {
            const Eigen::Matrix3d expected = rotation_by({rotations[i][0], rotations[i][1], rotations[i][2]});
            const double degrees = std::min(angle_between_rad((*found)[0].rotation, expected),
                                            angle_between_rad((*found)[1].rotation, expected)) /
                                   radians;
            EXPECT_LT(degrees, 0.01) << round;
        }
        const Eigen::Vector3d expected(translations[0][0], translations[0][1], translations[0][2]);
        EXPECT_LT(((*found)[0].translation_mm - expected).norm(), 0.01 * expected.norm()) << round;
    }
}

TEST(PlanarPoses, NeedFourPointsInGeneralPosition) {
    const Rigid pose = pose_at({0, 0, 500}, 20);
    EXPECT_FALSE(planar_poses({}));
    EXPECT_FALSE(planar_poses(seen(pose, {{0, 0}, {1, 0}, {0, 1}})));
    EXPECT_FALSE(planar_poses(seen(pose, {{0, 0}, {1, 0}, {2, 0}, {3, 0}})));
    EXPECT_FALSE(planar_poses(seen(pose, {{0, 0}, {1, 0}, {2, 0}, {0, 1}})));
    EXPECT_FALSE(planar_poses(seen(pose, {{1, 1}, {1, 1}, {1, 1}, {1, 1}})));
    auto points = seen(pose, square);
    points[1].on_image.x() = std::nan("");
    EXPECT_FALSE(planar_poses(points));
}

} // namespace arhost::pose
