// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "libav.hpp"

#include <arhost-cpp/plugin.hpp>

#include <vector>

namespace arhost {

// Brings decoded pictures into one pixel format. Those that the host can composite on go through
// unchanged (4:2:0 with BT.601 or BT.709, and grey); others become BGR, or grey if they have no colour.
class PictureConverter {
public:
    // As the first picture is; all are turned clockwise by so many quarters.
    PictureConverter(const AVFrame &first, int quarter_turns);

    const arhost_frame_format &format() const { return format_; } // not laid out
    void convert(const AVFrame &picture, const arhost_frame_buffer &buffer);

private:
    int quarter_turns_;
    AVPixelFormat source_, target_;
    arhost_frame_format format_{};
    libav::SwsPointer scaler_;
    std::vector<std::uint8_t> upright_; // a converted picture that has yet to be turned
};

} // namespace arhost
