// SPDX-License-Identifier: Apache-2.0
#include "video_file.hpp"

extern "C" {
#include <libavutil/opt.h>
}

#include <algorithm>
#include <cstring>
#include <fcntl.h>

namespace arhost::session {

using namespace libav;

namespace {

bool is_rgb(arhost_pixel_format format) {
    return format == ARHOST_PIXEL_FORMAT_BGR8 || format == ARHOST_PIXEL_FORMAT_RGB8;
}

// Returns the planar or padded format that stores the frames' pixels without loss.
AVPixelFormat encoded_format(arhost_pixel_format format, bool is_ffv1) {
    switch (format) {
    case ARHOST_PIXEL_FORMAT_GREY8:
        return AV_PIX_FMT_GRAY8;
    case ARHOST_PIXEL_FORMAT_RGB8:
        return is_ffv1 ? AV_PIX_FMT_BGR0 : AV_PIX_FMT_RGB24;
    case ARHOST_PIXEL_FORMAT_BGR8:
        return is_ffv1 ? AV_PIX_FMT_BGR0 : AV_PIX_FMT_BGR24;
    case ARHOST_PIXEL_FORMAT_YUYV:
        return AV_PIX_FMT_YUV422P;
    default:
        return AV_PIX_FMT_YUV420P;
    }
}

void check_libav(int code, const char *what) {
    if (code < 0)
        throw Failure(ARHOST_STATUS_ERROR_INTERNAL, std::string(what) + ": " + error_text(code));
}

void copy_rows(std::uint8_t *to, std::ptrdiff_t to_stride, const std::uint8_t *from, std::size_t from_stride,
               std::size_t row, std::uint32_t rows) {
    for (std::uint32_t y = 0; y < rows; ++y)
        std::memcpy(to + y * to_stride, from + y * from_stride, row);
}

// Adds a byte of padding to each pixel. `red`: position of red in the pixels.
void pad_rgb(const AVFrame &to, const std::uint8_t *from, std::size_t from_stride, std::size_t red) {
    for (int y = 0; y < to.height; ++y) {
        std::uint8_t *out = to.data[0] + std::ptrdiff_t{y} * to.linesize[0];
        const std::uint8_t *in = from + static_cast<std::size_t>(y) * from_stride;
        for (int x = 0; x < to.width; ++x, in += 3, out += 4) {
            out[0] = in[2 - red];
            out[1] = in[1];
            out[2] = in[red];
            out[3] = 0;
        }
    }
}

void unpack_yuyv(const AVFrame &to, const std::uint8_t *from, std::size_t from_stride) {
    for (int y = 0; y < to.height; ++y) {
        const std::uint8_t *in = from + static_cast<std::size_t>(y) * from_stride;
        std::uint8_t *luma = to.data[0] + std::ptrdiff_t{y} * to.linesize[0];
        std::uint8_t *u = to.data[1] + std::ptrdiff_t{y} * to.linesize[1];
        std::uint8_t *v = to.data[2] + std::ptrdiff_t{y} * to.linesize[2];
        for (int x = 0; x < to.width / 2; ++x, in += 4) {
            luma[2 * x] = in[0];
            luma[2 * x + 1] = in[2];
            u[x] = in[1];
            v[x] = in[3];
        }
    }
}

void separate_chroma(const AVFrame &to, const std::uint8_t *from, std::size_t from_stride) {
    for (int y = 0; y < to.height / 2; ++y)
        for (int x = 0; x < to.width / 2; ++x)
            for (int plane = 1; plane <= 2; ++plane)
                to.data[plane][std::ptrdiff_t{y} * to.linesize[plane] + x] =
                    from[static_cast<std::size_t>(y) * from_stride + static_cast<std::size_t>(2 * x + plane - 1)];
}

int take_bytes(void *pending, std::uint8_t *bytes, int size) {
    auto &buffer = *static_cast<std::vector<std::uint8_t> *>(pending);
    try {
        buffer.insert(buffer.end(), bytes, bytes + size);
    } catch (const std::bad_alloc &) {
        return AVERROR(ENOMEM);
    }
    return size;
}

} // namespace

void VideoFile::FreeMuxer::operator()(AVFormatContext *p) const {
    if (p->pb)
        av_freep(&p->pb->buffer);
    avio_context_free(&p->pb);
    avformat_free_context(p);
}

VideoFile::VideoFile(std::filesystem::path path, const VideoSettings &settings)
    : path_(std::move(path)), settings_(settings), frame_(allocated<FramePointer>(av_frame_alloc())),
      packet_(allocated<PacketPointer>(av_packet_alloc())) {
    open_encoder();
    frame_->format = encoder_->pix_fmt;
    frame_->width = encoder_->width;
    frame_->height = encoder_->height;
    if (av_frame_get_buffer(frame_.get(), 0) < 0)
        throw std::bad_alloc();
}

void VideoFile::open_encoder() {
    const arhost_frame_format &format = settings_.format;
    const bool is_ffv1 = settings_.codec == "ffv1";
    const AVCodec *codec = is_ffv1
                               ? avcodec_find_encoder(AV_CODEC_ID_FFV1)
                               : avcodec_find_encoder_by_name(is_rgb(format.pixel_format) ? "libx264rgb" : "libx264");
    if (!codec)
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED, "codec: libavcodec on this machine has no encoder for " +
                                                           settings_.codec +
                                                           "; choose the other one of ffv1 and h264");
    encoder_ = allocated<CodecPointer>(avcodec_alloc_context3(codec));
    encoder_->width = static_cast<int>(format.width);
    encoder_->height = static_cast<int>(format.height);
    encoder_->pix_fmt = encoded_format(format.pixel_format, is_ffv1);
    encoder_->framerate = av_d2q(settings_.fps > 0 ? settings_.fps : 30, 65535);
    encoder_->time_base = av_inv_q(encoder_->framerate);
    encoder_->sample_aspect_ratio = {1, 1};
    encoder_->max_b_frames = 0;
    encoder_->thread_count = settings_.threads;
    encoder_->thread_type = FF_THREAD_SLICE;
    encoder_->flags |= AV_CODEC_FLAG_GLOBAL_HEADER | AV_CODEC_FLAG_BITEXACT;
    const bool is_yuv = !is_rgb(format.pixel_format) && format.pixel_format != ARHOST_PIXEL_FORMAT_GREY8;
    encoder_->color_range =
        is_yuv && format.yuv_range == ARHOST_YUV_RANGE_LIMITED ? AVCOL_RANGE_MPEG : AVCOL_RANGE_JPEG;
    if (format.transfer == ARHOST_TRANSFER_LINEAR)
        encoder_->color_trc = AVCOL_TRC_LINEAR;
    if (is_yuv)
        encoder_->colorspace = format.yuv_matrix == ARHOST_YUV_MATRIX_BT709 ? AVCOL_SPC_BT709 : AVCOL_SPC_SMPTE170M;
    else if (!is_ffv1 && is_rgb(format.pixel_format))
        encoder_->colorspace = AVCOL_SPC_RGB;
    if (is_ffv1) {
        encoder_->gop_size = 1; // each frame can be decoded alone
        encoder_->level = 3;
        av_opt_set_int(encoder_->priv_data, "slicecrc", 1, 0); // makes damage detectable
        encoder_->slices = 4;                                  // fixed, so that the file does not depend on `threads`
    } else {
        encoder_->gop_size = 30;
        av_opt_set(encoder_->priv_data, "preset", "veryfast", 0);
        av_opt_set(encoder_->priv_data, "tune", "zerolatency", 0);
        av_opt_set_double(encoder_->priv_data, "crf", settings_.crf, 0);
    }
    if (const int code = avcodec_open2(encoder_.get(), codec, nullptr); code < 0)
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED, "cannot encode frames of " + std::to_string(format.width) +
                                                           "×" + std::to_string(format.height) + " with " +
                                                           codec->name + ": " + error_text(code));
}

