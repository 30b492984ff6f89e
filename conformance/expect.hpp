// SPDX-License-Identifier: Apache-2.0
// Checks shared by tests of images.
#pragma once

#include "conformance/test.hpp"

#include <fmt/format.h>

#include <cmath>

namespace arhost::conformance {

inline std::string text_of(const Pixel &p) {
    return fmt::format("({}, {}, {}, {})", p[0], p[1], p[2], p[3]);
}

// `problem(x, y)` describes what is wrong with a pixel, as the end of a sentence; empty if it is correct.
template <class Problem> void expect_pixels(const Picture &picture, Problem &&problem) {
    for (std::uint32_t y = 0; y < picture.height(); ++y)
        for (std::uint32_t x = 0; x < picture.width(); ++x)
            if (const std::string text = problem(x, y); !text.empty())
                throw Failure(fmt::format("pixel ({}, {}): {}", x, y, text)).with("rendered", picture).at(x, y);
}

inline double distance_from_centre(const Picture &picture, std::uint32_t x, std::uint32_t y) {
    return std::hypot(x - (picture.width() - 1) / 2.0, y - (picture.height() - 1) / 2.0);
}

template <class Predicate> int count_pixels(const Picture &picture, Predicate &&predicate) {
    int count = 0;
    for (std::uint32_t y = 0; y < picture.height(); ++y)
        for (std::uint32_t x = 0; x < picture.width(); ++x)
            count += predicate(x, y) ? 1 : 0;
    return count;
}

// At most the fraction `share` of the pixels may differ by more than `tolerance` codes. `violation`: the message if
// more do.
inline void expect_alike(const Picture &actual, const Picture &expected, const std::string &violation,
                         int tolerance = 0, double share = 0) {
    const int count =
        count_pixels(actual, [&](auto x, auto y) { return differs(actual.at(x, y), expected.at(x, y), tolerance); });
    if (count <= share * actual.width() * actual.height())
        return;
    const auto at = *first_difference(actual, expected, tolerance);
    throw Failure(fmt::format("{}: {} of {} pixels differ, the first is ({}, {}): {} instead of {}", violation, count,
                              actual.width() * actual.height(), at[0], at[1], text_of(actual.at(at[0], at[1])),
                              text_of(expected.at(at[0], at[1]))))
        .with("rendered", actual)
        .with("expected", expected)
        .with("difference × 5", difference(actual, expected))
        .at(at[0], at[1]);
}

} // namespace arhost::conformance
