// SPDX-License-Identifier: Apache-2.0
#include "raytracer_common/video.hpp"

#include "pixels/rows.hpp"

#include <arhost/shading/lens.hpp>

#include <algorithm>
#include <limits>

namespace arhost::raytracer_common {
namespace {

void convert_row(const arhost_frame &frame, const YuvMatrix &matrix, std::size_t y, std::uint8_t *bgr) {
    const arhost_frame_format &format = *frame.format;
    const auto row = [&](std::size_t plane, std::size_t at) {
        return frame.plane[plane] + at * format.stride[plane];
    };
    switch (format.pixel_format) {
    case ARHOST_PIXEL_FORMAT_GREY8:
        return rows::bgr_from_grey(row(0, y), bgr, format.width);
    case ARHOST_PIXEL_FORMAT_RGB8:
        return rows::bgr_from_rgb(row(0, y), bgr, format.width);
    case ARHOST_PIXEL_FORMAT_BGR8:
        std::copy_n(row(0, y), std::size_t{3} * format.width, bgr);
        return;
    case ARHOST_PIXEL_FORMAT_YUYV:
        return rows::bgr_from_yuyv(row(0, y), matrix, bgr, format.width);
    case ARHOST_PIXEL_FORMAT_NV12:
        return rows::bgr_from_nv12(row(0, y), row(1, y / 2), matrix, bgr, format.width);
    case ARHOST_PIXEL_FORMAT_I420:
        return rows::bgr_from_i420(row(0, y), row(1, y / 2), row(2, y / 2), matrix, bgr, format.width);
    }
}

} // namespace

void VideoImage::set(const arhost_frame &frame) {
    const std::size_t width = frame.format->width, height = frame.format->height;
    const YuvMatrix matrix = yuv_matrix(*frame.format);
    row_.resize(3 * width);
    texels_.resize(4 * width * height);
    std::uint8_t *to = texels_.data();
    for (std::size_t y = 0; y < height; ++y) {
        convert_row(frame, matrix, y, row_.data());
        for (std::size_t x = 0; x < width; ++x, to += 4) {
            to[0] = row_[3 * x + 2];
            to[1] = row_[3 * x + 1];
            to[2] = row_[3 * x];
            to[3] = 255;
        }
    }
}

float max_radius_squared(const arhost_intrinsics &intrinsics) {
    if (intrinsics.distortion == ARHOST_DISTORTION_NONE)
        return std::numeric_limits<float>::infinity();
    const shading::Lens lens(intrinsics);
    double largest = 0;
    constexpr int steps = 64;
    for (int i = 0; i <= steps; ++i)
        for (int side = 0; side < 4; ++side) {
            const double along = static_cast<double>(i) / steps, x = side < 2 ? along : side - 2,
                         y = side < 2 ? side : along;
            const auto d = lens.ray({x * intrinsics.width - 0.5, y * intrinsics.height - 0.5});
            if (d && d->z > 0)
                largest = std::max(largest, (d->x * d->x + d->y * d->y) / (d->z * d->z));
        }
    return static_cast<float>(1.05 * largest);
}

} // namespace arhost::raytracer_common
