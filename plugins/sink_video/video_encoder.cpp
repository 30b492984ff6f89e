// SPDX-License-Identifier: Apache-2.0
#include "video_encoder.hpp"

#include <algorithm>
#include <cmath>

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

} // namespace

Encoder::Encoder(const EncoderSettings &settings)
    : converter_(settings.width, settings.height, AV_PIX_FMT_YUV420P, Matrix::bt709),
      packet_(allocated<PacketPointer>(av_packet_alloc())) {
    const AVCodec *codec = find_encoder(settings.codec);
    context_ = allocated<CodecPointer>(avcodec_alloc_context3(codec));
    context_->width = converter_.padded_width();
    context_->height = converter_.padded_height();
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
                            "cannot encode frames of " + std::to_string(settings.width) + "×" +
                                std::to_string(settings.height) + " with " + codec->name,
                            code);
}

AVPacket &Encoder::encode(const std::uint8_t *bgr, std::size_t stride, std::int64_t number) {
    AVFrame &yuv = converter_.convert(bgr, stride);
    yuv.pts = number;
    yuv.quality = context_->global_quality;
    int code = avcodec_send_frame(context_.get(), &yuv);
    if (code >= 0)
        code = avcodec_receive_packet(context_.get(), packet_.get());
    if (code < 0)
        throw libav_failure(ARHOST_STATUS_ERROR_INTERNAL, "cannot encode frame " + std::to_string(number), code);
    return *packet_;
}

} // namespace arhost::video
