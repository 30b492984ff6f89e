// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "libav.hpp"

#include <cstddef>
#include <cstdint>
#include <string>

namespace arhost::video {

struct EncoderSettings {
    int width, height; // px, of the input; the film is padded to even sizes
    AVRational fps;
    std::string codec; // "h264" or "mpeg4"
    int crf;
    std::string preset;
    int threads;
};

// Encodes BGR8 frames as YUV 4:2:0, BT.709, limited range. There is no look-ahead: each call returns the packet of
// its frame, which can be written at once.
class Encoder {
public:
    explicit Encoder(const EncoderSettings &settings); // throws Failure of ARHOST_STATUS_ERROR_UNSUPPORTED

    const AVCodecContext &context() const { return *context_; }

    // Times are frame numbers, in units of 1/fps. The packet is valid until the next call.
    AVPacket &encode(const std::uint8_t *bgr, std::size_t stride, std::int64_t number);

private:
    void copy_padded(const std::uint8_t *bgr, std::size_t stride);

    int width_, height_;
    CodecPointer context_;
    FramePointer bgr_, yuv_;
    SwsPointer converter_;
    PacketPointer packet_;
};

} // namespace arhost::video
