// SPDX-License-Identifier: Apache-2.0
//
// libav's objects, with owners.
#pragma once

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/display.h>
#include <libavutil/imgutils.h>
#include <libavutil/pixdesc.h>
#include <libswscale/swscale.h>
}

#include <arhost-cpp/plugin.hpp>

#include <memory>
#include <mutex>
#include <string>

namespace arhost {

struct LibavDelete {
    void operator()(AVFormatContext *p) const { avformat_close_input(&p); }
    void operator()(AVCodecContext *p) const { avcodec_free_context(&p); }
    void operator()(AVFrame *p) const { av_frame_free(&p); }
    void operator()(AVPacket *p) const { av_packet_free(&p); }
    void operator()(SwsContext *p) const { sws_freeContext(p); }
};
using FormatPointer = std::unique_ptr<AVFormatContext, LibavDelete>;
using CodecPointer = std::unique_ptr<AVCodecContext, LibavDelete>;
using FramePointer = std::unique_ptr<AVFrame, LibavDelete>;
using PacketPointer = std::unique_ptr<AVPacket, LibavDelete>;
using SwsPointer = std::unique_ptr<SwsContext, LibavDelete>;

// "Invalid data found when processing input"
std::string libav_error(int code);

// libav has one log callback a process. While this object lives, what libav says goes to the host as
// debug messages instead of stderr.
class LibavLog {
public:
    explicit LibavLog(const Host &host);
    ~LibavLog();
    LibavLog(const LibavLog &) = delete;
    LibavLog &operator=(const LibavLog &) = delete;

    // " (moov atom not found)": the last error since the call before, for the user's message; or "".
    std::string take_reason();

private:
    static void on_message(void *context, int level, const char *format, va_list arguments);

    Host host_;
    std::mutex mutex_;
    std::string last_error_;
    int print_prefix_ = 1; // libav's own: whether a line begins
};

} // namespace arhost
