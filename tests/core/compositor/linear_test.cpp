// SPDX-License-Identifier: Apache-2.0
#include "compositor/compositor.hpp"
#include "pixels/linear.hpp"
#include "pixels/rows.hpp"

#include "../pixels/instruction_sets.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

namespace arhost {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr OverlayFormat linear_format{ARHOST_IMAGE_FORM_LINEAR, ARHOST_COMPOSITING_LINEAR};

LinearPixel pixel_of(float added, float transmittance) {
    const std::uint16_t a = half_of(added), t = half_of(transmittance);
    return {{a, a, a}, 0, {t, t, t}, 0};
}

int exact_code(double light) {
    return shading::srgb8_exact(std::clamp(light, 0.0, 1.0));
}

arhost_frame_format bgr(std::uint32_t width, std::uint32_t height) {
    arhost_frame_format format{};
    format.struct_size = sizeof format;
    format.pixel_format = ARHOST_PIXEL_FORMAT_BGR8;
    format.width = width;
    format.height = height;
    EXPECT_TRUE(arhost_frame_layout(&format));
    return format;
}

Bytes added_light(const Bytes &video, const std::vector<LinearPixel> &overlay) {
    Bytes out(video.size());
    rows::add_light(video.data(), overlay.data()->added, out.data(), overlay.size());
    return out;
}

} // namespace

TEST(Half, RoundTripsEveryNumber) {
    for (std::uint32_t half = 0; half < 0x10000; ++half) {
        const float number = float_of(static_cast<std::uint16_t>(half));
        if (std::isnan(number))
            EXPECT_TRUE(std::isnan(float_of(half_of(number))));
        else
            ASSERT_EQ(half_of(number), half) << number;
    }
    EXPECT_EQ(float_of(0x3c00), 1);
    EXPECT_EQ(float_of(0x0001), 0x1p-24f);
    EXPECT_EQ(float_of(0x7bff), 65504);
}

TEST(Half, RoundsToNearestEven) {
    EXPECT_EQ(half_of(1 + 0x1p-11f), 0x3c00);
    EXPECT_EQ(half_of(1 + 0x3p-11f), 0x3c02);
    EXPECT_EQ(half_of(0x1p-25f), 0);
    EXPECT_EQ(half_of(0x3p-25f), 2);
    EXPECT_EQ(half_of(65519), 0x7bff);
    EXPECT_EQ(half_of(65520), 0x7c00);
}

