// SPDX-License-Identifier: Apache-2.0
#include <arhost/shading/lens.hpp>

#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>

#include <cmath>
#include <string>
#include <vector>

namespace arhost::shading {
namespace {

struct Model {
    std::string name;
    arhost_distortion distortion;
    std::vector<double> coefficients;
};

arhost_intrinsics intrinsics_of(const Model &model) {
    arhost_intrinsics in{sizeof in, 640, 480, model.distortion, 560, 540, 301.5, 262.25, 0, 0, {}, {}};
    in.coefficient_count = static_cast<std::uint32_t>(model.coefficients.size());
    std::copy(model.coefficients.begin(), model.coefficients.end(), in.coefficients);
    return in;
}

cv::Point2d opencv_pixel(const arhost_intrinsics &in, Vec3T<double> d) {
    const cv::Mat camera = (cv::Mat_<double>(3, 3) << in.fx, 0, in.cx, 0, in.fy, in.cy, 0, 0, 1);
    const std::vector<double> k(in.coefficients, in.coefficients + in.coefficient_count);
    const std::vector<cv::Point3d> points{{d.x, d.y, d.z}};
    std::vector<cv::Point2d> pixels;
    if (in.distortion == ARHOST_DISTORTION_FISHEYE)
        cv::fisheye::projectPoints(points, pixels, cv::Vec3d(0, 0, 0), cv::Vec3d(0, 0, 0), camera, k);
    else
        cv::projectPoints(points, cv::Vec3d(0, 0, 0), cv::Vec3d(0, 0, 0), camera, k, pixels);
    return pixels[0];
}

class EveryLens : public testing::TestWithParam<Model> {};

TEST_P(EveryLens, RayProjectsToItsPixelByOpenCv) {
    const arhost_intrinsics in = intrinsics_of(GetParam());
    const Lens lens(in);
    for (int y = -1; y <= 480; y += 37)
        for (int x = -1; x <= 640; x += 37) {
            const auto ray = lens.ray({x + 0.25, y + 0.0});
            ASSERT_TRUE(ray) << x << " " << y;
            const cv::Point2d pixel = opencv_pixel(in, *ray);
            EXPECT_NEAR(pixel.x, x + 0.25, 1e-6);
            EXPECT_NEAR(pixel.y, y, 1e-6);
        }
}

TEST_P(EveryLens, ProjectionInvertsTheRay) {
    const Lens lens(intrinsics_of(GetParam()));
    for (const Point2 pixel : {Point2{0, 0}, {639, 0}, {320, 240}, {301.5, 262.25}, {17.3, 479}}) {
        const auto ray = lens.ray(pixel);
        ASSERT_TRUE(ray);
        const auto back = lens.project(*ray);
        ASSERT_TRUE(back);
        EXPECT_NEAR(back->x, pixel.x, 1e-6);
        EXPECT_NEAR(back->y, pixel.y, 1e-6);
    }
}

TEST_P(EveryLens, LeafFunctionsMatchOpenCv) {
    const arhost_intrinsics in = intrinsics_of(GetParam());
    for (double y = -0.6; y <= 0.6; y += 0.15)
        for (double x = -0.6; x <= 0.6; x += 0.15) {
            const Vec3 d{x, y, 1};
            const Vec3 p = in.distortion == ARHOST_DISTORTION_FISHEYE ? kannala_brandt(kannala_brandt_of(in), d * 7)
                                                                      : brown_conrady(brown_conrady_of(in), d);
            const cv::Point2d pixel = opencv_pixel(in, d);
            EXPECT_NEAR(in.fx * p.x + in.cx, pixel.x, 1e-9);
            EXPECT_NEAR(in.fy * p.y + in.cy, pixel.y, 1e-9);
            EXPECT_EQ(p.z, 1);
        }
}

INSTANTIATE_TEST_SUITE_P(
    Models, EveryLens,
    testing::Values(Model{"pinhole", ARHOST_DISTORTION_NONE, {}},
                    Model{"brown4", ARHOST_DISTORTION_BROWN, {-0.28, 0.09, 0.0011, -0.0007}},
                    Model{"brown5", ARHOST_DISTORTION_BROWN, {0.12, -0.21, -0.002, 0.0015, 0.05}},
                    Model{"rational8", ARHOST_DISTORTION_BROWN, {0.4, -0.2, 0.0006, 0.0004, 0.02, 0.6, -0.1, 0.01}},
                    Model{"prism12",
                          ARHOST_DISTORTION_BROWN,
                          {-0.2, 0.05, 0.001, 0.002, 0, 0.02, 0.01, 0, 0.004, -0.002, 0.003, 0.001}},
                    Model{"fisheye", ARHOST_DISTORTION_FISHEYE, {0.05, -0.01, 0.004, -0.001}}),
    [](const auto &info) { return info.param.name; });

TEST(Lens, BrownRadialScaleIsTheRationalPolynomial) {
    const BrownConrady k{0.1, 0.02, 0, 0, 0.003, 0.4, 0.05, 0.006, 0, 0, 0, 0};
    EXPECT_NEAR(brown_conrady_radial(k, 2), (1 + 0.2 + 0.08 + 0.024) / (1 + 0.8 + 0.2 + 0.048), 1e-15);
    EXPECT_NEAR(brown_conrady(k, {-1, 1, 1}).y, brown_conrady_radial(k, 2), 1e-15);
}

TEST(Lens, FisheyeSlopeIsTheDerivativeOfTheRadius) {
    const KannalaBrandt k{0.05, -0.01, 0.004, -0.001};
    for (double angle = 0; angle < 1.8; angle += 0.1)
        EXPECT_NEAR(kannala_brandt_slope(k, angle),
                    (kannala_brandt_radius(k, angle + 1e-5) - kannala_brandt_radius(k, angle - 1e-5)) / 2e-5, 1e-8);
}

TEST(Lens, IgnoresCoefficientsBeyondTheirCount) {
    arhost_intrinsics in = intrinsics_of({"", ARHOST_DISTORTION_BROWN, {0.1, 0.2, 0.3, 0.4, 0.5}});
    in.coefficient_count = 4;
    EXPECT_EQ(brown_conrady_of(in).p2, 0.4);
    EXPECT_EQ(brown_conrady_of(in).k3, 0);
}

TEST(Lens, FisheyeSeesBehindItself) {
    arhost_intrinsics in = intrinsics_of({"", ARHOST_DISTORTION_FISHEYE, {0, 0, 0, 0}});
    in.fx = in.fy = 100;
    const auto ray = Lens(in).ray({in.cx + 100 * 2.0, in.cy}); // 2 rad from the axis
    ASSERT_TRUE(ray);
    EXPECT_NEAR(ray->x, std::sin(2.0), 1e-9);
    EXPECT_NEAR(ray->z, std::cos(2.0), 1e-9);
}

TEST(Lens, HasNoRayBeyondTheMonotonicLimit) {
    // r (1 − 0.5 r²) rises up to r = 0.816, where it is 0.544.
    const Lens lens(intrinsics_of({"", ARHOST_DISTORTION_BROWN, {-0.5, 0, 0, 0}}));
    EXPECT_TRUE(lens.ray({301.5 + 560 * 0.54, 262.25}));
    EXPECT_FALSE(lens.ray({301.5 + 560 * 0.55, 262.25}));
    EXPECT_FALSE(lens.project({1, 0, 1})) << "the point would fold back inwards";
}

TEST(Lens, DoesNotProjectPointsBehindTheCamera) {
    EXPECT_FALSE(Lens(intrinsics_of({"", ARHOST_DISTORTION_NONE, {}})).project({0, 0, -1}));
}

} // namespace
} // namespace arhost::shading
