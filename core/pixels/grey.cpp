// SPDX-License-Identifier: Apache-2.0
#include "pixels/grey.hpp"

#include "pixels/rows.hpp"

namespace arhost {

void fill_grey(const arhost_frame_format &format, const std::uint8_t *const planes[ARHOST_MAX_PLANES],
               std::uint8_t *grey) {
    for (std::size_t y = 0; y < format.height; ++y) {
        const std::uint8_t *from = planes[0] + y * format.stride[0];
        std::uint8_t *to = grey + y * format.grey_stride;
        switch (format.pixel_format) {
        case ARHOST_PIXEL_FORMAT_RGB8:
            rows::grey_from_rgb(from, to, format.width);
            break;
        case ARHOST_PIXEL_FORMAT_BGR8:
            rows::grey_from_bgr(from, to, format.width);
            break;
        case ARHOST_PIXEL_FORMAT_YUYV:
            rows::grey_from_yuyv(from, format.yuv_range != ARHOST_YUV_RANGE_FULL, to, format.width);
            break;
        default:
            return; // plane 0 is already the grey plane
        }
    }
}

void expand_luma_plane(const arhost_frame_format &format, const std::uint8_t *luma, std::uint8_t *grey) {
    for (std::size_t y = 0; y < format.height; ++y, luma += format.grey_stride, grey += format.grey_stride)
        rows::grey_from_limited_luma(luma, grey, format.width);
}

void fill_grey_reference(const arhost_frame_format &format, const std::uint8_t *const planes[ARHOST_MAX_PLANES],
                         std::uint8_t *grey) {
    for (std::size_t y = 0; y < format.height; ++y)
        for (std::size_t x = 0; x < format.width; ++x) {
            const std::uint8_t *row = planes[0] + y * format.stride[0];
            std::uint8_t &to = grey[y * format.grey_stride + x];
            switch (format.pixel_format) {
            case ARHOST_PIXEL_FORMAT_RGB8:
                to = grey_from_rgb(row[3 * x], row[3 * x + 1], row[3 * x + 2]);
                break;
            case ARHOST_PIXEL_FORMAT_BGR8:
                to = grey_from_rgb(row[3 * x + 2], row[3 * x + 1], row[3 * x]);
                break;
            case ARHOST_PIXEL_FORMAT_YUYV:
                to = format.yuv_range == ARHOST_YUV_RANGE_FULL ? row[2 * x] : full_range(row[2 * x]);
                break;
            default:
                return;
            }
        }
}

} // namespace arhost
