// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

namespace arhost::images {

// An image in BGR8. The top row is first.
struct Image {
    std::uint32_t width, height;
    std::size_t stride; // bytes per row
    const std::uint8_t *bgr;
    const std::uint8_t *row(std::uint32_t y) const { return bgr + y * stride; }
};

// Encodes images in a file format. The same image always gives the same bytes.
class Encoder {
public:
    virtual ~Encoder() = default;
    virtual std::span<const std::uint8_t> encode(const Image &image) = 0; // valid until the next call
};

std::unique_ptr<Encoder> make_png_encoder(int compression); // 1 (fast) to 12 (small)
std::unique_ptr<Encoder> make_jpeg_encoder(int quality);    // 1 to 100

} // namespace arhost::images
