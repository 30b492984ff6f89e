// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "libav.hpp"
#include "libav_common/bgr_converter.hpp"

#include <cstddef>
#include <cstdint>
#include <string>

namespace arhost::video {

struct EncoderSettings {
    int width, height; // size of the input in px; the video is padded to even sizes
    AVRational fps;
    std::string codec; // "h264" or "mpeg4"
    int crf;
    std::string preset;
    int threads;
};

// Encodes BGR8 frames as YUV 4:2:0, BT.709, limited range. The encoder uses no look-ahead. Each call therefore
// returns the packet of its own frame, which can be written immediately.
class Encoder {
public:
    explicit Encoder(const EncoderSettings &settings); // throws Failure (ARHOST_STATUS_ERROR_UNSUPPORTED)

    const AVCodecContext &context() const { return *context_; }

    // Encodes a frame. `number` becomes the packet's time stamps. The packet is valid until the next call.
    AVPacket &encode(const std::uint8_t *bgr, std::size_t stride, std::int64_t number);

private:
    BgrConverter converter_;
    CodecPointer context_;
    PacketPointer packet_;
};

} // namespace arhost::video
