// SPDX-License-Identifier: Apache-2.0
#include <fiducial/fits.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

namespace {

using arhost::fiducial::BlurredEdge;
using arhost::fiducial::EdgePixel;
using arhost::fiducial::fit_blurred_edge;

struct Edge {
    double offset_px = 0.2, turn = 0.01, blur_px = 0.7, before = 20, after = 180;

    double at_px(double along_px) const { return offset_px + turn * along_px; }
    double light(double along_px, double across_px) const {
        const double z = (across_px - at_px(along_px)) / blur_px;
        return before + (after - before) * 0.5 * std::erfc(-z / std::numbers::sqrt2);
    }
};

// Pixels of 40 columns, one px apart, whose places within the columns differ.
std::vector<EdgePixel> pixels_of(const Edge &edge, double noise = 0, std::uint32_t seed = 1) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    std::vector<EdgePixel> pixels;
    for (int column = 0; column < 40; ++column)
        for (int i = -3; i <= 3; ++i) {
            const double along_px = column - 12.0, across_px = i + 0.37 * column - std::round(0.37 * column);
            pixels.push_back({along_px, across_px, edge.light(along_px, across_px) + noise * normal(random), column});
        }
    return pixels;
}

double at_px(const BlurredEdge &found, double along_px) {
    return found.offset_px + found.turn * (along_px - found.pivot_px);
}

TEST(BlurredEdge, IsWhereThePixelsShowIt) {
    for (const Edge &edge : {Edge{}, Edge{-0.4, -0.02, 0.7}, Edge{0.3, 0, 0.4}, Edge{0.1, 0.01, 1.2},
                             Edge{0.2, 0.01, 0.7, 180, 20}, Edge{0.2, 0.01, 0.7, 3, 5}}) {
        const auto found = fit_blurred_edge(pixels_of(edge), 0.8);
        ASSERT_TRUE(found);
        for (const double along_px : {-12.0, 27.0})
            EXPECT_NEAR(at_px(*found, along_px), edge.at_px(along_px), 1e-3);
        EXPECT_NEAR(found->blur_px, edge.blur_px, 1e-2);
    }
}

// A change of the light could be taken for one of the direction.
TEST(BlurredEdge, IsWhereThePixelsShowItInUnevenLight) {
    const Edge edge;
    for (const double slope : {0.001, -0.003, 0.01}) // 4 to 40 % from end to end
        for (const bool is_glare : {false, true}) {  // adds light, also to the dark area
            if (is_glare && slope > 0.003)
                continue; // as much as the contrast
            auto pixels = pixels_of(edge, 1);
            for (EdgePixel &pixel : pixels)
                pixel.light += (is_glare ? edge.after : pixel.light) * slope * pixel.along_px;
            const auto found = fit_blurred_edge(pixels, 0.8);
            ASSERT_TRUE(found) << slope << " " << is_glare;
            for (const double along_px : {-12.0, 27.0})
                EXPECT_NEAR(at_px(*found, along_px), edge.at_px(along_px), 0.012) << slope << " " << is_glare;
        }
}

// Along edges that nearly follow the rows of pixels, the tail of the blur resembles a change of the light.
TEST(BlurredEdge, IsWhereThePixelsShowItIfItNearlyFollowsTheirRows) {
    for (const double degrees : {0.3, 0.6, 1.0, 2.0})
        for (const double blur_px : {0.4, 0.7}) {
            const double turn = std::tan(degrees * std::numbers::pi / 180);
            std::vector<EdgePixel> pixels; // averages over squares, beside a line that follows the edge
            const Edge edge{0, 0, blur_px};
            for (int column = 0; column < 40; ++column)
                for (int row = -4; row <= 4; ++row) {
                    const double along_px = column - 20.0, across_px = row - std::round(turn * along_px);
                    double light = 0;
                    for (const double within : {-0.375, -0.125, 0.125, 0.375})
                        light += edge.light(0, across_px + within - turn * along_px) / 4;
                    if (std::abs(across_px - turn * along_px) < 3.5 * blur_px)
                        pixels.push_back({along_px, across_px - turn * along_px, std::round(light), column});
                }
            const auto found = fit_blurred_edge(pixels, blur_px);
            ASSERT_TRUE(found) << degrees << " " << blur_px;
            for (const double along_px : {-20.0, 20.0})
                EXPECT_NEAR(at_px(*found, along_px), 0, 0.005) << degrees << " " << blur_px;
        }
}

// Three distances from the edge do not determine its offset, its blur and both lights.
TEST(BlurredEdge, IsFiniteIfPixelsHaveFewDistances) {
    for (const double first_px : {-1.2, -1.13, -1.05, -0.95})
        for (const double blur_px : {0.3, 0.34, 0.4}) {
            const Edge edge{0, 0, blur_px, 0, 255};
            std::vector<EdgePixel> pixels;
            for (int column = 0; column < 470; ++column)
                for (int i = 0; i < 3; ++i)
                    pixels.push_back({column - 235.0, first_px + i, edge.light(0, first_px + i), column});
            const auto found = fit_blurred_edge(pixels, blur_px);
            ASSERT_TRUE(found);
            EXPECT_NEAR(at_px(*found, 0), 0, 0.3) << first_px << ", " << blur_px;
            EXPECT_GE(found->offset_variance, 0);
            EXPECT_TRUE(std::isfinite(found->offset_variance) && std::isfinite(found->turn_variance));
        }
}

