// SPDX-License-Identifier: Apache-2.0
#include "bands.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <vector>

namespace rt_vulkan {
namespace {

constexpr std::uint32_t height = 1080;
using Milliseconds = Bands::Milliseconds;
constexpr Milliseconds max_time(100);

// Simulates an image whose rows take `ms_of_row` milliseconds each. Returns the heights of its bands.
std::vector<std::uint32_t> bands_of_image(Bands &bands, const std::function<double(std::uint32_t row)> &ms_of_row) {
    std::vector<std::uint32_t> sizes;
    for (std::uint32_t first = 0; first < height; first += sizes.back()) {
        sizes.push_back(std::min(bands.rows(), height - first));
        double ms = 0;
        for (std::uint32_t row = first; row < first + sizes.back(); ++row)
            ms += ms_of_row(row);
        bands.record(sizes.back(), Milliseconds(ms));
    }
    return sizes;
}

} // namespace

TEST(Bands, StartWithTheMinimum) {
    EXPECT_EQ(Bands(height, max_time).rows(), Bands::unit);
    EXPECT_EQ(Bands(3, max_time).rows(), Bands::unit);
}

TEST(Bands, GrowToOneFromTheThirdFastImageOn) {
    Bands bands(height, max_time);
    const auto fast = [](std::uint32_t) { return 0.01; };
    EXPECT_LE(bands_of_image(bands, fast).size(), 8u);
    EXPECT_LE(bands_of_image(bands, fast).size(), 2u);
    EXPECT_EQ(bands_of_image(bands, fast), (std::vector<std::uint32_t>{height}));
}

TEST(Bands, RestartWithTheMinimum) {
    Bands bands(height, max_time);
    bands.record(height, max_time / 100);
    bands.restart();
    EXPECT_EQ(bands.rows(), Bands::unit);
}

TEST(Bands, StayBelowTheMaximumTimeForSlowImages) {
    Bands bands(height, max_time);
    const auto slow = [](std::uint32_t) { return 1.6; };
    bands_of_image(bands, slow);
    for (const std::uint32_t rows : bands_of_image(bands, slow))
        EXPECT_LE(rows * 1.6, 100);
    EXPECT_GE(bands.rows() * 1.6, 50);
}

TEST(Bands, AreNeverMoreThanDoubled) {
    Bands bands(height, max_time);
    const std::vector<std::uint32_t> sizes =
        bands_of_image(bands, [](std::uint32_t row) { return row < 500 ? 0.001 : 20.0; });
    for (std::size_t i = 1; i < sizes.size(); ++i)
        EXPECT_LE(sizes[i], 2 * sizes[i - 1]);
    EXPECT_EQ(bands.rows(), Bands::unit) << "rows of 20 ms each";
}

TEST(Bands, AreMultiplesOfTheUnitForAnyTime) {
    Bands bands(height, max_time);
    for (const double ms : {0.0, 1e-9, 10.0, 30.0, 101.0, 49.0, 20.0, 1e9, 0.0}) {
        bands.record(bands.rows(), Milliseconds(ms));
        EXPECT_EQ(bands.rows() % Bands::unit, 0u) << ms;
        EXPECT_GE(bands.rows(), Bands::unit) << ms;
        EXPECT_LE(bands.rows(), height) << ms;
    }
}

} // namespace rt_vulkan
