// SPDX-License-Identifier: Apache-2.0
#include "camera/artoolkit.hpp"

#include "artoolkit_bytes.hpp"
#include "camera/lens_model.hpp"
#include "errors.hpp"
#include "plugin_under_test.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>

#include <array>
#include <cmath>
#include <fstream>
#include <iterator>
#include <limits>
#include <random>

namespace arhost::camera {
namespace {

using test::artoolkit_version_4;
using test::ArtoolkitParameters;
using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

// Returns the error message without the name of the file.
std::string error_in(const std::string &bytes) {
    return test::after("camera_para.dat: ", test::error_of([&] { parse_artoolkit(bytes, "camera_para.dat"); }));
}
std::string error_in(const ArtoolkitParameters &parameters) {
    return error_in(parameters.bytes());
}

// The observed pixel of the point (x, y) of the plane z = 1: `mat`, then arParamIdeal2Observ of artoolkitX
// (Source/ARX/AR/paramDistortion.c). The version follows from the number of factors.
cv::Point2d observed(const ArtoolkitParameters &p, double x, double y) {
    const double ix = p.mat[0] * x + p.mat[1] * y + p.mat[2], iy = p.mat[5] * y + p.mat[6];
    const std::vector<double> &f = p.dist_factor;
    switch (f.size()) {
    case 4: { // arParamLoad swaps the last two factors of version 1
        const double s = f[3], factor = f[2], u = (ix - f[0]) * s, v = (iy - f[1]) * s;
        const double d = 1 - factor / 100000000.0 * (u * u + v * v);
        return {u * d + f[0], v * d + f[1]};
    }
    case 5: {
        const double u = (ix - f[0]) * f[2], v = (iy - f[1]) * f[2], l = u * u + v * v;
        const double d = 1 - f[3] / 100000000.0 * l - f[4] / 100000000.0 / 100000.0 * l * l;
        return {u * d + f[0], v * d + f[1]};
    }
    case 6: {
        const double u = (ix - f[0]) * f[2], v = (iy - f[1]) * f[2], l = u * u + v * v;
        const double d = 1 - f[4] / 100000000.0 * l - f[5] / 100000000.0 / 100000.0 * l * l;
        return {u * d * f[3] + f[0], v * d + f[1]};
    }
    case 9: {
        const double k1 = f[0], k2 = f[1], p1 = f[2], p2 = f[3], fx = f[4], fy = f[5], cx = f[6], cy = f[7], s = f[8];
        const double u = (ix - cx) * s / fx, v = (iy - cy) * s / fy, l = u * u + v * v;
        return {(u * (1 + k1 * l + k2 * l * l) + 2 * p1 * u * v + p2 * (l + 2 * u * u)) * fx + cx,
                (v * (1 + k1 * l + k2 * l * l) + p1 * (l + 2 * v * v) + 2 * p2 * u * v) * fy + cy};
    }
    default: {
        const double k1 = f[0], k2 = f[1], p1 = f[2], p2 = f[3], k3 = f[4], k4 = f[5], k5 = f[6], k6 = f[7];
        const double s1 = f[8], s2 = f[9], s3 = f[10], s4 = f[11], fx = f[12], fy = f[13], cx = f[14], cy = f[15];
        const double u = (ix - cx) * f[16] / fx, v = (iy - cy) * f[16] / fy, l = u * u + v * v;
        const double radial = (1 + k1 * l + k2 * l * l + k3 * l * l * l) / (1 + k4 * l + k5 * l * l + k6 * l * l * l);
        return {(u * radial + 2 * p1 * u * v + p2 * (l + 2 * u * u) + s1 * l + s2 * l * l) * fx + cx,
                (v * radial + p1 * (l + 2 * v * v) + 2 * p2 * u * v + s3 * l + s4 * l * l) * fy + cy};
    }
    }
}

// Returns the largest distance in the image between the pixel that ARToolKit observes and that of arhost, px.
double difference_px(const ArtoolkitParameters &p, const arhost_intrinsics &lens) {
    double largest = 0;
    int in_image = 0;
    for (double y = -0.6; y <= 0.6; y += 0.01)
        for (double x = -0.8; x <= 0.8; x += 0.01) {
            const cv::Point2d expected = observed(p, x, y);
            if (expected.x < 0 || expected.y < 0 || expected.x > p.xsize - 1 || expected.y > p.ysize - 1)
                continue;
            const glm::dvec2 pixel = *project(lens, {x, y, 1});
            largest = std::max(largest, std::hypot(pixel.x - expected.x, pixel.y - expected.y));
            ++in_image;
        }
    EXPECT_GT(in_image, 4000);
    return largest;
}

ArtoolkitParameters version_5() {
    const double s = 1.02;
    return {.mat = {600 / s, 0, 323.4, 0, 0, 590 / s, 237.6, 0, 0, 0, 1, 0},
            .dist_factor = {0.1, -0.2, 0.001, 0.002, 0.05, 0.2, -0.1, 0.03, 0.004, -0.005, 0.006, -0.007, 600, 590,
                            323.4, 237.6, s}};
}

struct Case {
    const char *name;
    ArtoolkitParameters parameters;
    double tolerance_px;
};

class Artoolkit : public testing::TestWithParam<Case> {};

} // namespace

TEST_P(Artoolkit, ProjectsLikeArtoolkitX) {
    const auto &[name, parameters, tolerance_px] = GetParam();
    const arhost_intrinsics lens = parse_artoolkit(parameters.bytes(), name);
    EXPECT_EQ(lens.width, 640u);
    EXPECT_EQ(lens.height, 480u);
    EXPECT_EQ(lens.distortion, ARHOST_DISTORTION_BROWN);
    EXPECT_LT(difference_px(parameters, lens), tolerance_px);
}

const std::vector<double> centred = {700, 0, 320, 0, 0, 700, 240, 0, 0, 0, 1, 0};
// Square pixels, and distortion around the principal point: a lens of arhost is equal. Otherwise the nearest one.
INSTANTIATE_TEST_SUITE_P(
    Versions, Artoolkit,
    testing::Values(
        Case{"Version1", {.mat = centred, .dist_factor = {320, 240, 26.2, 1.0127}}, 1e-9},
        Case{"Version2", {.mat = centred, .dist_factor = {320, 240, 1.02, 20, 5}}, 1e-9},
        Case{"Version3", {.mat = centred, .dist_factor = {320, 240, 1.02, 1, -20, 5}}, 1e-9},
        Case{"Version3WithAspectRatio", {.mat = centred, .dist_factor = {320, 240, 1.02, 1.1, 20, 5}}, 1e-9},
        Case{"Version4", artoolkit_version_4(), 1e-9}, Case{"Version5", version_5(), 1e-9},
        Case{"Version1OffCentre", {.mat = centred, .dist_factor = {318.5, 263.5, 26.2, 1.0127}}, 0.05},
        Case{"Version2WithSkew",
             {.mat = {700, 0.1, 320, 0, 0, 705, 240, 0, 0, 0, 1, 0}, .dist_factor = {322, 235, 1.01, 20, 0}},
             0.1}),
    [](const auto &info) { return std::string(info.param.name); });

TEST(ArtoolkitFile, ReadsTheFileOfArtoolkitX) {
    ARHOST_REQUIRE_SHARED_DATA("markers/artoolkit/camera_para.dat");
    std::ifstream stream(test::shared_data("markers/artoolkit/camera_para.dat"), std::ios::binary);
    const std::string bytes(std::istreambuf_iterator<char>(stream), {});
    const arhost_intrinsics lens = parse_artoolkit(bytes, "camera_para.dat");
    EXPECT_EQ(lens.width, 640u);
    EXPECT_EQ(lens.height, 480u);
    EXPECT_NEAR(lens.fx, 591.4092407, 1e-6);
    EXPECT_NEAR(lens.fy, 588.6488647, 1e-6);
    EXPECT_NEAR(lens.cx, 323.4479065, 1e-6);
    EXPECT_NEAR(lens.cy, 237.6065369, 1e-6);
    EXPECT_EQ(lens.coefficient_count, 4u);
    EXPECT_NEAR(lens.coefficients[0], 0.0991722867, 1e-9);
    EXPECT_NEAR(lens.coefficients[3], 0.0013129330, 1e-9);
}

// Version 4 stores the results of cv::calibrateCamera.
TEST(ArtoolkitFile, Version4ProjectsLikeOpenCv) {
    const ArtoolkitParameters parameters = artoolkit_version_4();
    const arhost_intrinsics lens = parse_artoolkit(parameters.bytes(), "camera_para.dat");
    const std::vector<cv::Point3d> points = {{0, 0, 1}, {0.5, 0.4, 1}, {-0.5, 0.3, 1}, {0.1, -0.4, 1}};
    const std::vector<double> &d = parameters.dist_factor;
    std::vector<cv::Point2d> expected;
    cv::projectPoints(points, cv::Vec3d(), cv::Vec3d(), cv::Matx33d(d[4], 0, d[6], 0, d[5], d[7], 0, 0, 1),
                      std::vector<double>(d.begin(), d.begin() + 4), expected);
    for (std::size_t i = 0; i < points.size(); ++i) {
        const auto pixel = project(lens, {points[i].x, points[i].y, points[i].z});
        EXPECT_NEAR(pixel->x, expected[i].x, 1e-9);
        EXPECT_NEAR(pixel->y, expected[i].y, 1e-9);
    }
}

TEST(ArtoolkitFile, HasNoDistortionIfAllFactorsAreZero) {
    ArtoolkitParameters parameters = artoolkit_version_4();
    std::fill_n(parameters.dist_factor.begin(), 4, 0);
    const arhost_intrinsics lens = parse_artoolkit(parameters.bytes(), "camera_para.dat");
    EXPECT_EQ(lens.distortion, ARHOST_DISTORTION_NONE);
    EXPECT_EQ(lens.coefficient_count, 0u);
    EXPECT_EQ(lens.fx, 600);
}

TEST(ArtoolkitFile, RejectsALensThatArhostLacks) {
    // Radial distortion in px, although the pixels are not square.
    const ArtoolkitParameters stretched = {.mat = {672.2, 0, 293, 0, 0, 738.8, 235, 0, 0, 0, 1, 0},
                                           .dist_factor = {265, 185, -78.5, 0.9153}};
    EXPECT_THAT(
        error_in(stretched),
        AllOf(StartsWith("the lens model of version 1 of ARToolKit's distortion differs from arhost's by up to "),
              HasSubstr("which is more than 0.1 px; calibrate again with artoolkitX or OpenCV")));
    ArtoolkitParameters skewed = artoolkit_version_4();
    skewed.mat[1] = 3;
    EXPECT_THAT(error_in(skewed), HasSubstr("which is more than 0.1 px"));
}

TEST(ArtoolkitFile, RejectsTruncatedFiles) {
    for (const ArtoolkitParameters &parameters : {artoolkit_version_4(), version_5()}) {
        const std::string bytes = parameters.bytes();
        for (std::size_t size = 0; size < bytes.size(); ++size)
            EXPECT_THAT(error_in(bytes.substr(0, size)), HasSubstr("truncated")) << size;
        EXPECT_THAT(error_in(bytes + "\n"), HasSubstr("is a binary file of"));
    }
    EXPECT_EQ(error_in(artoolkit_version_4().bytes().substr(0, 100)),
              "is a binary file of 100 bytes, but ARToolKit's camera parameters have 136, 144, 152, 176 or 240; if "
              "the file is truncated, copy it again; if it is YAML, save it as UTF-8 without NUL characters");
    EXPECT_EQ(error_in(artoolkit_version_4().bytes().substr(0, 136)),
              "dist_factor[3]: must be 0.1 to 10 as a scale, but is 0.0013; if the file is truncated, copy it again, "
              "otherwise calibrate again");
}

TEST(ArtoolkitFile, RejectsRandomBytes) {
    std::mt19937 random(1);
    for (const std::size_t size : {136, 144, 152, 176, 240})
        for (int i = 0; i < 100; ++i) {
            std::string bytes(size, '\0');
            for (char &byte : bytes)
                byte = static_cast<char>(random());
            EXPECT_THAT(error_in(bytes), StartsWith("xsize: must be 1 to 16384, but is "));
        }
}

TEST(ArtoolkitFile, ErrorsNameFieldAndFix) {
    const auto with = [](const auto &change) {
        ArtoolkitParameters parameters = artoolkit_version_4();
        change(parameters);
        return error_in(parameters);
    };
    EXPECT_EQ(with([](auto &p) { p.ysize = 0; }),
              "ysize: must be 1 to 16384, but is 0; is this a calibration of ARToolKit?");
    EXPECT_EQ(with([](auto &p) { p.mat[6] = std::numeric_limits<double>::infinity(); }),
              "mat[1][2]: must be a finite number; calibrate again");
    EXPECT_EQ(with([](auto &p) { p.dist_factor[2] = std::numeric_limits<double>::quiet_NaN(); }),
              "dist_factor[2]: must be a finite number; calibrate again");
    EXPECT_EQ(with([](auto &p) { p.mat[0] = -600; }),
              "mat[0][0], the focal length in px: must be greater than 0, but is -600; calibrate again");
    for (const int index : {3, 4, 7, 8, 9, 10, 11})
        EXPECT_THAT(with([&](auto &p) { p.mat[index] = 2; }),
                    StartsWith("mat: must be [fx, skew, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0]"));
    EXPECT_EQ(with([](auto &p) { p.dist_factor[5] = 0; }),
              "dist_factor[5]: must be greater than 0, but is 0; calibrate again");
    EXPECT_EQ(with([](auto &p) { p.dist_factor[0] = -5; }),
              "dist_factor: the distortion folds the image: no direction has the pixel (0, 0); calibrate again");
}

} // namespace arhost::camera
