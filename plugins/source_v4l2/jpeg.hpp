// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <arhost/frame.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>

namespace arhost {

// Decodes the pictures of a Motion-JPEG camera.
class JpegDecoder {
public:
    JpegDecoder();

    // Sets the first group of `format` for pictures like this one, but for fps: 4:2:0 of even size becomes
    // I420, grey GREY8, all else BGR8. False where it is no JPEG.
    bool describe(std::span<const std::uint8_t> jpeg, arhost_frame_format &format);

    // Decodes into planes of that format. False where the picture is damaged, cut short or of another size
    // or kind; `fault` then says what is wrong with it, and the planes may be half written.
    bool decode(std::span<const std::uint8_t> jpeg, const arhost_frame_format &format, std::uint8_t *const *planes,
                std::string &fault);

private:
    struct Destroy {
        void operator()(void *handle) const;
    };
    std::unique_ptr<void, Destroy> handle_; // a tjhandle
};

} // namespace arhost
