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

inline std::string text_of(const LinearPixel &p) {
    const auto number = [](std::uint16_t half) { return double{float_of(half)}; };
    return fmt::format("({:.4g}, {:.4g}, {:.4g}, {:.4g}; {:.4g}, {:.4g}, {:.4g}, {:.4g})", number(p.added[0]),
                       number(p.added[1]), number(p.added[2]), number(p.reserved_0), number(p.transmittance[0]),
                       number(p.transmittance[1]), number(p.transmittance[2]), number(p.reserved_1));
}

inline const Picture &shown(const Picture &picture) {
    return picture;
}
inline Picture shown(const LinearPicture &picture) {
    return picture.shown();
}

// `problem(x, y)` describes what is wrong with a pixel, as the end of a sentence; empty if it is correct. `Image`:
// Picture or LinearPicture.
template <class Image, class Problem> void expect_pixels(const Image &picture, Problem &&problem) {
    for (std::uint32_t y = 0; y < picture.height(); ++y)
        for (std::uint32_t x = 0; x < picture.width(); ++x)
            if (const std::string text = problem(x, y); !text.empty())
                throw Failure(fmt::format("pixel ({}, {}): {}", x, y, text))
                    .with("rendered", shown(picture))
                    .at(x, y);
}

inline double distance_from_centre(const GuardedImage &picture, std::uint32_t x, std::uint32_t y) {
    return std::hypot(x - (picture.width() - 1) / 2.0, y - (picture.height() - 1) / 2.0);
}

template <class Predicate> int count_pixels(const GuardedImage &picture, Predicate &&predicate) {
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

// Every byte must be the same. `violation`: the message if one is not.
inline void expect_identical(const LinearPicture &actual, const LinearPicture &expected,
                             const std::string &violation) {
    const int count = count_pixels(actual, [&](auto x, auto y) { return !(actual.at(x, y) == expected.at(x, y)); });
    for (std::uint32_t y = 0; y < actual.height(); ++y)
        for (std::uint32_t x = 0; x < actual.width(); ++x)
            if (!(actual.at(x, y) == expected.at(x, y)))
                throw Failure(fmt::format("{}: {} of {} pixels differ, the first is ({}, {}): {} instead of {}",
                                          violation, count, actual.width() * actual.height(), x, y,
                                          text_of(actual.at(x, y)), text_of(expected.at(x, y))))
                    .with("rendered", actual.shown())
                    .with("expected", expected.shown())
                    .at(x, y);
}

} // namespace arhost::conformance
