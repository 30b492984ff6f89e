// SPDX-License-Identifier: Apache-2.0
//
// The colours of the pixels in a captured frame.
#pragma once

#include <arhost/frame.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace arhost::test {

// Converts 8-bit YUV to RGB by the formula of ITU-R BT.601 and BT.709; `kr` and `kb` select the standard.
inline std::array<double, 3> rgb_of(double y, double u, double v, double kr, double kb, bool full) {
    const double luma = full ? y : (y - 16) * 255 / 219;
    const double scale = full ? 1 : 255.0 / 224;
    const double cb = (u - 128) * scale, cr = (v - 128) * scale;
    const double r = luma + 2 * (1 - kr) * cr, b = luma + 2 * (1 - kb) * cb;
    return {r, (luma - kr * r - kb * b) / (1 - kr - kb), b};
}

// Returns the colour of a pixel of a frame without row padding.
inline std::array<double, 3> colour_at(const arhost_frame_format &format, const std::vector<std::uint8_t> &bytes,
                                       std::size_t x, std::size_t y) {
    const std::size_t width = format.width, size = width * format.height;
    const auto yuv = [&](double luma, double u, double v) {
        return rgb_of(luma, u, v, 0.299, 0.114, format.yuv_range == ARHOST_YUV_RANGE_FULL);
    };
    switch (format.pixel_format) {
    case ARHOST_PIXEL_FORMAT_YUYV: {
        const std::uint8_t *pair = &bytes[2 * (y * width + x / 2 * 2)];
        return yuv(pair[0], pair[1], pair[3]);
    }
    case ARHOST_PIXEL_FORMAT_NV12: {
        const std::uint8_t *chroma = &bytes[size + y / 2 * width + x / 2 * 2];
        return yuv(bytes[y * width + x], chroma[0], chroma[1]);
    }
    case ARHOST_PIXEL_FORMAT_I420: {
        const std::size_t chroma = size + y / 2 * (width / 2) + x / 2;
        return yuv(bytes[y * width + x], bytes[chroma], bytes[chroma + size / 4]);
    }
    case ARHOST_PIXEL_FORMAT_RGB8: {
        const std::uint8_t *rgb = &bytes[3 * (y * width + x)];
        return {double(rgb[0]), double(rgb[1]), double(rgb[2])};
    }
    case ARHOST_PIXEL_FORMAT_BGR8: {
        const std::uint8_t *bgr = &bytes[3 * (y * width + x)];
        return {double(bgr[2]), double(bgr[1]), double(bgr[0])};
    }
    default: // GREY8
        return {double(bytes[y * width + x]), double(bytes[y * width + x]), double(bytes[y * width + x])};
    }
}

} // namespace arhost::test
