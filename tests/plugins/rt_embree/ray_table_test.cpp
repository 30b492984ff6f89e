// SPDX-License-Identifier: Apache-2.0
#include "ray_table.hpp"

#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>

#include <cmath>
#include <vector>

namespace rt_embree {
namespace {

arhost_intrinsics intrinsics(arhost_distortion distortion, std::vector<double> k, std::uint32_t width = 643,
                             std::uint32_t height = 477) {
    arhost_intrinsics in{
        sizeof in, width, height, distortion, 560, 540, 301.5, 262.25, static_cast<std::uint32_t>(k.size()),
        0,         {},    {}};
    std::copy(k.begin(), k.end(), in.coefficients);
    return in;
}

cv::Point2d opencv_pixel(const arhost_intrinsics &in, double x, double y, double z) {
    const cv::Mat camera = (cv::Mat_<double>(3, 3) << in.fx, 0, in.cx, 0, in.fy, in.cy, 0, 0, 1);
    const std::vector<double> k(in.coefficients, in.coefficients + in.coefficient_count);
    const std::vector<cv::Point3d> points{{x, y, z}};
    std::vector<cv::Point2d> pixels;
    if (in.distortion == ARHOST_DISTORTION_FISHEYE)
        cv::fisheye::projectPoints(points, pixels, cv::Vec3d(0, 0, 0), cv::Vec3d(0, 0, 0), camera, k);
    else
        cv::projectPoints(points, cv::Vec3d(0, 0, 0), cv::Vec3d(0, 0, 0), camera, k, pixels);
    return pixels[0];
}

const std::vector<arhost_intrinsics> lenses = {intrinsics(ARHOST_DISTORTION_NONE, {}),
                                               intrinsics(ARHOST_DISTORTION_BROWN, {-0.28, 0.09, 0.0011, -0.0007}),
                                               intrinsics(ARHOST_DISTORTION_FISHEYE, {0.05, -0.01, 0.004, -0.001})};

TEST(RayTable, RaysProjectToTheirPixelsByOpenCv) {
    ThreadPool threads(2);
    for (const arhost_intrinsics &in : lenses) {
        const RayTable table(in, false, threads);
        for (int y = 0; y < 477; y += 7)
            for (int x = 0; x < 643; x += 3) {
                const auto d = table.direction(x, y);
                const cv::Point2d pixel = opencv_pixel(in, d.x, d.y, d.z);
                ASSERT_NEAR(pixel.x, x, 0.01);
                ASSERT_NEAR(pixel.y, y, 0.01);
            }
    }
}

TEST(RayTable, OffCentreSamplesProjectToTheirPositions) {
    ThreadPool threads(2);
    for (const arhost_intrinsics &in : lenses) {
        const RayTable table(in, true, threads);
        const Rays rays = table.rays();
        const int step = 16 * rays.dimensions;
        // Checks all blocks of the first tile. Lane 0 of a block is the block's top left pixel.
        for (int number = 0; number < 64; ++number) {
            const float *block = rays.blocks + number * rays.block_size();
            const double x = number % 8 * 4, y = number / 8 * 4;
            for (const arhost::raytracer_common::Sample &sample : arhost::raytracer_common::sample_positions(16)) {
                double d[3] = {0, 0, 1};
                for (int i = 0; i < rays.dimensions; ++i)
                    d[i] = block[16 * i] + block[step + 16 * i] * sample.x + block[2 * step + 16 * i] * sample.y;
                const cv::Point2d pixel = opencv_pixel(in, d[0], d[1], d[2]);
                ASSERT_NEAR(pixel.x, x + sample.x, 0.01);
                ASSERT_NEAR(pixel.y, y + sample.y, 0.01);
            }
        }
    }
}

TEST(RayTable, TilesPartitionTheImageAndWindowsContainTheirRays) {
    ThreadPool threads(1);
    for (const arhost_intrinsics &in : lenses) {
        const RayTable table(in, false, threads);
        std::vector<int> covered(643 * 477, 0);
        for (std::size_t i = 0; i < table.tiles().size(); ++i) {
            const Rectangle &r = table.tiles()[i].pixels;
            for (int y = r.y0; y < r.y1; ++y)
                for (int x = r.x0; x < r.x1; ++x) {
                    ++covered[y * 643 + x];
                    const auto d = table.direction(x, y);
                    const double u = d.x / d.z, v = d.y / d.z;
                    ASSERT_TRUE(table.window(i).intersects({u - 1e-6, v - 1e-6, u + 1e-6, v + 1e-6, false}));
                }
        }
        EXPECT_TRUE(std::all_of(covered.begin(), covered.end(), [](int count) { return count == 1; }));
    }
}

TEST(RayTable, HasNoRayForPixelsOutsideTheLens) {
    ThreadPool threads(1);
    const RayTable table(intrinsics(ARHOST_DISTORTION_BROWN, {-0.5, 0, 0, 0}), false, threads);
    EXPECT_TRUE(std::isnan(table.direction(0, 0).x));
    EXPECT_FALSE(std::isnan(table.direction(301, 262).x));
}

} // namespace
} // namespace rt_embree
