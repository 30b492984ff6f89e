// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "libav_common/log.hpp"

#include <arhost-cpp/plugin.hpp>

#include <vector>

namespace arhost {

// Converts decoded pictures to one pixel format. Formats that the host supports (4:2:0 and 4:2:2 with BT.601 or
// BT.709, and grey) remain unchanged. Others become BGR, or grey if they have no colour.
class PictureConverter {
public:
    // The picture `first` determines the format of all pictures. They are rotated clockwise by `quarter_turns` × 90°.
    PictureConverter(const AVFrame &first, int quarter_turns);

    const arhost_frame_format &format() const { return format_; } // without plane layout
    void convert(const AVFrame &picture, const arhost_frame_buffer &buffer);

private:
    int quarter_turns_;
    AVPixelFormat source_, target_;
    arhost_frame_format format_{};
    libav::SwsPointer scaler_;
    std::vector<std::uint8_t> upright_; // buffer for a converted picture before its rotation
};

} // namespace arhost