TEST(CompositeLinear, MatchesTheFormulaForAnyNumbersOnEachInstructionSet) {
    std::mt19937 random(1);
    std::vector<LinearPixel> overlay(20'000);
    for (LinearPixel &pixel : overlay)
        if (random() % 4 == 0)
            pixel = untouched;
        else // any bits, among them NaN, infinity and negative numbers
            for (int c = 0; c < 3; ++c) {
                pixel.added[c] = static_cast<std::uint16_t>(random());
                pixel.transmittance[c] = static_cast<std::uint16_t>(random());
                pixel.reserved_0 = pixel.reserved_1 = static_cast<std::uint16_t>(random());
            }
    Bytes video(3 * overlay.size());
    for (std::uint8_t &code : video)
        code = static_cast<std::uint8_t>(random());
    Bytes expected = video;
    for (std::size_t i = 0; i < overlay.size(); ++i)
        for (std::size_t c = 0; c < 3; ++c)
            if (overlay[i] != untouched)
                expected[3 * i + c] =
                    added_and_transmitted(overlay[i].added[2 - c], overlay[i].transmittance[2 - c], video[3 * i + c]);
    test::on_each_instruction_set([&] { EXPECT_EQ(added_light(video, overlay), expected); });
}

TEST(CompositeLinear, ShowsBlackForNaNAndNegativeNumbersAndWhiteForInfinity) {
    const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
    const std::vector<LinearPixel> overlay{pixel_of(nan, 1),      pixel_of(-1, 0.5f),  pixel_of(infinity, 0),
                                           pixel_of(0, infinity), pixel_of(0.1f, nan), pixel_of(-infinity, infinity)};
    const Bytes video(3 * overlay.size(), 128);
    test::on_each_instruction_set([&] {
        const Bytes out = added_light(video, overlay);
        for (std::size_t i = 0; i < overlay.size(); ++i)
            EXPECT_EQ(out[3 * i], i == 2 || i == 3 ? 255 : 0) << i;
    });
}

TEST(CompositeLinear, IsWithinOneCodeOfDoublesInSpiteOfHalves) {
    int off = 0, greatest = 0, count = 0;
    for (int a = 0; a <= 1000; ++a)
        for (int t = 0; t <= 100; ++t) {
            const double added = a / 1000.0, transmittance = t / 50.0;
            const std::vector<LinearPixel> overlay{
                pixel_of(static_cast<float>(added), static_cast<float>(transmittance))};
            for (int code = 0; code < 256; code += 17) {
                const auto video = static_cast<std::uint8_t>(code);
                const Bytes out = added_light(Bytes(3, video), overlay);
                const int difference =
                    std::abs(out[0] - exact_code(added + transmittance * shading::srgb_decode(code / 255.0)));
                greatest = std::max(greatest, difference);
                off += difference > 0;
                ++count;
            }
        }
    RecordProperty("off_by_one", off);
    RecordProperty("count", count);
    EXPECT_LE(greatest, 1);
    EXPECT_LT(off, count / 20);
}

TEST(CompositeLinear, KeepsEveryCodeOfTheVideoWhereNothingChanges) {
    Bytes video;
    for (int code = 0; code < 256; ++code)
        video.insert(video.end(), 3, static_cast<std::uint8_t>(code));
    EXPECT_EQ(added_light(video, std::vector<LinearPixel>(256, untouched)), video);
    // Also where an object adds no visible light to the whole video.
    EXPECT_EQ(added_light(video, std::vector<LinearPixel>(256, pixel_of(0x1p-24f, 1))), video);
}

TEST(CompositeLinear, ReadsOnlyTheRegion) {
    const arhost_frame_format format = bgr(20, 10);
    const std::vector<LinearPixel> overlay(200, pixel_of(1, 0));
    const Bytes video(format.byte_size, 7);
    const std::uint8_t *planes[ARHOST_MAX_PLANES] = {video.data()};
    Bytes out(600);
    composite(format, planes, {reinterpret_cast<const std::uint8_t *>(overlay.data()), 320, linear_format},
              {3, 2, 5, 100}, {out.data(), 60});
    for (std::size_t y = 0; y < 10; ++y)
        for (std::size_t x = 0; x < 20; ++x)
            ASSERT_EQ(out[60 * y + 3 * x], y >= 2 && x >= 3 && x < 8 ? 255 : 7) << x << ", " << y;
}

TEST(CompositeStraight, BlendsLightIfRequested) {
    const arhost_frame_format format = bgr(256, 256);
    Bytes video, overlay;
    for (int alpha = 0; alpha < 256; ++alpha)
        for (int code = 0; code < 256; ++code) {
            video.insert(video.end(), 3, static_cast<std::uint8_t>(code));
            overlay.insert(overlay.end(), 3, 200);
            overlay.push_back(static_cast<std::uint8_t>(alpha));
        }
    const std::uint8_t *planes[ARHOST_MAX_PLANES] = {video.data()};
    Bytes out(video.size());
    composite(format, planes, {overlay.data(), 1024, {ARHOST_IMAGE_FORM_STRAIGHT, ARHOST_COMPOSITING_LINEAR}},
              {0, 0, 256, 256}, {out.data(), 768});
    for (int alpha = 0; alpha < 256; ++alpha)
        for (int code = 0; code < 256; ++code) {
            const double share = alpha / 255.0;
            const int expected = alpha == 0     ? code
                                 : alpha == 255 ? 200
                                                : exact_code(share * shading::srgb_decode(200 / 255.0) +
                                                             (1 - share) * shading::srgb_decode(code / 255.0));
            const int shown = out[3 * (256 * static_cast<std::size_t>(alpha) + static_cast<std::size_t>(code))];
            ASSERT_LE(std::abs(shown - expected), alpha == 0 || alpha == 255 ? 0 : 1) << alpha << ", " << code;
        }
}

TEST(Enlarge, InterpolatesLightAndTransmittance) {
    std::vector<LinearPixel> small(16, untouched), large(64);
    small[5] = pixel_of(0.5f, 0);
    const Region region = enlarge({reinterpret_cast<const std::uint8_t *>(small.data()), 64, linear_format}, 4, 4,
                                  {1, 1, 1, 1}, bgr(8, 8), reinterpret_cast<std::uint8_t *>(large.data()), 128);
    float added = 0, removed = 0;
    for (std::size_t y = 0; y < 8; ++y)
        for (std::size_t x = 0; x < 8; ++x) {
            const bool inside = x - region.x < region.width && y - region.y < region.height;
            const LinearPixel &pixel = large[8 * y + x];
            EXPECT_EQ(pixel.reserved_0, 0);
            added += inside ? float_of(pixel.added[0]) : 0;
            removed += inside ? 1 - float_of(pixel.transmittance[0]) : 0;
        }
    EXPECT_NEAR(added, 4 * 0.5f, 1e-2f);
    EXPECT_NEAR(removed, 4, 1e-2f);
    EXPECT_EQ(large[8 * region.y + region.x], untouched);
}

TEST(Enlarge, InterpolatesLinearPixelsOnEachInstructionSet) {
    constexpr std::size_t from = 50, count = 200;
    std::mt19937 random(1);
    std::vector<LinearPixel> images[2];
    for (auto &row : images)
        for (std::size_t i = 0; i < from; ++i)
            row.push_back(i < 10 ? pixel_of(0x3p-24f, 1.5f)
                                 : pixel_of(random() % 1000 / 300.0f, random() % 1000 / 999.0f));
    std::vector<rows::Between> columns;
    for (std::uint32_t i = 0; i < count; ++i)
        columns.push_back(
            {i / 4, std::min<std::uint32_t>(i / 4 + 1, from - 1), static_cast<std::uint32_t>(random() % 129)});
    test::on_each_instruction_set([&] {
        std::vector<LinearPixel> out(count);
        rows::interpolate_light(images[0].data()->added, images[1].data()->added, 32, columns.data(),
                                out.data()->added, count);
        for (std::size_t i = 0; i < count; ++i) {
            if (columns[i].second < 10) {
                ASSERT_EQ(out[i], images[0][0]) << "equal pixels";
                continue;
            }
            const auto expected = [&](auto member) {
                const auto in_row = [&](const std::vector<LinearPixel> &row) {
                    return std::lerp(float_of((row[columns[i].first].*member)[1]),
                                     float_of((row[columns[i].second].*member)[1]), columns[i].weight / 128.0f);
                };
                return std::lerp(in_row(images[0]), in_row(images[1]), 0.25f);
            };
            ASSERT_NEAR(float_of(out[i].added[1]), expected(&LinearPixel::added), 2e-3);
            ASSERT_NEAR(float_of(out[i].transmittance[1]), expected(&LinearPixel::transmittance), 2e-3);
        }
    });
}

TEST(StraightFromLinear, IsExactWhereVideoIsHiddenOrUnchanged) {
    const std::vector<LinearPixel> linear{untouched, pixel_of(0.5f, 0), pixel_of(0.25f, 0.5f), pixel_of(0, 0.25f),
                                          pixel_of(0.1f, 1.5f)};
    Bytes rgba(4 * linear.size(), 99);
    straight_from_linear(linear.data()->added, rgba.data(), linear.size());
    const auto half_light = static_cast<std::uint8_t>(exact_code(0.5));
    EXPECT_EQ(rgba, (Bytes{0,          0,          0,          0,   //
                           half_light, half_light, half_light, 255, //
                           half_light, half_light, half_light, 128, //
                           0,          0,          0,          191, //
                           0,          0,          0,          0}));
}

} // namespace arhost
