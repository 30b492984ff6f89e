// SPDX-License-Identifier: Apache-2.0
#include "compositor/compositor.hpp"

#include "pixels/linear.hpp"
#include "pixels/rows.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>
#include <vector>

namespace arhost {
namespace {

Region clipped(const Region &region, const ImageView &overlay, const arhost_frame_format &format) {
    if (!overlay.pixels || region.x >= format.width || region.y >= format.height)
        return {};
    return {region.x, region.y, std::min(region.width, format.width - region.x),
            std::min(region.height, format.height - region.y)};
}

void convert_row(const arhost_frame_format &format, const YuvMatrix &matrix, const std::uint8_t *const planes[],
                 std::size_t y, std::uint8_t *bgr) {
    const auto row = [&](std::size_t plane, std::size_t at) { return planes[plane] + at * format.stride[plane]; };
    switch (format.pixel_format) {
    case ARHOST_PIXEL_FORMAT_GREY8:
        return rows::bgr_from_grey(row(0, y), bgr, format.width);
    case ARHOST_PIXEL_FORMAT_RGB8:
        return rows::bgr_from_rgb(row(0, y), bgr, format.width);
    case ARHOST_PIXEL_FORMAT_YUYV:
        return rows::bgr_from_yuyv(row(0, y), matrix, bgr, format.width);
    case ARHOST_PIXEL_FORMAT_NV12:
        return rows::bgr_from_nv12(row(0, y), row(1, y / 2), matrix, bgr, format.width);
    case ARHOST_PIXEL_FORMAT_I420:
        return rows::bgr_from_i420(row(0, y), row(1, y / 2), row(2, y / 2), matrix, bgr, format.width);
    }
}

void blend_row(const std::uint8_t *bgr, const std::uint8_t *overlay, const OverlayFormat &format, std::uint8_t *out,
               std::size_t count) {
    if (format.is_linear())
        rows::add_light(bgr, reinterpret_cast<const std::uint16_t *>(overlay), out, count);
    else if (format.compositing == ARHOST_COMPOSITING_LINEAR)
        blend_in_linear_light(bgr, overlay, out, count);
    else
        rows::blend(bgr, overlay, out, count);
}

using rows::Between;
constexpr std::uint32_t one = Between::one;

Between between(std::uint32_t at, std::uint32_t from_size, std::uint32_t to_size) {
    const double position =
        std::clamp((at + 0.5) * from_size / to_size - 0.5, 0.0, static_cast<double>(from_size - 1));
    const auto first = static_cast<std::uint32_t>(position);
    return {first, std::min(first + 1, from_size - 1),
            static_cast<std::uint32_t>(std::lround((position - first) * one))};
}

// Returns the range of pixels of the large image that bilinear filtering of the small image's pixels [begin, end)
// affects.
std::pair<std::uint32_t, std::uint32_t> enlarged(std::uint32_t begin, std::uint32_t end, std::uint32_t from_size,
                                                 std::uint32_t to_size) {
    const double factor = static_cast<double>(to_size) / from_size;
    return {static_cast<std::uint32_t>(std::max(0.0, std::floor((begin - 0.5) * factor - 0.5))),
            std::min(to_size, static_cast<std::uint32_t>(std::ceil((end + 0.5) * factor + 0.5)))};
}

void mix_straight(const std::uint8_t *const (&corners)[4], const std::uint32_t (&weights)[4], std::uint8_t *to) {
    std::uint32_t alpha = 0, sums[3] = {};
    for (int i = 0; i < 4; ++i) {
        const std::uint32_t share = weights[i] * corners[i][3];
        alpha += share;
        for (int c = 0; c < 3; ++c)
            sums[c] += share * corners[i][c];
    }
    for (int c = 0; c < 3; ++c)
        to[c] = static_cast<std::uint8_t>(alpha > 0 ? (sums[c] + alpha / 2) / alpha : 0);
    to[3] = static_cast<std::uint8_t>((alpha + one * one / 2) / (one * one));
}

} // namespace

Region enlarge(const ImageView &image, std::uint32_t from_width, std::uint32_t from_height, const Region &region,
               const arhost_frame_format &format, std::uint8_t *pixels, std::size_t stride) {
    if (region.width == 0 || region.height == 0 || region.x >= from_width || region.y >= from_height)
        return {};
    const auto [x0, x1] =
        enlarged(region.x, region.x + std::min(region.width, from_width - region.x), from_width, format.width);
    const auto [y0, y1] =
        enlarged(region.y, region.y + std::min(region.height, from_height - region.y), from_height, format.height);
    std::vector<Between> columns;
    for (std::uint32_t x = x0; x < x1; ++x)
        columns.push_back(between(x, from_width, format.width));
    for (std::uint32_t y = y0; y < y1; ++y) {
        const Between row = between(y, from_height, format.height);
        std::uint8_t *to = pixels + y * stride + x0 * image.format.pixel_bytes();
        if (image.format.is_linear()) {
            rows::interpolate_light(reinterpret_cast<const std::uint16_t *>(image.at(0, row.first)),
                                    reinterpret_cast<const std::uint16_t *>(image.at(0, row.second)), row.weight,
                                    columns.data(), reinterpret_cast<std::uint16_t *>(to), columns.size());
            continue;
        }
        for (const Between &column : columns) {
            const std::uint8_t *corners[] = {image.at(column.first, row.first), image.at(column.second, row.first),
                                             image.at(column.first, row.second), image.at(column.second, row.second)};
            const std::uint32_t weights[] = {(one - column.weight) * (one - row.weight),
                                             column.weight * (one - row.weight), (one - column.weight) * row.weight,
                                             column.weight * row.weight};
            mix_straight(corners, weights, to);
            to += image.format.pixel_bytes();
        }
    }
    return {x0, y0, x1 - x0, y1 - y0};
}

void composite(const arhost_frame_format &format, const std::uint8_t *const planes[ARHOST_MAX_PLANES],
               const ImageView &overlay, const Region &region, const OutputView &out) {
    const Region inside = clipped(region, overlay, format);
    const YuvMatrix matrix = yuv_matrix(format);
    const std::size_t begin = 3 * std::size_t(inside.x), end = begin + 3 * std::size_t(inside.width);
    const std::size_t row_bytes = 3 * std::size_t(format.width);
    for (std::size_t y = 0; y < format.height; ++y) {
        std::uint8_t *to = out.bgr + y * out.stride;
        const std::uint8_t *from = to; // a row that was converted to BGR is blended in place
        const bool blending = inside.width > 0 && y >= inside.y && y - inside.y < inside.height;
        if (format.pixel_format != ARHOST_PIXEL_FORMAT_BGR8) {
            convert_row(format, matrix, planes, y, to);
        } else {
            from = planes[0] + y * format.stride[0];
            if (blending) {
                std::memcpy(to, from, begin);
                std::memcpy(to + end, from + end, row_bytes - end);
            } else {
                std::memcpy(to, from, row_bytes);
            }
        }
        if (blending)
            blend_row(from + begin, overlay.at(inside.x, y), overlay.format, to + begin, inside.width);
    }
}

} // namespace arhost
