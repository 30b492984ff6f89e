// SPDX-License-Identifier: Apache-2.0
#include "libav_common/picture_converter.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>

namespace arhost {

namespace {

bool is_full_range(const AVFrame &picture) {
    return picture.color_range == AVCOL_RANGE_JPEG || picture.format == AV_PIX_FMT_YUVJ420P ||
           picture.format == AV_PIX_FMT_YUVJ422P || picture.format == AV_PIX_FMT_YUVJ444P ||
           picture.format == AV_PIX_FMT_YUVJ440P || picture.format == AV_PIX_FMT_YUVJ411P;
}

// Returns the colour matrix. If the stream does not specify it, guesses it like common players.
AVColorSpace colour_space(const AVFrame &picture) {
    if (picture.colorspace != AVCOL_SPC_UNSPECIFIED && picture.colorspace != AVCOL_SPC_RESERVED)
        return picture.colorspace;
    return picture.width >= 1280 || picture.height > 576 ? AVCOL_SPC_BT709 : AVCOL_SPC_SMPTE170M;
}

std::optional<arhost_yuv_matrix> yuv_matrix(const AVFrame &picture) {
    switch (colour_space(picture)) {
    case AVCOL_SPC_BT709:
        return ARHOST_YUV_MATRIX_BT709;
    case AVCOL_SPC_BT470BG:
    case AVCOL_SPC_SMPTE170M:
        return ARHOST_YUV_MATRIX_BT601;
    default: // swscale converts BT.2020 and others
        return std::nullopt;
    }
}

bool is_grey(AVPixelFormat format) {
    return av_pix_fmt_desc_get(format)->nb_components <= 2; // grey, grey with alpha, or black and white
}

std::size_t bytes_a_pixel(arhost_pixel_format format, std::uint32_t plane) {
    return format == ARHOST_PIXEL_FORMAT_BGR8 ? 3 : format == ARHOST_PIXEL_FORMAT_NV12 && plane == 1 ? 2 : 1;
}

// A plane as seen after a rotation by a multiple of 90°: pixel (x, y) is at offset x·step_x + y·step_y.
struct Plane {
    const std::uint8_t *origin;
    std::ptrdiff_t step_x, step_y;
};

// `width`, `height`: the size before the rotation.
Plane turned(const std::uint8_t *data, std::ptrdiff_t stride, std::ptrdiff_t width, std::ptrdiff_t height,
             std::ptrdiff_t bytes, int quarter_turns_clockwise) {
    switch (quarter_turns_clockwise) {
    case 1:
        return {data + (height - 1) * stride, -stride, bytes};
    case 2:
        return {data + (height - 1) * stride + (width - 1) * bytes, -bytes, -stride};
    case 3:
        return {data + (width - 1) * bytes, stride, -bytes};
    default:
        return {data, bytes, stride};
    }
}

void copy_plane(const Plane &from, std::uint8_t *to, std::size_t to_stride, std::size_t width, std::size_t height,
                std::size_t bytes) {
    for (std::size_t y = 0; y < height; ++y, to += to_stride) {
        const std::uint8_t *pixel = from.origin + static_cast<std::ptrdiff_t>(y) * from.step_y;
        if (from.step_x == static_cast<std::ptrdiff_t>(bytes))
            std::copy_n(pixel, width * bytes, to);
        else
            for (std::size_t x = 0; x < width; ++x, pixel += from.step_x)
                std::copy_n(pixel, bytes, to + x * bytes);
    }
}

// Writes planar YUV 4:2:2 as YUYV.
void interleave(const std::array<const std::uint8_t *, ARHOST_MAX_PLANES> &data,
                const std::array<std::ptrdiff_t, ARHOST_MAX_PLANES> &stride, const arhost_frame_buffer &buffer) {
    for (std::uint32_t y = 0; y < buffer.format->height; ++y) {
        std::uint8_t *to = buffer.plane[0] + std::size_t{y} * buffer.format->stride[0];
        const std::uint8_t *luma = data[0] + y * stride[0], *u = data[1] + y * stride[1],
                           *v = data[2] + y * stride[2];
        for (std::uint32_t x = 0; x < buffer.format->width; x += 2, to += 4) {
            to[0] = luma[x];
            to[1] = u[x / 2];
            to[2] = luma[x + 1];
            to[3] = v[x / 2];
        }
    }
}

} // namespace

PictureConverter::PictureConverter(const AVFrame &first, int quarter_turns)
    : quarter_turns_(quarter_turns), source_(static_cast<AVPixelFormat>(first.format)), target_(source_) {
    const bool even = first.width % 2 == 0 && first.height % 2 == 0;
    const auto matrix = yuv_matrix(first);
    if ((source_ == AV_PIX_FMT_YUV420P || source_ == AV_PIX_FMT_YUVJ420P) && even && matrix)
        format_.pixel_format = ARHOST_PIXEL_FORMAT_I420;
    else if (source_ == AV_PIX_FMT_NV12 && even && matrix)
        format_.pixel_format = ARHOST_PIXEL_FORMAT_NV12;
    else if ((source_ == AV_PIX_FMT_YUV422P || source_ == AV_PIX_FMT_YUVJ422P) && first.width % 2 == 0 &&
             quarter_turns == 0 && matrix)
        format_.pixel_format = ARHOST_PIXEL_FORMAT_YUYV;
    else if (is_grey(source_)) {
        format_.pixel_format = ARHOST_PIXEL_FORMAT_GREY8;
        target_ = AV_PIX_FMT_GRAY8;
    } else {
        format_.pixel_format = ARHOST_PIXEL_FORMAT_BGR8;
        target_ = AV_PIX_FMT_BGR24;
    }
    format_.struct_size = sizeof format_;
    format_.width = static_cast<std::uint32_t>(quarter_turns % 2 ? first.height : first.width);
    format_.height = static_cast<std::uint32_t>(quarter_turns % 2 ? first.width : first.height);
    format_.yuv_matrix = matrix.value_or(ARHOST_YUV_MATRIX_BT601);
    format_.transfer = first.color_trc == AVCOL_TRC_LINEAR ? ARHOST_TRANSFER_LINEAR : ARHOST_TRANSFER_SRGB;
    format_.yuv_range = is_full_range(first) ? ARHOST_YUV_RANGE_FULL : ARHOST_YUV_RANGE_LIMITED;
}

void PictureConverter::convert(const AVFrame &picture, const arhost_frame_buffer &buffer) {
    std::array<const std::uint8_t *, ARHOST_MAX_PLANES> data = {picture.data[0], picture.data[1], picture.data[2]};
    std::array<std::ptrdiff_t, ARHOST_MAX_PLANES> stride = {picture.linesize[0], picture.linesize[1],
                                                            picture.linesize[2]};
    const auto format = static_cast<AVPixelFormat>(picture.format);
    if (format != target_) {
        scaler_.reset(sws_getCachedContext(
            scaler_.release(), picture.width, picture.height, format, picture.width, picture.height, target_,
            SWS_BICUBIC | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INT | SWS_BITEXACT, nullptr, nullptr, nullptr));
        if (!scaler_)
            throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED,
                          std::string("cannot convert from the pixel format '") + av_get_pix_fmt_name(format) + "'");
        // sws_getCoefficients takes SWS_CS_…, which has the same values as AVColorSpace.
        const int *matrix = sws_getCoefficients(colour_space(picture));
        const bool to_full = target_ == AV_PIX_FMT_BGR24 || format_.yuv_range == ARHOST_YUV_RANGE_FULL;
        sws_setColorspaceDetails(scaler_.get(), matrix, is_full_range(picture), matrix, to_full, 0, 1 << 16, 1 << 16);

        arhost_frame_format upright = format_;
        upright.width = static_cast<std::uint32_t>(picture.width);
        upright.height = static_cast<std::uint32_t>(picture.height);
        arhost_frame_layout(&upright);
        upright_.resize(upright.byte_size);
        std::array<std::uint8_t *, 4> to{};
        std::array<int, 4> to_stride{};
        for (std::uint32_t p = 0; p < upright.plane_count; ++p) {
            to[p] = upright_.data() + upright.offset[p];
            to_stride[p] = static_cast<int>(upright.stride[p]);
            data[p] = to[p];
            stride[p] = to_stride[p];
        }
        sws_scale(scaler_.get(), picture.data, picture.linesize, 0, picture.height, to.data(), to_stride.data());
    }

