// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <arhost/frame.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>

namespace arhost {

// Decodes Motion-JPEG pictures.
class JpegDecoder {
public:
    JpegDecoder();

    // Sets the pixel format, size and colour fields of `format` for pictures like `jpeg`. The pixel format is I420
    // for 4:2:0 with an even size, GREY8 for grey, and BGR8 for all other pictures. Returns false if `jpeg` is not a
    // JPEG picture.
    bool describe(std::span<const std::uint8_t> jpeg, arhost_frame_format &format);

    // Decodes a picture into planes of `format`. Returns false if the picture is damaged or truncated, or if its size
    // or format differs. In these cases, `fault` states the reason, and the planes may be partly overwritten.
    bool decode(std::span<const std::uint8_t> jpeg, const arhost_frame_format &format, std::uint8_t *const *planes,
                std::string &fault);

private:
    struct Destroy {
        void operator()(void *handle) const;
    };
    std::unique_ptr<void, Destroy> handle_; // a tjhandle
};

} // namespace arhost
