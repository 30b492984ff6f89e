// SPDX-License-Identifier: Apache-2.0
#include "raytracer_common/samples.hpp"

#include <gtest/gtest.h>

#include <array>
#include <set>

namespace arhost::raytracer_common {
namespace {

TEST(SamplePositions, HaveOneInEachRowAndColumnAndAreCentred) {
    for (unsigned count = 1; count <= 256; ++count) {
        std::set<unsigned> rows, columns;
        double x = 0, y = 0;
        for (const Sample &sample : sample_positions(count)) {
            columns.insert(static_cast<unsigned>((sample.x + 0.5f) * static_cast<float>(count)));
            rows.insert(static_cast<unsigned>((sample.y + 0.5f) * static_cast<float>(count)));
            x += sample.x;
            y += sample.y;
        }
        EXPECT_EQ(rows.size(), count);
        EXPECT_EQ(columns.size(), count);
        EXPECT_NEAR(x, 0, 1e-4);
        EXPECT_NEAR(y, 0, 1e-4);
    }
}

TEST(SamplePositions, SequenceStartsAtTheCentreAndContinues) {
    const auto all = sample_positions(0, 12), later = sample_positions(5, 7);
    EXPECT_EQ(all[0].x, 0);
    EXPECT_EQ(all[0].y, 0);
    ASSERT_EQ(later.size(), 7u);
    for (std::size_t i = 0; i < later.size(); ++i) {
        EXPECT_EQ(later[i].x, all[5 + i].x);
        EXPECT_EQ(later[i].y, all[5 + i].y);
    }
}

TEST(SamplePositions, SequenceStaysEvenlyDistributed) {
    for (const std::uint32_t first : {0u, 1000u, 60000u}) {
        std::array<int, 64> cells{};
        for (const Sample &sample : sample_positions(first, 4096)) {
            ASSERT_TRUE(sample.x >= -0.5f && sample.x <= 0.5f && sample.y >= -0.5f && sample.y <= 0.5f);
            const int column = std::min(static_cast<int>((sample.x + 0.5f) * 8), 7);
            const int row = std::min(static_cast<int>((sample.y + 0.5f) * 8), 7);
            ++cells[static_cast<std::size_t>(8 * row + column)];
        }
        for (const int count : cells) // the mean is 64; the standard deviation of random samples would be 8
            EXPECT_NEAR(count, 64, 4);
    }
}

} // namespace
} // namespace arhost::raytracer_common
