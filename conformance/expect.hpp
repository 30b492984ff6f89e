// SPDX-License-Identifier: Apache-2.0
//
// What several tests of images ask.
#pragma once

#include "conformance/test.hpp"

#include <fmt/format.h>

#include <cmath>

namespace arhost::conformance {

inline std::string text_of(const Pixel &p) {
    return fmt::format("({}, {}, {}, {})", p[0], p[1], p[2], p[3]);
}

// `wrong(x, y)` says what is wrong with a pixel, as the end of a sentence; empty: nothing.
template <class Wrong> void expect_pixels(const Picture &picture, Wrong &&wrong) {
    for (std::uint32_t y = 0; y < picture.height(); ++y)
        for (std::uint32_t x = 0; x < picture.width(); ++x)
            if (const std::string what = wrong(x, y); !what.empty())
                throw Failure(fmt::format("pixel ({}, {}): {}", x, y, what)).with("rendered", picture).at(x, y);
}

inline double distance_from_centre(const Picture &picture, std::uint32_t x, std::uint32_t y) {
    return std::hypot(x - (picture.width() - 1) / 2.0, y - (picture.height() - 1) / 2.0);
}

template <class Holds> int count_pixels(const Picture &picture, Holds &&holds) {
    int count = 0;
    for (std::uint32_t y = 0; y < picture.height(); ++y)
        for (std::uint32_t x = 0; x < picture.width(); ++x)
            count += holds(x, y) ? 1 : 0;
    return count;
}

// The two are alike: at most `share` of the pixels differ by more than `tolerance` codes.
inline void expect_alike(const Picture &is, const Picture &should, const std::string &what, int tolerance = 0,
                         double share = 0) {
    const int count =
        count_pixels(is, [&](auto x, auto y) { return differs(is.at(x, y), should.at(x, y), tolerance); });
    if (count <= share * is.width() * is.height())
        return;
    const auto at = *first_difference(is, should, tolerance);
    throw Failure(fmt::format("{}: {} of {} pixels differ, the first is ({}, {}): {} and {}", what, count,
                              is.width() * is.height(), at[0], at[1], text_of(is.at(at[0], at[1])),
                              text_of(should.at(at[0], at[1]))))
        .with("rendered", is)
        .with("expected", should)
        .with("difference × 5", difference(is, should))
        .at(at[0], at[1]);
}

} // namespace arhost::conformance
