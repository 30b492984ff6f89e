// SPDX-License-Identifier: Apache-2.0
//
// Converts BGR8 frames to the pixel format of a video.
#pragma once

#include "libav_common/libav_pointers.hpp"

#include <cstddef>
#include <cstdint>

namespace arhost::libav {

enum class Matrix { bt601, bt709 };

// Converts to YUV with limited range. In YUV 4:2:0 and 4:2:2, the chroma samples are at the left, as in MPEG-2.
class BgrConverter {
public:
    // `width` and `height` are the size of the frames in px. Throws Failure (ARHOST_STATUS_ERROR_UNSUPPORTED).
    BgrConverter(int width, int height, AVPixelFormat format, Matrix matrix);

    // The size of converted frames. Odd sizes are increased by repeating the last column or row.
    int padded_width() const { return converted_->width; }
    int padded_height() const { return converted_->height; }

    // The returned frame is valid until the next call. If an encoder still refers to it, the next call returns a new
    // frame.
    AVFrame &convert(const std::uint8_t *bgr, std::size_t stride);

private:
    void copy_padded(const std::uint8_t *bgr, std::size_t stride);

    int width_, height_;
    FramePointer bgr_, converted_;
    SwsPointer converter_;
};

} // namespace arhost::libav
