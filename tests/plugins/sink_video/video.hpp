// SPDX-License-Identifier: Apache-2.0
//
// Reads a video file that sink_video wrote. Converts its frames to BGR according to the file's colour tags, and reads
// the frame numbers that Picture has drawn.
#pragma once

#include "sink_under_test.hpp"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/imgutils.h>
#include <libswscale/swscale.h>
}

#include <cstdint>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace arhost::test {

struct VideoFrame {
    int width, height;
    double time_s; // presentation time
    std::vector<std::uint8_t> bgr;

    const std::uint8_t *pixel(int x, int y) const { return &bgr[3 * (static_cast<std::size_t>(y) * width + x)]; }
    // Reads the number that Picture draws along the top edge.
    std::uint64_t number() const {
        std::uint64_t bits = 0;
        for (int i = 0; i < Picture::squares; ++i)
            if (pixel(i * Picture::square_px + Picture::square_px / 2, Picture::square_px / 2)[1] > 127)
                bits |= std::uint64_t{1} << i;
        return bits;
    }
};

struct Video {
    std::string codec;
    AVRational fps;
    double duration_s;
    AVColorRange range;
    AVColorSpace matrix;
    AVColorPrimaries primaries;
    AVColorTransferCharacteristic transfer;
    std::vector<VideoFrame> frames;

    std::vector<std::uint64_t> numbers() const {
        std::vector<std::uint64_t> all;
        for (const VideoFrame &frame : frames)
            all.push_back(frame.number());
        return all;
    }
    std::vector<double> times_s() const {
        std::vector<double> all;
        for (const VideoFrame &frame : frames)
            all.push_back(frame.time_s);
        return all;
    }
};

inline VideoFrame to_bgr(const AVFrame &frame) {
    VideoFrame out{frame.width, frame.height, 0, std::vector<std::uint8_t>(3ull * frame.width * frame.height)};
    const std::unique_ptr<SwsContext, decltype(&sws_freeContext)> sws(
        sws_getContext(frame.width, frame.height, static_cast<AVPixelFormat>(frame.format), frame.width, frame.height,
                       AV_PIX_FMT_BGR24, SWS_BICUBIC | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INT | SWS_BITEXACT, nullptr,
                       nullptr, nullptr),
        &sws_freeContext);
    const int *matrix = sws_getCoefficients(frame.colorspace);
    sws_setColorspaceDetails(sws.get(), matrix, frame.color_range == AVCOL_RANGE_JPEG, matrix, 1, 0, 1 << 16,
                             1 << 16);
    std::uint8_t *planes[] = {out.bgr.data()};
    const int strides[] = {3 * frame.width};
    // swscale may write past the end of a row. Therefore the frame is converted into a larger buffer and then copied.
    std::vector<std::uint8_t> padded(out.bgr.size() + 64);
    planes[0] = padded.data();
    sws_scale(sws.get(), frame.data, frame.linesize, 0, frame.height, planes, strides);
    std::copy_n(padded.begin(), out.bgr.size(), out.bgr.begin());
    return out;
}

inline Video read_video(const std::filesystem::path &path) {
    AVFormatContext *format = nullptr;
    if (avformat_open_input(&format, path.c_str(), nullptr, nullptr) < 0)
        throw std::runtime_error("cannot open " + path.string());
    const auto close = [](AVFormatContext *p) { avformat_close_input(&p); };
    const std::unique_ptr<AVFormatContext, decltype(close)> owner(format, close);
    if (avformat_find_stream_info(format, nullptr) < 0 || format->nb_streams != 1)
        throw std::runtime_error(path.string() + " is not a video file with one stream");
    const AVStream &stream = *format->streams[0];
    const AVCodecParameters &parameters = *stream.codecpar;
    const AVCodec *decoder = avcodec_find_decoder(parameters.codec_id);
    const auto free_codec = [](AVCodecContext *p) { avcodec_free_context(&p); };
    const std::unique_ptr<AVCodecContext, decltype(free_codec)> codec(avcodec_alloc_context3(decoder), free_codec);
    avcodec_parameters_to_context(codec.get(), &parameters);
    codec->thread_count = 1;
    codec->err_recognition = AV_EF_EXPLODE;
    if (avcodec_open2(codec.get(), decoder, nullptr) < 0)
        throw std::runtime_error("cannot open the decoder");

    Video video{decoder->name,
                stream.avg_frame_rate,
                static_cast<double>(format->duration) / AV_TIME_BASE,
                parameters.color_range,
                parameters.color_space,
                parameters.color_primaries,
                parameters.color_trc,
                {}};
    const auto free_packet = [](AVPacket *p) { av_packet_free(&p); };
    const auto free_frame = [](AVFrame *p) { av_frame_free(&p); };
    const std::unique_ptr<AVPacket, decltype(free_packet)> packet(av_packet_alloc(), free_packet);
    const std::unique_ptr<AVFrame, decltype(free_frame)> frame(av_frame_alloc(), free_frame);
    const auto take = [&] {
        while (avcodec_receive_frame(codec.get(), frame.get()) == 0) {
            video.frames.push_back(to_bgr(*frame));
            video.frames.back().time_s = static_cast<double>(frame->best_effort_timestamp) * av_q2d(stream.time_base);
        }
    };
    while (av_read_frame(format, packet.get()) >= 0) {
        if (avcodec_send_packet(codec.get(), packet.get()) < 0)
            throw std::runtime_error(path.string() + " contains a damaged packet");
        take();
        av_packet_unref(packet.get());
    }
    avcodec_send_packet(codec.get(), nullptr);
    take();
    return video;
}

} // namespace arhost::test