// Begins the stream of Matroska data. Afterwards, `pending_` is the header of the file.
void VideoFile::begin_stream() {
    AVFormatContext *context = nullptr;
    if (avformat_alloc_output_context2(&context, nullptr, "matroska", nullptr) < 0)
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED, "libavformat on this machine cannot write Matroska");
    muxer_.reset(context);
    constexpr int buffer_size = 64 * 1024;
    auto *buffer = static_cast<std::uint8_t *>(av_malloc(buffer_size));
    context->pb = avio_alloc_context(buffer, buffer_size, 1, &pending_, nullptr, take_bytes, nullptr);
    if (!buffer || !context->pb)
        throw std::bad_alloc();
    context->pb->seekable = 0;
    context->flags |= AVFMT_FLAG_BITEXACT;            // do not write dates and versions
    av_opt_set_int(context->priv_data, "live", 1, 0); // a stream of unknown length, without an index
    AVStream *stream = avformat_new_stream(context, nullptr);
    if (!stream)
        throw std::bad_alloc();
    stream->time_base = {1, 1000};
    stream->avg_frame_rate = stream->r_frame_rate = encoder_->framerate;
    check_libav(avcodec_parameters_from_context(stream->codecpar, encoder_.get()), "cannot describe the video");
    stream->sample_aspect_ratio = encoder_->sample_aspect_ratio;
    check_libav(avformat_write_header(context, nullptr), "cannot begin the video");
    avio_flush(context->pb);
}

