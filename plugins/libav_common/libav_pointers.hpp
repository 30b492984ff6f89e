// SPDX-License-Identifier: Apache-2.0
//
// Owning pointers to libav's objects.
#pragma once

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/error.h>
#include <libswscale/swscale.h>
}

#include <memory>
#include <new>
#include <string>

namespace arhost::libav {

struct CloseInput {
    void operator()(AVFormatContext *p) const { avformat_close_input(&p); }
};
struct Delete {
    void operator()(AVCodecContext *p) const { avcodec_free_context(&p); }
    void operator()(AVFrame *p) const { av_frame_free(&p); }
    void operator()(AVPacket *p) const { av_packet_free(&p); }
    void operator()(SwsContext *p) const { sws_freeContext(p); }
};
using InputPointer = std::unique_ptr<AVFormatContext, CloseInput>; // demuxers only
using CodecPointer = std::unique_ptr<AVCodecContext, Delete>;
using FramePointer = std::unique_ptr<AVFrame, Delete>;
using PacketPointer = std::unique_ptr<AVPacket, Delete>;
using SwsPointer = std::unique_ptr<SwsContext, Delete>;

// Throws std::bad_alloc if libav returned NULL.
template <class Pointer> Pointer allocated(typename Pointer::pointer pointer) {
    if (!pointer)
        throw std::bad_alloc();
    return Pointer(pointer);
}

// "Invalid data found when processing input"
inline std::string error_text(int code) {
    char text[AV_ERROR_MAX_STRING_SIZE] = "";
    av_strerror(code, text, sizeof text);
    return text;
}

} // namespace arhost::libav
