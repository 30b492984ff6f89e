// SPDX-License-Identifier: Apache-2.0
#include "encoder.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace arhost::video {
namespace {

const AVCodec *find_encoder(const std::string &codec) {
    const AVCodec *found =
        codec == "h264" ? avcodec_find_encoder_by_name("libx264") : avcodec_find_encoder(AV_CODEC_ID_MPEG4);
    if (!found)
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED, "codec: libavcodec on this machine has no encoder for " +
                                                           codec +
                                                           (codec == "h264" ? " (libx264); try codec: mpeg4" : ""));
    return found;
}

FramePointer make_frame(AVPixelFormat format, int width, int height) {
    FramePointer frame = allocated<FramePointer>(av_frame_alloc());
    frame->format = format;
    frame->width = width;
    frame->height = height;
    if (av_frame_get_buffer(frame.get(), 0) < 0)
        throw std::bad_alloc();
    return frame;
}

SwsPointer make_converter(int width, int height) {
    SwsPointer sws = allocated<SwsPointer>(sws_alloc_context());
    av_opt_set_int(sws.get(), "srcw", width, 0);
    av_opt_set_int(sws.get(), "srch", height, 0);
    av_opt_set_int(sws.get(), "dstw", width, 0);
    av_opt_set_int(sws.get(), "dsth", height, 0);
    av_opt_set_int(sws.get(), "src_format", AV_PIX_FMT_BGR24, 0);
    av_opt_set_int(sws.get(), "dst_format", AV_PIX_FMT_YUV420P, 0);
    // Without SWS_ACCURATE_RND, luma would be half a step too dark. Without SWS_FULL_CHR_H_INP, the colour of every
    // second pixel would be ignored.
    av_opt_set_int(sws.get(), "sws_flags", SWS_BILINEAR | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INP | SWS_BITEXACT, 0);
    av_opt_set_int(sws.get(), "dst_h_chr_pos", 0, 0); // AVCHROMA_LOC_LEFT
    av_opt_set_int(sws.get(), "dst_v_chr_pos", 128, 0);
    const int *bt709 = sws_getCoefficients(SWS_CS_ITU709);
    constexpr int full = 1, limited = 0, brightness = 0, contrast = 1 << 16, saturation = 1 << 16;
    sws_setColorspaceDetails(sws.get(), bt709, full, bt709, limited, brightness, contrast, saturation);
    if (const int code = sws_init_context(sws.get(), nullptr, nullptr); code < 0)
        throw libav_failure(ARHOST_STATUS_ERROR_UNSUPPORTED, "cannot convert the frames to YUV", code);
    return sws;
}

} // namespace

Encoder::Encoder(const EncoderSettings &settings)
    : width_(settings.width), height_(settings.height), packet_(allocated<PacketPointer>(av_packet_alloc())) {
    const AVCodec *codec = find_encoder(settings.codec);
    const int even_width = (width_ + 1) & ~1, even_height = (height_ + 1) & ~1;
    context_ = allocated<CodecPointer>(avcodec_alloc_context3(codec));
    context_->width = even_width;
    context_->height = even_height;
    context_->pix_fmt = AV_PIX_FMT_YUV420P;
    context_->time_base = av_inv_q(settings.fps);
    context_->framerate = settings.fps;
    context_->sample_aspect_ratio = {1, 1};
    context_->color_range = AVCOL_RANGE_MPEG;
    context_->colorspace = AVCOL_SPC_BT709;
    context_->color_primaries = AVCOL_PRI_BT709;
    context_->color_trc = AVCOL_TRC_BT709;
    context_->chroma_sample_location = AVCHROMA_LOC_LEFT;
    context_->max_b_frames = 0;
    context_->thread_count = settings.threads;
    context_->flags |= AV_CODEC_FLAG_GLOBAL_HEADER; // MP4 requires it
    if (settings.codec == "h264") {
        av_opt_set(context_->priv_data, "preset", settings.preset.c_str(), 0);
        av_opt_set(context_->priv_data, "tune", "zerolatency", 0);
        av_opt_set_double(context_->priv_data, "crf", settings.crf, 0);
    } else {
        // Choose the MPEG-4 quantiser (1 to 31) whose step size equals that of H.264 at this crf:
        // 2·quantiser = 0.625·2^(crf/6).
        const long quantiser = std::lround(0.3125 * std::exp2(settings.crf / 6.0));
        context_->flags |= AV_CODEC_FLAG_QSCALE | AV_CODEC_FLAG_BITEXACT;
        context_->global_quality = FF_QP2LAMBDA * static_cast<int>(std::clamp(quantiser, 1l, 31l));
        context_->gop_size = 250; // the default of x264
    }
    if (const int code = avcodec_open2(context_.get(), codec, nullptr); code < 0)
        throw libav_failure(ARHOST_STATUS_ERROR_UNSUPPORTED,
                            "cannot encode frames of " + std::to_string(width_) + "×" + std::to_string(height_) +
                                " with " + codec->name,
                            code);
    bgr_ = make_frame(AV_PIX_FMT_BGR24, even_width, even_height);
    yuv_ = make_frame(AV_PIX_FMT_YUV420P, even_width, even_height);
    converter_ = make_converter(even_width, even_height);
}

AVPacket &Encoder::encode(const std::uint8_t *bgr, std::size_t stride, std::int64_t number) {
    copy_padded(bgr, stride);
    if (av_frame_make_writable(yuv_.get()) < 0) // the encoder may still refer to the previous frame
        throw std::bad_alloc();
    sws_scale(converter_.get(), bgr_->data, bgr_->linesize, 0, bgr_->height, yuv_->data, yuv_->linesize);
    yuv_->pts = number;
    yuv_->quality = context_->global_quality;
    int code = avcodec_send_frame(context_.get(), yuv_.get());
    if (code >= 0)
        code = avcodec_receive_packet(context_.get(), packet_.get());
    if (code < 0)
        throw libav_failure(ARHOST_STATUS_ERROR_INTERNAL, "cannot encode frame " + std::to_string(number), code);
    return *packet_;
}

// Copies the image into a frame of even size and repeats an odd last column or row. Even sizes need the copy as well,
// because swscale reads past the end of the pixels, which is not allowed in the host's memory.
void Encoder::copy_padded(const std::uint8_t *bgr, std::size_t stride) {
    const std::size_t row_size = 3 * static_cast<std::size_t>(width_);
    for (int y = 0; y < bgr_->height; ++y) {
        std::uint8_t *row = bgr_->data[0] + static_cast<std::ptrdiff_t>(y) * bgr_->linesize[0];
        std::memcpy(row, bgr + static_cast<std::size_t>(std::min(y, height_ - 1)) * stride, row_size);
        if (bgr_->width > width_)
            std::memcpy(row + row_size, row + row_size - 3, 3);
    }
}

} // namespace arhost::video
