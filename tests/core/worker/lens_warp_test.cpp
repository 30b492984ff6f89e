// SPDX-License-Identifier: Apache-2.0
#include "worker/lens_warp.hpp"

#include "pixels/linear.hpp"

#include <arhost/shading/lens.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

using namespace arhost;
using worker::LensWarp;

namespace {

arhost_intrinsics lens(arhost_distortion distortion, std::vector<double> k) {
    arhost_intrinsics in{sizeof in, 320, 240, distortion, 260, 250, 172.3, 97.6, static_cast<std::uint32_t>(k.size()),
                         0,         {},  {}};
    std::copy(k.begin(), k.end(), in.coefficients);
    return in;
}

constexpr std::uint32_t width = 320, height = 240;

// Draws an antialiased disc in the pinhole image.
void draw_disc(const arhost_image &image, double x0, double y0, double radius) {
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x) {
            std::uint8_t *pixel = image.rgba + std::size_t{y} * image.stride + 4 * x;
            pixel[0] = 200, pixel[1] = 100, pixel[2] = 50;
            pixel[3] =
                static_cast<std::uint8_t>(255 * std::clamp(radius + 0.5 - std::hypot(x - x0, y - y0), 0.0, 1.0));
        }
}

// The image that LensWarp writes. Its old content must be replaced.
struct LensImage {
    std::vector<std::uint8_t> bytes = std::vector<std::uint8_t>(std::size_t{1344} * height, 77);
    arhost_image image{sizeof image, 1344, width, height, bytes.data(), nullptr, nullptr};
    const std::uint8_t *at(std::uint32_t x, std::uint32_t y) const { return &bytes[std::size_t{y} * 1344 + 4 * x]; }
};

void fill(const arhost_image &image) {
    std::fill_n(image.rgba, std::size_t{image.stride} * height, std::uint8_t{255});
}

} // namespace

TEST(LensWarp, MapsPinholePixelsToTheirLensPosition) {
    for (const arhost_intrinsics &in : {lens(ARHOST_DISTORTION_BROWN, {-0.3, 0.1, 0.002, -0.001}),
                                        lens(ARHOST_DISTORTION_FISHEYE, {0.05, -0.01, 0.004, -0.001})}) {
        LensWarp warp(in);
        const shading::Lens distortion(in);
        for (const auto &[px, py] : {std::pair{0.0, 0.0}, {0.4, 0.2}, {-0.5, -0.3}}) {
            const arhost_intrinsics &pinhole = warp.pinhole();
            draw_disc(warp.pinhole_image(), px * pinhole.fx + pinhole.cx, py * pinhole.fy + pinhole.cy, 6);
            const LensImage warped;
            warp.warp({}, warped.image);
            double area = 0, x_sum = 0, y_sum = 0;
            for (std::uint32_t y = 0; y < height; ++y)
                for (std::uint32_t x = 0; x < width; ++x) {
                    const std::uint8_t *pixel = warped.at(x, y);
                    area += pixel[3];
                    x_sum += pixel[3] * x;
                    y_sum += pixel[3] * y;
                    if (pixel[3] > 0) {
                        ASSERT_EQ(pixel[0], 200) << "the colour of edge pixels must not change";
                        ASSERT_EQ(pixel[2], 50);
                    }
                }
            const auto expected = distortion.project({px, py, 1});
            ASSERT_TRUE(expected);
            // The centroid of the warped disc differs slightly from the warped centre of the disc, by up to 0.2 px
            // here.
            EXPECT_NEAR(x_sum / area, expected->x, 0.2);
            EXPECT_NEAR(y_sum / area, expected->y, 0.2);
        }
    }
}

TEST(LensWarp, CoversTheWholeLensImage) {
    for (const arhost_intrinsics &in :
         {lens(ARHOST_DISTORTION_BROWN, {-0.3, 0.1, 0.002, -0.001}), lens(ARHOST_DISTORTION_BROWN, {0.2, -0.1, 0, 0}),
          lens(ARHOST_DISTORTION_FISHEYE, {0.05, -0.01, 0.004, -0.001})}) {
        LensWarp warp(in);
        fill(warp.pinhole_image());
        const LensImage warped;
        warp.warp({}, warped.image);
        for (std::uint32_t i = 0; i < width * height; ++i)
            ASSERT_EQ(warped.at(i % width, i / width)[3], 255) << i % width << " " << i / width;
    }
}

