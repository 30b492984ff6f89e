// SPDX-License-Identifier: Apache-2.0
#include "conformance/video.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace arhost::conformance {
namespace {

// Y', Cb and Cr codes (ITU-R BT.601-7 §2.5, BT.709-6 §3).
Video::Rgb yuv_of(const Video::Rgb &rgb, const arhost_frame_format &format) {
    const bool is_709 = format.yuv_matrix == ARHOST_YUV_MATRIX_BT709;
    const double red = is_709 ? 0.2126 : 0.299, blue = is_709 ? 0.0722 : 0.114;
    const double luma = red * rgb[0] + (1 - red - blue) * rgb[1] + blue * rgb[2];
    const double cb = (rgb[2] - luma) / (2 * (1 - blue)), cr = (rgb[0] - luma) / (2 * (1 - red));
    const bool is_limited = format.yuv_range == ARHOST_YUV_RANGE_LIMITED;
    const auto code = [](double value) {
        return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0, 255.0)));
    };
    return {code(is_limited ? 16 + luma * 219 / 255 : luma), code(128 + cb * (is_limited ? 224.0 / 255 : 1)),
            code(128 + cr * (is_limited ? 224.0 / 255 : 1))};
}

} // namespace

Video::Video(arhost_pixel_format pixel_format, std::uint32_t width, std::uint32_t height,
             std::function<Rgb(std::uint32_t x, std::uint32_t y)> colour)
    : colour_(std::move(colour)) {
    const bool is_nv12 = pixel_format == ARHOST_PIXEL_FORMAT_NV12;
    format_.struct_size = sizeof format_;
    format_.pixel_format = pixel_format;
    format_.width = width;
    format_.height = height;
    format_.yuv_matrix = is_nv12 ? ARHOST_YUV_MATRIX_BT709 : ARHOST_YUV_MATRIX_BT601;
    format_.yuv_range = is_nv12 ? ARHOST_YUV_RANGE_LIMITED : ARHOST_YUV_RANGE_FULL;
    arhost_frame_layout(&format_);
    bytes_.resize(format_.byte_size);
    frame_.struct_size = sizeof frame_;
    frame_.clock = ARHOST_CLOCK_MEDIA;
    frame_.format = &format_;
    for (std::uint32_t plane = 0; plane < format_.plane_count; ++plane)
        frame_.plane[plane] = bytes_.data() + format_.offset[plane];
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x) {
            const auto at = [&](std::size_t plane, std::size_t column, std::size_t row) -> std::uint8_t & {
                return bytes_[format_.offset[plane] + row * format_.stride[plane] + column];
            };
            const Rgb rgb = colour_(x, y);
            const auto [luma, cb, cr] = yuv_of(rgb, format_);
            switch (pixel_format) {
            case ARHOST_PIXEL_FORMAT_RGB8:
                std::ranges::copy(rgb, &at(0, 3 * x, y));
                break;
            case ARHOST_PIXEL_FORMAT_BGR8:
                std::ranges::reverse_copy(rgb, &at(0, 3 * x, y));
                break;
            case ARHOST_PIXEL_FORMAT_YUYV:
                at(0, 2 * x, y) = luma;
                at(0, x / 2 * 4 + 1, y) = cb;
                at(0, x / 2 * 4 + 3, y) = cr;
                break;
            case ARHOST_PIXEL_FORMAT_NV12:
                at(0, x, y) = luma;
                at(1, x / 2 * 2, y / 2) = cb;
                at(1, x / 2 * 2 + 1, y / 2) = cr;
                break;
            case ARHOST_PIXEL_FORMAT_I420:
                at(0, x, y) = luma;
                at(1, x / 2, y / 2) = cb;
                at(2, x / 2, y / 2) = cr;
                break;
            default: // GREY8
                at(0, x, y) = luma;
            }
        }
}

Video::Rgb Video::colour(std::uint32_t x, std::uint32_t y) const {
    const Rgb rgb = colour_(x, y);
    if (format_.pixel_format != ARHOST_PIXEL_FORMAT_GREY8)
        return rgb;
    const std::uint8_t luma = yuv_of(rgb, format_)[0];
    return {luma, luma, luma};
}

} // namespace arhost::conformance