void VideoFile::create() {
    file_.emplace(path_, O_RDWR | O_CREAT | O_TRUNC | O_APPEND);
    end_ = 0;
    try {
        begin_stream();
        write_pending();
    } catch (const Failure &) {
        file_.reset();
        throw;
    }
}

void VideoFile::resume(std::uint64_t bytes) {
    file_.emplace(path_, O_RDWR | O_APPEND);
    truncate(bytes);
    begin_stream();
    pending_.clear(); // the file already has this header
}

void VideoFile::truncate(std::uint64_t bytes) {
    file_->truncate(bytes);
    end_ = bytes;
}

void VideoFile::append(const std::uint8_t *const (&planes)[ARHOST_MAX_PLANES], std::int64_t time_ms) {
    if (av_frame_make_writable(frame_.get()) < 0) // the encoder may still use the previous picture
        throw std::bad_alloc();
    fill(planes);
    frame_->pts = count_++;
    int code = avcodec_send_frame(encoder_.get(), frame_.get());
    if (code >= 0)
        code = avcodec_receive_packet(encoder_.get(), packet_.get());
    check_libav(code, "cannot encode a frame");
    packet_->pts = packet_->dts = time_ms;
    packet_->duration = 0;
    packet_->stream_index = 0;
    code = av_write_frame(muxer_.get(), packet_.get());
    av_packet_unref(packet_.get());
    check_libav(code, "cannot write a frame");
    check_libav(av_write_frame(muxer_.get(), nullptr), "cannot write a frame"); // ends the cluster
    avio_flush(muxer_->pb);
    write_pending();
}

void VideoFile::write_pending() {
    try {
        file_->append(pending_);
    } catch (const Failure &) {
        pending_.clear();
        file_->truncate(end_); // removes the partial cluster
        throw;
    }
    end_ += pending_.size();
    pending_.clear();
}

void VideoFile::fill(const std::uint8_t *const (&planes)[ARHOST_MAX_PLANES]) {
    const arhost_frame_format &format = settings_.format;
    switch (format.pixel_format) {
    case ARHOST_PIXEL_FORMAT_YUYV:
        return unpack_yuyv(*frame_, planes[0], format.stride[0]);
    case ARHOST_PIXEL_FORMAT_RGB8:
    case ARHOST_PIXEL_FORMAT_BGR8:
        if (frame_->format == AV_PIX_FMT_BGR0)
            pad_rgb(*frame_, planes[0], format.stride[0], format.pixel_format == ARHOST_PIXEL_FORMAT_RGB8 ? 0 : 2);
        else
            copy_rows(frame_->data[0], frame_->linesize[0], planes[0], format.stride[0],
                      3 * std::size_t{format.width}, format.height);
        return;
    default:
        copy_rows(frame_->data[0], frame_->linesize[0], planes[0], format.stride[0], format.width, format.height);
    }
    if (format.pixel_format == ARHOST_PIXEL_FORMAT_NV12)
        separate_chroma(*frame_, planes[1], format.stride[1]);
    else if (format.pixel_format == ARHOST_PIXEL_FORMAT_I420)
        for (const int plane : {1, 2})
            copy_rows(frame_->data[plane], frame_->linesize[plane], planes[plane], format.stride[plane],
                      format.width / 2, format.height / 2);
}

} // namespace arhost::session
