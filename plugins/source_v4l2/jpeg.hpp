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

    // Sets pixel format, size and colour fields of `format` for pictures like this one: 4:2:0 of even size gives
    // I420, grey gives GREY8, everything else BGR8. False if `bytes` are not a JPEG.
    bool describe(std::span<const std::uint8_t> jpeg, arhost_frame_format &format);

    // Decodes into planes of that format. Returns false if the picture is damaged, truncated or of another size or
    // format; `fault` then has the reason, and the planes may be partly written.
    bool decode(std::span<const std::uint8_t> jpeg, const arhost_frame_format &format, std::uint8_t *const *planes,
                std::string &fault);

private:
    struct Destroy {
        void operator()(void *handle) const;
    };
    std::unique_ptr<void, Destroy> handle_; // a tjhandle
};

} // namespace arhost
