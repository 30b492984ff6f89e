// SPDX-License-Identifier: Apache-2.0
#include "pose/projection.hpp"

#include "simulated_markers.hpp"

#include <opencv2/calib3d.hpp>

namespace arhost::pose {
namespace {

class ProjectionThroughLens : public testing::TestWithParam<LensCase> {};
INSTANTIATE_TEST_SUITE_P(Lenses, ProjectionThroughLens, testing::ValuesIn(lenses), name_of);

const Eigen::Vector3d points_mm[] = {{0, 0, 500}, {100, -60, 400}, {-200, 110, 800}, {3, 2, 5000}, {0.1, 0.2, 1}};

} // namespace

TEST_P(ProjectionThroughLens, AgreesWithOpenCvInPixelAndDerivative) {
    const arhost_intrinsics &in = GetParam().intrinsics;
    const Projection projection(in);
    const cv::Matx33d matrix(in.fx, 0, in.cx, 0, in.fy, in.cy, 0, 0, 1);
    const std::vector<double> coefficients(in.coefficients, in.coefficients + in.coefficient_count);
    for (const Eigen::Vector3d &p : points_mm) {
        const std::vector<cv::Point3d> points{{p.x(), p.y(), p.z()}};
        std::vector<cv::Point2d> expected;
        cv::Mat_<double> derivatives;
        const bool is_fisheye = in.distortion == ARHOST_DISTORTION_FISHEYE;
        if (is_fisheye)
            cv::fisheye::projectPoints(points, expected, cv::Vec3d(), cv::Vec3d(), matrix, coefficients, 0,
                                       derivatives);
        else
            cv::projectPoints(points, cv::Vec3d(), cv::Vec3d(), matrix, coefficients, expected, derivatives);
        const cv::Mat_<double> by_translation = derivatives.colRange(is_fisheye ? 11 : 3, is_fisheye ? 14 : 6);
        Jacobian23 derivative;
        const auto pixel = projection.pixel(p, &derivative);
        ASSERT_TRUE(pixel);
        EXPECT_NEAR(pixel->x(), expected[0].x, 1e-6);
        EXPECT_NEAR(pixel->y(), expected[0].y, 1e-6);
        for (int row = 0; row < 2; ++row)
            for (int column = 0; column < 3; ++column)
                EXPECT_NEAR(derivative(row, column), by_translation(row, column), 1e-5 * in.fx / p.z())
                    << row << ", " << column << " at " << p.transpose();
    }
}

TEST_P(ProjectionThroughLens, APixelIsMappedBackToItsPointOnThePlane) {
    const Projection projection(GetParam().intrinsics);
    for (const Eigen::Vector3d &p : points_mm) {
        const auto back = projection.on_plane(*projection.pixel(p));
        ASSERT_TRUE(back);
        EXPECT_LT((*back - p.head<2>() / p.z()).norm(), 1e-8);
    }
}

TEST(Projection, APointBehindTheCameraHasNoPixel) {
    for (const LensCase &lens : lenses)
        if (lens.intrinsics.distortion != ARHOST_DISTORTION_FISHEYE) {
            EXPECT_FALSE(Projection(lens.intrinsics).pixel({1, 2, -100})) << lens.name;
        }
}

TEST(Projection, APixelThatALensDoesNotReachHasNoPoint) {
    const auto barrel = intrinsics_of(ARHOST_DISTORTION_BROWN, {-0.28, 0, 0, 0});
    EXPECT_FALSE(Projection(barrel).on_plane({5000, 349}));
    EXPECT_FALSE(Projection(barrel).on_plane({std::nan(""), 0}));
}

} // namespace arhost::pose
