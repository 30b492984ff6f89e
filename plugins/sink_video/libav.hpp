// SPDX-License-Identifier: Apache-2.0
//
// libav's objects, with owners, and its errors.
#pragma once

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/opt.h>
#include <libswscale/swscale.h>
}

#include <arhost-cpp/plugin.hpp>

#include <memory>
#include <string>

namespace arhost::video {

struct LibavDelete {
    void operator()(AVCodecContext *p) const { avcodec_free_context(&p); }
    void operator()(AVFrame *p) const { av_frame_free(&p); }
    void operator()(AVPacket *p) const { av_packet_free(&p); }
    void operator()(SwsContext *p) const { sws_freeContext(p); }
};
using CodecPointer = std::unique_ptr<AVCodecContext, LibavDelete>;
using FramePointer = std::unique_ptr<AVFrame, LibavDelete>;
using PacketPointer = std::unique_ptr<AVPacket, LibavDelete>;
using SwsPointer = std::unique_ptr<SwsContext, LibavDelete>;

// A film that is read.
struct CloseInput {
    void operator()(AVFormatContext *p) const { avformat_close_input(&p); }
};
using InputPointer = std::unique_ptr<AVFormatContext, CloseInput>;

// A film that is written, with its file.
struct CloseOutput {
    void operator()(AVFormatContext *p) const {
        avio_closep(&p->pb);
        avformat_free_context(p);
    }
};
using OutputPointer = std::unique_ptr<AVFormatContext, CloseOutput>;

inline Failure libav_failure(arhost_status status, const std::string &what, int code) {
    char reason[AV_ERROR_MAX_STRING_SIZE] = "";
    av_strerror(code, reason, sizeof reason);
    return Failure(status, what + ": " + reason);
}

template <class Pointer> Pointer allocated(typename Pointer::pointer pointer) {
    if (!pointer)
        throw std::bad_alloc();
    return Pointer(pointer);
}

} // namespace arhost::video
