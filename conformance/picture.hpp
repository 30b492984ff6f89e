// SPDX-License-Identifier: Apache-2.0
//
// An RGBA8 image in memory of its own, with guard bytes before, behind and between its rows.
#pragma once

#include <arhost/raytracer.h>

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace arhost::conformance {

using Pixel = std::array<int, 4>; // R, G, B, A

class Picture {
public:
    // Every pixel's bytes are `fill` at first.
    Picture(std::uint32_t width, std::uint32_t height, std::uint8_t fill = 0);

    arhost_image image(); // to be written
    std::uint32_t width() const { return width_; }
    std::uint32_t height() const { return height_; }
    Pixel at(std::uint32_t x, std::uint32_t y) const;
    int alpha(std::uint32_t x, std::uint32_t y) const { return at(x, y)[3]; }
    void set(std::uint32_t x, std::uint32_t y, const Pixel &pixel);

    // What was written beside the pixels, as the end of a sentence; empty: nothing.
    std::string damage() const;

    // The pixels around have the same alpha and nearly the same colour: no edge is near, nor an edge's reflection.
    bool is_smooth(std::uint32_t x, std::uint32_t y) const;

    std::string png_base64() const;

private:
    struct alignas(4096) Page { // which an image begins
        std::uint8_t bytes[4096];
    };
    static constexpr std::uint8_t guard = 0xa5;
    static constexpr std::size_t guard_size = sizeof(Page); // before and behind

    std::uint8_t *bytes() { return memory_.front().bytes; }
    const std::uint8_t *bytes() const { return memory_.front().bytes; }
    std::size_t row(std::uint32_t y) const { return guard_size + std::size_t{stride_} * y; }

    std::uint32_t width_, height_, stride_;
    std::vector<Page> memory_;
};

// By more than `tolerance` codes; colours count where both are visible.
bool differs(const Pixel &a, const Pixel &b, int tolerance);
std::optional<std::array<unsigned, 2>> first_difference(const Picture &a, const Picture &b, int tolerance);

// Opaque, with the difference of two pictures five times as large.
Picture difference(const Picture &a, const Picture &b);

} // namespace arhost::conformance