TEST(BlurredEdge, TellsItsVariance) {
    constexpr int count = 400;
    const Edge edge;
    double offset_squares = 0, turn_squares = 0, products = 0, told_offset = 0, told_turn = 0;
    for (int i = 0; i < count; ++i) {
        const auto found = fit_blurred_edge(pixels_of(edge, 8, i), 0.7);
        ASSERT_TRUE(found);
        const double offset = found->offset_px - edge.at_px(found->pivot_px), turn = found->turn - edge.turn;
        offset_squares += offset * offset / count;
        turn_squares += turn * turn / count;
        products += offset * turn / count;
        told_offset += found->offset_variance / count;
        told_turn += found->turn_variance / count;
    }
    EXPECT_NEAR(std::sqrt(told_offset / offset_squares), 1, 0.1);
    EXPECT_NEAR(std::sqrt(told_turn / turn_squares), 1, 0.1);
    EXPECT_LT(std::abs(products), 0.2 * std::sqrt(offset_squares * turn_squares)) << "the errors are independent";
}

// For example, of what hides a part of the edge, and is nearly parallel to it.
TEST(BlurredEdge, TellsItsVarianceIfErrorsOfNeighboursAreSimilar) {
    constexpr int count = 200;
    const Edge edge;
    double squares = 0, told = 0;
    std::mt19937 random(3);
    std::normal_distribution<double> normal;
    for (int i = 0; i < count; ++i) {
        double shift = 0;
        auto pixels = pixels_of(edge);
        for (std::size_t k = 0; k < pixels.size(); ++k) {
            EdgePixel &pixel = pixels[k];
            if (k % 7 == 0) // a new column
                shift = 0.7 * shift + 0.02 * normal(random);
            pixel.light = edge.light(pixel.along_px, pixel.across_px - shift);
        }
        const auto found = fit_blurred_edge(pixels, 0.7);
        ASSERT_TRUE(found);
        EXPECT_GT(found->correlation, 0.1);
        squares += std::pow(found->offset_px - edge.at_px(found->pivot_px), 2) / count;
        told += found->offset_variance / count;
    }
    EXPECT_NEAR(std::sqrt(told / squares), 1, 0.25);
}

TEST(BlurredEdge, LeavesOutWhatHidesIt) {
    const Edge edge;
    for (const int hidden : {5, 12, 16})
        for (const double light : {0, 100, 255}) {
            auto pixels = pixels_of(edge, 2);
            for (EdgePixel &pixel : pixels)
                if (pixel.column >= 40 - hidden)
                    pixel.light = light;
            const auto found = fit_blurred_edge(pixels, 0.7);
            SCOPED_TRACE(testing::Message() << hidden << " " << light);
            ASSERT_TRUE(found);
            EXPECT_NEAR(at_px(*found, 0), edge.at_px(0), 0.02);
        }
}

TEST(BlurredEdge, TellsItsVarianceWhereItIsTooSharpToTellItsBlur) {
    const Edge edge{0.2, 0.02, 0.2};
    constexpr int count = 100;
    double squares = 0, told = 0;
    for (int i = 0; i < count; ++i) {
        const auto found = fit_blurred_edge(pixels_of(edge, 1, i), 0.3);
        ASSERT_TRUE(found) << i;
        squares += std::pow(at_px(*found, 8) - edge.at_px(8), 2) / count;
        told += (found->offset_variance + std::pow(8 - found->pivot_px, 2) * found->turn_variance) / count;
    }
    EXPECT_LT(std::sqrt(squares), 0.05);
    EXPECT_GT(std::sqrt(told / squares), 0.3);
    EXPECT_LT(std::sqrt(told / squares), 3);
}

TEST(BlurredEdge, HasAVarianceWithoutNoise) {
    const auto found = fit_blurred_edge(pixels_of({}), 0.7);
    ASSERT_TRUE(found);
    EXPECT_GT(found->offset_variance, 0);
    EXPECT_GT(found->turn_variance, 0);
}

// A camera that sharpens makes edges narrower than pixels.
TEST(BlurredEdge, MayBeSharperThanPixels) {
    const Edge edge{0.2, 0.03, 0.02};
    const auto found = fit_blurred_edge(pixels_of(edge, 1), 0.3);
    ASSERT_TRUE(found);
    EXPECT_NEAR(at_px(*found, 8), edge.at_px(8), 0.05);
}

TEST(BlurredEdge, IsNotFoundFarFromTheLine) {
    for (const double offset_px : {1.1, 1.3, 1.5, 2.0, 2.5, -1.1, -1.5, -2.5})
        EXPECT_FALSE(fit_blurred_edge(pixels_of({.offset_px = offset_px, .turn = 0}), 0.7)) << offset_px;
    for (const double turn : {0.06, 0.08, 0.1, -0.06, -0.1}) // 27 px from where the line crosses the edge
        EXPECT_FALSE(fit_blurred_edge(pixels_of({.offset_px = 0, .turn = turn}), 0.7)) << turn;
}

TEST(BlurredEdge, IsNotFoundWithoutOne) {
    EXPECT_FALSE(fit_blurred_edge({}, 0.7));
    EXPECT_FALSE(fit_blurred_edge(pixels_of({.before = 90, .after = 90}), 0.7));
    auto few = pixels_of({});
    few.resize(15);
    EXPECT_FALSE(fit_blurred_edge(few, 0.7));
    auto one_side = pixels_of({});
    std::erase_if(one_side, [](const EdgePixel &pixel) { return pixel.across_px > -1.5; });
    EXPECT_FALSE(fit_blurred_edge(one_side, 0.7));
    constexpr double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
    for (const double wrong : {nan, inf, 0.0})
        EXPECT_FALSE(fit_blurred_edge(pixels_of({}), wrong)) << wrong;
}

} // namespace