    if (format_.pixel_format == ARHOST_PIXEL_FORMAT_YUYV)
        return interleave(data, stride, buffer);
    for (std::uint32_t p = 0; p < buffer.format->plane_count; ++p) {
        const std::uint32_t shrink = p == 0 ? 1 : 2;
        const std::size_t bytes = bytes_a_pixel(format_.pixel_format, p);
        copy_plane(turned(data[p], stride[p], picture.width / static_cast<int>(shrink),
                          picture.height / static_cast<int>(shrink), static_cast<std::ptrdiff_t>(bytes),
                          quarter_turns_),
                   buffer.plane[p], buffer.format->stride[p], format_.width / shrink, format_.height / shrink, bytes);
    }

    // GREY8 is full range by definition; swscale assumes full range for every grey format.
    if (format_.pixel_format == ARHOST_PIXEL_FORMAT_GREY8 && picture.color_range == AVCOL_RANGE_MPEG)
        for (std::uint32_t y = 0; y < format_.height; ++y) {
            std::uint8_t *row = buffer.plane[0] + static_cast<std::size_t>(y) * buffer.format->stride[0];
            std::transform(row, row + format_.width, row, [](std::uint8_t v) {
                return static_cast<std::uint8_t>(std::clamp(((v - 16) * 255 + 109) / 219, 0, 255));
            });
        }
}

} // namespace arhost
