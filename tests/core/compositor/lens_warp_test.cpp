// SPDX-License-Identifier: Apache-2.0
#include "compositor/lens_warp.hpp"

#include <arhost/shading/lens.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

using namespace arhost;

namespace {

arhost_intrinsics lens(arhost_distortion distortion, std::vector<double> k) {
    arhost_intrinsics in{sizeof in, 320, 240, distortion, 260, 250, 172.3, 97.6, static_cast<std::uint32_t>(k.size()),
                         0,         {}};
    std::copy(k.begin(), k.end(), in.coefficients);
    return in;
}

// Draws an antialiased disc in the pinhole image.
std::vector<std::uint8_t> disc(double x0, double y0, double radius) {
    std::vector<std::uint8_t> image(std::size_t{320} * 240 * 4);
    for (int y = 0; y < 240; ++y)
        for (int x = 0; x < 320; ++x) {
            std::uint8_t *pixel = &image[4 * (y * 320 + x)];
            pixel[0] = 200, pixel[1] = 100, pixel[2] = 50;
            pixel[3] =
                static_cast<std::uint8_t>(255 * std::clamp(radius + 0.5 - std::hypot(x - x0, y - y0), 0.0, 1.0));
        }
    return image;
}

} // namespace

TEST(LensWarp, MapsPinholePixelsToTheirLensPosition) {
    for (const arhost_intrinsics &in : {lens(ARHOST_DISTORTION_BROWN, {-0.3, 0.1, 0.002, -0.001}),
                                        lens(ARHOST_DISTORTION_FISHEYE, {0.05, -0.01, 0.004, -0.001})}) {
        LensWarp warp(in);
        const shading::Lens distortion(in);
        for (const auto &[px, py] : {std::pair{0.0, 0.0}, {0.4, 0.2}, {-0.5, -0.3}}) {
            const arhost_intrinsics &pinhole = warp.pinhole();
            const auto image = disc(px * pinhole.fx + pinhole.cx, py * pinhole.fy + pinhole.cy, 6);
            const ImageView warped = warp.warp({image.data(), 320 * 4}, {0, 0, 320, 240});
            double area = 0, x_sum = 0, y_sum = 0;
            for (int y = 0; y < 240; ++y)
                for (int x = 0; x < 320; ++x) {
                    const std::uint8_t *pixel = warped.rgba + y * warped.stride + 4 * x;
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
        const std::vector<std::uint8_t> opaque(std::size_t{320} * 240 * 4, 255);
        const ImageView warped = warp.warp({opaque.data(), 320 * 4}, {0, 0, 320, 240});
        for (int i = 0; i < 320 * 240; ++i)
            ASSERT_EQ(warped.rgba[4 * i + 3], 255) << i % 320 << " " << i / 320;
    }
}

TEST(LensWarp, ReadsOnlyTheRegionEvenIfItExceedsTheImage) {
    LensWarp warp(lens(ARHOST_DISTORTION_BROWN, {-0.3, 0.1, 0.002, -0.001}));
    const std::vector<std::uint8_t> opaque(std::size_t{320} * 240 * 4, 255);
    const ImageView none = warp.warp({opaque.data(), 320 * 4}, {10, 10, 0, 0});
    EXPECT_TRUE(std::all_of(none.rgba, none.rgba + 320 * 240 * 4, [](std::uint8_t byte) { return byte == 0; }));
    warp.warp({opaque.data(), 320 * 4},
              {300, 200, 4'000'000'000u, 4'000'000'000u}); // AddressSanitizer detects reads outside the image
}
