// SPDX-License-Identifier: Apache-2.0
#include <fiducial/undistortion.hpp>

#include "rendered_marker.hpp"

#include <arhost-cpp/plugin.hpp>

#include <gmock/gmock.h>

#include <limits>

namespace {

using namespace arhost::test;
using arhost::fiducial::Lens;

arhost_intrinsics camera_of(arhost_distortion distortion, const std::vector<double> &coefficients) {
    return intrinsics_of({1280, 720}, 900, 910, 652, 349, distortion, coefficients);
}

TEST(Lens, DistortsAsTheAbiDefinesAndBack) {
    for (const auto &camera :
         {camera_of(ARHOST_DISTORTION_NONE, {}), camera_of(ARHOST_DISTORTION_BROWN, {-0.28, 0.09, 0.001, -0.0007}),
          camera_of(ARHOST_DISTORTION_BROWN, {0.135, -0.234, 0.0007, 0.0048, 0.02}),
          camera_of(ARHOST_DISTORTION_BROWN, {0.4, -0.1, 0.0005, 0.0003, 0.01, 0.5, -0.05, 0.004}),
          camera_of(ARHOST_DISTORTION_BROWN,
                    {0.4, -0.1, 0.0005, 0.0003, 0.01, 0.5, -0.05, 0.004, 0.001, -0.0005, 0.0008, 0.0002}),
          camera_of(ARHOST_DISTORTION_FISHEYE, {0.08, -0.03, 0.012, -0.003})}) {
        const Lens lens(camera);
        const Mt truth = pose_of(-120, 60, 600, 10, -50, -170);
        const auto corners = corners_of(truth, camera, 80);
        auto pinhole = camera;
        pinhole.distortion = ARHOST_DISTORTION_NONE;
        const auto straight = corners_of(truth, pinhole, 80);
        const auto undistorted = lens.undistort({corners.begin(), corners.end()});
        ASSERT_TRUE(undistorted);
        const auto distorted = lens.distort(*undistorted);
        ASSERT_TRUE(distorted);
        for (std::size_t i = 0; i < 4; ++i) {
            EXPECT_LT(cv::norm((*undistorted)[i] + cv::Point2d(camera.cx, camera.cy) - straight[i]), 1e-6);
            EXPECT_LT(cv::norm((*distorted)[i] - corners[i]), 1e-6);
        }
    }
}

TEST(Lens, ReturnsNothingWhereTheDistortionCannotBeInverted) {
    // The distorted radius r·(1 − 0.5 r²) has its maximum 0.544 at r = 0.816; no ray reaches pixels beyond that
    // radius.
    const Lens lens(intrinsics_of({640, 480}, 300, 300, 319.5, 239.5, ARHOST_DISTORTION_BROWN, {-0.5, 0, 0, 0}));
    EXPECT_TRUE(lens.undistort({{300, 220}, {340, 260}}));
    EXPECT_FALSE(lens.undistort({{300, 220}, {580, 220}}));
    EXPECT_TRUE(lens.distort({{0, 0}, {240, 0}}));
    EXPECT_FALSE(lens.distort({{0, 0}, {250, 0}}));
}

TEST(Lens, ReturnsNothingForPixelsThatAreNotFinite) {
    const Lens lens(camera_of(ARHOST_DISTORTION_NONE, {}));
    EXPECT_FALSE(lens.undistort({{10, std::numeric_limits<double>::quiet_NaN()}}));
    EXPECT_FALSE(lens.undistort({{std::numeric_limits<double>::infinity(), 10}}));
}

TEST(Lens, RejectsAnInvalidCalibration) {
    auto three_coefficients = camera_of(ARHOST_DISTORTION_BROWN, {0.1, 0.1, 0.1});
    auto fisheye_of_five = camera_of(ARHOST_DISTORTION_FISHEYE, {0, 0, 0, 0, 0});
    auto unknown_model = camera_of(99, {});
    auto no_focal_length = intrinsics_of({640, 480}, 0, 600, 320, 240);
    for (const auto &camera : {three_coefficients, fisheye_of_five, unknown_model, no_focal_length})
        try {
            Lens lens(camera);
            ADD_FAILURE() << "the invalid input was accepted";
        } catch (const arhost::Failure &failure) {
            EXPECT_EQ(failure.status(), ARHOST_STATUS_ERROR_CONFIGURATION);
            EXPECT_THAT(failure.what(), testing::HasSubstr("calibration"));
        }
}

} // namespace
