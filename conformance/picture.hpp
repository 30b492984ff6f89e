// SPDX-License-Identifier: Apache-2.0
// An RGBA8 image with guard bytes before it, after it and between its rows.
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
    // Initializes every byte of the pixels to `fill`.
    Picture(std::uint32_t width, std::uint32_t height, std::uint8_t fill = 0);

    arhost_image image(); // for a ray tracer to write to
    std::uint32_t width() const { return width_; }
    std::uint32_t height() const { return height_; }
    Pixel at(std::uint32_t x, std::uint32_t y) const;
    int alpha(std::uint32_t x, std::uint32_t y) const { return at(x, y)[3]; }
    void set(std::uint32_t x, std::uint32_t y, const Pixel &pixel);

    // Describes the first overwritten guard byte, as the end of a sentence; empty if there is none.
    std::string damage() const;

    // Returns whether the neighbouring pixels have the same alpha and nearly the same colour.
    bool is_smooth(std::uint32_t x, std::uint32_t y) const;

    std::string png_base64() const;

private:
    struct alignas(4096) Page { // images are page-aligned
        std::uint8_t bytes[4096];
    };
    static constexpr std::uint8_t guard = 0xa5;
    static constexpr std::size_t guard_size = sizeof(Page); // before and after the image

    std::uint8_t *bytes() { return memory_.front().bytes; }
    const std::uint8_t *bytes() const { return memory_.front().bytes; }
    std::size_t row(std::uint32_t y) const { return guard_size + std::size_t{stride_} * y; }

    std::uint32_t width_, height_, stride_;
    std::vector<Page> memory_;
};

// Returns whether two pixels differ by more than `tolerance` codes. Colours are compared only where both alphas are
// nonzero.
bool differs(const Pixel &a, const Pixel &b, int tolerance);
std::optional<std::array<unsigned, 2>> first_difference(const Picture &a, const Picture &b, int tolerance);

// Returns the absolute difference of two pictures times 5, opaque.
Picture difference(const Picture &a, const Picture &b);

} // namespace arhost::conformance
