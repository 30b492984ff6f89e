// SPDX-License-Identifier: Apache-2.0
// Images with guard bytes before them, after them and between their rows.
#pragma once

#include "pixels/linear.hpp"

#include <arhost/raytracer.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace arhost::conformance {

using Pixel = std::array<int, 4>; // R, G, B, A

class GuardedImage {
public:
    // Initializes every byte of the pixels to `fill`.
    GuardedImage(std::uint32_t width, std::uint32_t height, std::size_t pixel_bytes, std::uint8_t fill);

    std::uint32_t width() const { return width_; }
    std::uint32_t height() const { return height_; }

    // Describes the first overwritten guard byte, as the end of a sentence; empty if there is none.
    std::string damage() const;

protected:
    std::uint32_t stride() const { return stride_; }
    std::uint8_t *pixel(std::uint32_t x, std::uint32_t y) { return bytes() + offset(x, y); }
    const std::uint8_t *pixel(std::uint32_t x, std::uint32_t y) const { return bytes() + offset(x, y); }

private:
    struct alignas(4096) Page { // images are page-aligned
        std::uint8_t bytes[4096];
    };
    static constexpr std::uint8_t guard = 0xa5;
    static constexpr std::size_t guard_size = sizeof(Page); // before and after the image

    std::uint8_t *bytes() { return memory_.front().bytes; }
    const std::uint8_t *bytes() const { return memory_.front().bytes; }
    std::size_t offset(std::uint32_t x, std::uint32_t y) const {
        return guard_size + std::size_t{stride_} * y + pixel_bytes_ * x;
    }

    std::uint32_t width_, height_;
    std::size_t pixel_bytes_;
    std::uint32_t stride_;
    std::vector<Page> memory_;
};

// An image of ARHOST_IMAGE_FORM_STRAIGHT.
class Picture : public GuardedImage {
public:
    Picture(std::uint32_t width, std::uint32_t height, std::uint8_t fill = 0)
        : GuardedImage(width, height, sizeof(std::uint8_t[4]), fill) {}

    arhost_image image(); // for a ray tracer to write to
    Pixel at(std::uint32_t x, std::uint32_t y) const;
    int alpha(std::uint32_t x, std::uint32_t y) const { return at(x, y)[3]; }
    void set(std::uint32_t x, std::uint32_t y, const Pixel &pixel);

    // Returns whether the neighbouring pixels have the same alpha and nearly the same colour.
    bool is_smooth(std::uint32_t x, std::uint32_t y) const;

    std::string png_base64() const;
};

// An image of ARHOST_IMAGE_FORM_LINEAR.
class LinearPicture : public GuardedImage {
public:
    LinearPicture(std::uint32_t width, std::uint32_t height, std::uint8_t fill = 0)
        : GuardedImage(width, height, sizeof(LinearPixel), fill) {}

    arhost_image image(); // for a ray tracer to write to
    LinearPixel at(std::uint32_t x, std::uint32_t y) const;
    double added(std::uint32_t x, std::uint32_t y, int channel) const {
        return double{float_of(at(x, y).added[channel])};
    }
    double transmittance(std::uint32_t x, std::uint32_t y, int channel) const {
        return double{float_of(at(x, y).transmittance[channel])};
    }

    Picture shown() const;    // opaque, over mid-grey video
    Picture straight() const; // as the host converts it for sinks
};

// Returns whether two pixels differ by more than `tolerance` codes. Colours are compared only where both alphas are
// nonzero.
bool differs(const Pixel &a, const Pixel &b, int tolerance);
std::optional<std::array<unsigned, 2>> first_difference(const Picture &a, const Picture &b, int tolerance);

// Returns the absolute difference of two pictures times 5, opaque.
Picture difference(const Picture &a, const Picture &b);

} // namespace arhost::conformance
