// SPDX-License-Identifier: Apache-2.0
#include "libav_common/bgr_converter.hpp"

#include <arhost-cpp/plugin.hpp>

extern "C" {
#include <libavutil/opt.h>
}

#include <algorithm>
#include <cstring>

namespace arhost::libav {
namespace {

FramePointer make_frame(AVPixelFormat format, int width, int height) {
    FramePointer frame = allocated<FramePointer>(av_frame_alloc());
    frame->format = format;
    frame->width = width;
    frame->height = height;
    if (av_frame_get_buffer(frame.get(), 0) < 0)
        throw std::bad_alloc();
    return frame;
}

SwsPointer make_converter(int width, int height, AVPixelFormat format, Matrix matrix) {
    SwsPointer sws = allocated<SwsPointer>(sws_alloc_context());
    av_opt_set_int(sws.get(), "srcw", width, 0);
    av_opt_set_int(sws.get(), "srch", height, 0);
    av_opt_set_int(sws.get(), "dstw", width, 0);
    av_opt_set_int(sws.get(), "dsth", height, 0);
    av_opt_set_int(sws.get(), "src_format", AV_PIX_FMT_BGR24, 0);
    av_opt_set_int(sws.get(), "dst_format", format, 0);
    // Without SWS_ACCURATE_RND, luma would be half a step too dark. Without SWS_FULL_CHR_H_INP, the colour of every
    // second pixel would be ignored.
    av_opt_set_int(sws.get(), "sws_flags", SWS_BILINEAR | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INP | SWS_BITEXACT, 0);
    av_opt_set_int(sws.get(), "dst_h_chr_pos", 0, 0); // AVCHROMA_LOC_LEFT
    av_opt_set_int(sws.get(), "dst_v_chr_pos", 128, 0);
    const int *coefficients = sws_getCoefficients(matrix == Matrix::bt709 ? SWS_CS_ITU709 : SWS_CS_ITU601);
    constexpr int full = 1, limited = 0, brightness = 0, contrast = 1 << 16, saturation = 1 << 16;
    sws_setColorspaceDetails(sws.get(), coefficients, full, coefficients, limited, brightness, contrast, saturation);
    if (const int code = sws_init_context(sws.get(), nullptr, nullptr); code < 0)
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED, "cannot convert the frames: " + error_text(code));
    return sws;
}

int even(int size) {
    return (size + 1) & ~1;
}

} // namespace

BgrConverter::BgrConverter(int width, int height, AVPixelFormat format, Matrix matrix)
    : width_(width), height_(height), bgr_(make_frame(AV_PIX_FMT_BGR24, even(width), even(height))),
      converted_(make_frame(format, even(width), even(height))),
      converter_(make_converter(even(width), even(height), format, matrix)) {}

AVFrame &BgrConverter::convert(const std::uint8_t *bgr, std::size_t stride) {
    copy_padded(bgr, stride);
    if (av_frame_make_writable(converted_.get()) < 0) // an encoder may still refer to the previous frame
        throw std::bad_alloc();
    sws_scale(converter_.get(), bgr_->data, bgr_->linesize, 0, bgr_->height, converted_->data, converted_->linesize);
    return *converted_;
}

// Copies the image into a frame of even size and repeats an odd last column or row. Even sizes need the copy as well,
// because swscale reads past the end of the pixels, which is not allowed in the host's memory.
void BgrConverter::copy_padded(const std::uint8_t *bgr, std::size_t stride) {
    const std::size_t row_size = 3 * static_cast<std::size_t>(width_);
    for (int y = 0; y < bgr_->height; ++y) {
        std::uint8_t *row = bgr_->data[0] + static_cast<std::ptrdiff_t>(y) * bgr_->linesize[0];
        std::memcpy(row, bgr + static_cast<std::size_t>(std::min(y, height_ - 1)) * stride, row_size);
        if (bgr_->width > width_)
            std::memcpy(row + row_size, row + row_size - 3, 3);
    }
}

} // namespace arhost::libav