TEST(LensWarp, ReadsOnlyTheRegionEvenIfItExceedsTheImage) {
    LensWarp warp(lens(ARHOST_DISTORTION_BROWN, {-0.3, 0.1, 0.002, -0.001}));
    fill(warp.pinhole_image());
    const LensImage none;
    arhost_render_info region{sizeof region, 1, 10, 10, 0, 0, 0, 0, 0};
    warp.warp(region, none.image);
    for (std::uint32_t i = 0; i < width * height; ++i)
        ASSERT_EQ(none.at(i % width, i / width)[3], 0);
    region = {sizeof region, 1, 300, 200, 4'000'000'000u, 4'000'000'000u, 0, 0, 0};
    warp.warp(region, none.image); // AddressSanitizer detects reads outside the image
}

// The linear image that LensWarp writes. Its old content must be replaced.
struct LinearLensImage {
    static constexpr std::uint32_t stride = 16 * width + 64;
    std::vector<std::uint16_t> halves = std::vector<std::uint16_t>(std::size_t{stride} / 2 * height, 0x7e00);
    arhost_image image{sizeof image, stride, width, height, nullptr, halves.data(), nullptr};
    const LinearPixel &at(std::uint32_t x, std::uint32_t y) const { return linear_row(image, y)[x]; }
};

TEST(LensWarp, InterpolatesLightAndTransmittance) {
    const arhost_intrinsics in = lens(ARHOST_DISTORTION_BROWN, {-0.3, 0.1, 0.002, -0.001});
    LensWarp warp(in, ARHOST_IMAGE_FORM_LINEAR);
    const arhost_image pinhole = warp.pinhole_image();
    // A bright object left of the middle of the view, a coloured shadow right of it.
    const LinearPixel object = linear_pixel({4, 2, 1}, {0, 0, 0}), shadow = linear_pixel({0, 0, 0}, {0.5f, 1, 1.5f});
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x)
            linear_row(pinhole, y)[x] = x < warp.pinhole().cx ? object : shadow;
    const LinearLensImage warped;
    warp.warp({}, warped.image);
    int edges = 0;
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x) {
            const LinearPixel &p = warped.at(x, y);
            const float covered = float_of(p.added[0]) / 4;
            edges += covered > 0 && covered < 1;
            ASSERT_EQ(p.reserved_0 | p.reserved_1, 0);
            ASSERT_NEAR(float_of(p.added[1]), 2 * covered, 0.01) << x << " " << y;
            ASSERT_NEAR(float_of(p.transmittance[0]), 0.5f * (1 - covered), 0.01) << x << " " << y;
            ASSERT_NEAR(float_of(p.transmittance[2]), 1.5f * (1 - covered), 0.01) << x << " " << y;
        }
    EXPECT_GT(edges, static_cast<int>(height) / 2);
    EXPECT_NEAR(float_of(warped.at(10, 120).added[0]), 4, 0.01);
    EXPECT_NEAR(float_of(warped.at(310, 120).transmittance[2]), 1.5, 0.01);
}

TEST(LensWarp, LeavesUntouchedPixelsExactlyUntouched) {
    LensWarp warp(lens(ARHOST_DISTORTION_BROWN, {-0.3, 0.1, 0.002, -0.001}), ARHOST_IMAGE_FORM_LINEAR);
    const arhost_image pinhole = warp.pinhole_image();
    for (std::uint32_t y = 0; y < height; ++y)
        std::fill_n(linear_row(pinhole, y), width, untouched);
    const LinearLensImage warped;
    const auto expect_untouched = [&] {
        for (std::uint32_t i = 0; i < width * height; ++i)
            ASSERT_EQ(warped.at(i % width, i / width), untouched) << i % width << " " << i / width;
    };
    warp.warp({}, warped.image);
    expect_untouched();
    for (std::uint32_t y = 0; y < height; ++y)
        std::fill_n(linear_row(pinhole, y), width, LinearPixel{});
    warp.warp({sizeof(arhost_render_info), 1, 0, 0, 0, 0, 0, 0, 0}, warped.image);
    expect_untouched();
}

TEST(LensWarp, RendersToMemoryThatAGpuCanImport) {
    LensWarp linear(lens(ARHOST_DISTORTION_BROWN, {-0.3, 0.1, 0.002, -0.001}), ARHOST_IMAGE_FORM_LINEAR);
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(linear.pinhole_image().linear) % 4096, 0u);
    EXPECT_EQ(linear.pinhole_image().rgba, nullptr);
    LensWarp warp(lens(ARHOST_DISTORTION_BROWN, {-0.3, 0.1, 0.002, -0.001}));
    const arhost_image image = warp.pinhole_image();
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(image.rgba) % 4096, 0u);
    EXPECT_EQ(image.stride % 64, 0u);
    EXPECT_EQ(warp.pinhole_image().rgba, image.rgba);
}
