// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

namespace arhost::images {

enum class PixelFormat { bgr8, rgba8, depth16 }; // depth16: grey with 16 bits in the byte order of the machine

constexpr std::size_t bytes_per_pixel(PixelFormat format) {
    return format == PixelFormat::bgr8 ? 3 : format == PixelFormat::rgba8 ? 4 : 2;
}

// The top row is first.
struct Image {
    std::uint32_t width, height;
    std::size_t stride; // bytes per row
    const std::uint8_t *pixels;
    PixelFormat format = PixelFormat::bgr8;
    const std::uint8_t *row(std::uint32_t y) const { return pixels + y * stride; }
    std::size_t row_bytes() const { return bytes_per_pixel(format) * width; }
};

// Encodes images in a file format. The same image always gives the same bytes.
class Encoder {
public:
    virtual ~Encoder() = default;
    virtual std::span<const std::uint8_t> encode(const Image &image) = 0; // valid until the next call
};

std::unique_ptr<Encoder> make_png_encoder(int compression); // 1 (fast) to 12 (small)
std::unique_ptr<Encoder> make_jpeg_encoder(int quality);    // 1 to 100; only for bgr8

} // namespace arhost::images
