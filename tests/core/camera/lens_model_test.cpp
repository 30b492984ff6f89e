// SPDX-License-Identifier: Apache-2.0
#include "camera/calibration.hpp"
#include "camera/lens_model.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>

#include <limits>
#include <random>
#include <vector>

namespace arhost::camera {
namespace {

arhost_intrinsics lens(arhost_distortion model, const std::vector<double> &coefficients) {
    arhost_intrinsics intrinsics{};
    intrinsics.struct_size = sizeof intrinsics;
    intrinsics.width = 640;
    intrinsics.height = 480;
    intrinsics.distortion = model;
    intrinsics.fx = 628.158;
    intrinsics.fy = 627.25;
    intrinsics.cx = 324.099;
    intrinsics.cy = 250.908;
    intrinsics.coefficient_count = static_cast<std::uint32_t>(coefficients.size());
    std::copy(coefficients.begin(), coefficients.end(), intrinsics.coefficients);
    return intrinsics;
}

std::vector<cv::Point3d> points_in_view() {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> slope(-0.6, 0.6), depth_mm(100, 3000);
    std::vector<cv::Point3d> points{{0, 0, 1000}, {1e-7, 0, 1000}};
    for (int i = 0; i < 500; ++i) {
        const double z = depth_mm(random);
        points.emplace_back(slope(random) * z, slope(random) * z, z);
    }
    return points;
}

void expect_projection(const std::vector<cv::Point2d> &expected, const arhost_intrinsics &intrinsics) {
    const std::vector<cv::Point3d> points = points_in_view();
    for (std::size_t i = 0; i < points.size(); ++i) {
        const auto pixel = project(intrinsics, {points[i].x, points[i].y, points[i].z});
        ASSERT_TRUE(pixel);
        ASSERT_NEAR(pixel->x, expected[i].x, 1e-9);
        ASSERT_NEAR(pixel->y, expected[i].y, 1e-9);
    }
}

cv::Matx33d matrix(const arhost_intrinsics &i) {
    return {i.fx, 0, i.cx, 0, i.fy, i.cy, 0, 0, 1};
}

class BrownLens : public testing::TestWithParam<std::vector<double>> {};

} // namespace

TEST_P(BrownLens, ProjectsLikeOpenCv) {
    const auto intrinsics = lens(GetParam().empty() ? ARHOST_DISTORTION_NONE : ARHOST_DISTORTION_BROWN, GetParam());
    std::vector<cv::Point2d> expected;
    cv::projectPoints(points_in_view(), cv::Vec3d(), cv::Vec3d(), matrix(intrinsics), GetParam(), expected);
    expect_projection(expected, intrinsics);
}
INSTANTIATE_TEST_SUITE_P(Coefficients, BrownLens,
                         testing::Values(std::vector<double>{}, std::vector<double>{0.12, -0.31, 0.002, -0.003},
                                         std::vector<double>{0.0995485, -0.206384, 0.00754589, 0.00336531, 0.05},
                                         std::vector<double>{0.1, -0.2, 0.001, 0.002, 0.05, 0.2, -0.1, 0.03},
                                         std::vector<double>{0.1, -0.2, 0.001, 0.002, 0.05, 0.2, -0.1, 0.03, 0.004,
                                                             -0.005, 0.006, -0.007}));

TEST(FisheyeLens, ProjectsLikeOpenCv) {
    const std::vector<double> k{0.07, -0.02, 0.013, -0.004};
    const auto intrinsics = lens(ARHOST_DISTORTION_FISHEYE, k);
    std::vector<cv::Point2d> expected;
    cv::fisheye::projectPoints(points_in_view(), expected, cv::Vec3d(), cv::Vec3d(), matrix(intrinsics), k);
    expect_projection(expected, intrinsics);
}

// Pixel centres are at integer coordinates, so the centre of an image of 640 px is between pixels 319 and 320.
TEST(Lens, ProjectsTheOpticalAxisToTheImageCentre) {
    const auto camera = parse_camera(yaml::Node::parse("{width: 640, height: 480, fx: 600}", "lab.yaml"));
    const auto pixel = project(camera, {0, 0, 1000});
    ASSERT_TRUE(pixel);
    EXPECT_EQ(*pixel, glm::dvec2(319.5, 239.5));
    EXPECT_EQ(*project(camera, {10, 20, 1000}), glm::dvec2(325.5, 251.5)); // to the right of the centre and below it
}

TEST(Lens, DoesNotProjectPointsBehindTheCamera) {
    const auto intrinsics = lens(ARHOST_DISTORTION_NONE, {});
    EXPECT_FALSE(project(intrinsics, {0, 0, 0}));
    EXPECT_FALSE(project(intrinsics, {10, 10, -500}));
}

TEST(Lens, IsRefusedIfItsSensorIsTilted) {
    std::vector<double> coefficients(ARHOST_MAX_DISTORTION);
    EXPECT_EQ(problem_with_lens(lens(ARHOST_DISTORTION_BROWN, coefficients)), "");
    for (const std::size_t tilt : {12, 13}) {
        coefficients.assign(ARHOST_MAX_DISTORTION, 0);
        coefficients[tilt] = 0.01;
        EXPECT_EQ(problem_with_lens(lens(ARHOST_DISTORTION_BROWN, coefficients)),
                  "a tilted sensor (tauX, tauY) is not supported; calibrate without CALIB_TILTED_MODEL");
    }
}

TEST(Lens, IsRefusedIfItDistortsTheImagesCentre) {
    EXPECT_EQ(problem_with_lens(lens(ARHOST_DISTORTION_NONE, {})), "");
    EXPECT_EQ(problem_with_lens(lens(ARHOST_DISTORTION_BROWN, {-0.4, 0.2, 0.002, -0.001, -0.1})), "");
    EXPECT_EQ(problem_with_lens(lens(ARHOST_DISTORTION_BROWN, {8, -30, 0, 0, 20, 8.3, -29, 18})), "")
        << "rational models have large coefficients that compensate each other";
    EXPECT_EQ(problem_with_lens(lens(ARHOST_DISTORTION_FISHEYE, {0.1, -0.05, 0.01, -0.002})), "");
    for (const arhost_distortion model : {ARHOST_DISTORTION_BROWN, ARHOST_DISTORTION_FISHEYE})
        for (std::size_t i = 0; i < (model == ARHOST_DISTORTION_BROWN ? untilted_coefficients : 4); ++i)
            for (const double coefficient : {1e30, -1e30, 1e300, std::numeric_limits<double>::quiet_NaN()}) {
                std::vector<double> coefficients(i + 1);
                coefficients.back() = coefficient;
                EXPECT_THAT(problem_with_lens(lens(model, coefficients)),
                            testing::StartsWith("the lens distortion is implausible: near the principal point it "))
                    << i << " " << coefficient;
            }
}

} // namespace arhost::camera
