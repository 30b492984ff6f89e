// SPDX-License-Identifier: Apache-2.0
//
// The border between the loader and the module that holds OpenImageIO. That library brings two hundred
// others with it, a quarter of a second of linking: every worker would pay for it at each start, so the
// loader opens the module only where a scene has images.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>

namespace arhost::scene {

struct ImageRequest {
    const char *format; // OpenImageIO's name of it
    std::string file;
    std::span<const unsigned char> content; // in place of the file, or empty
    std::function<std::byte *(std::uint32_t width, std::uint32_t height, bool is_float)> allocate; // RGBA texels
    std::function<bool(float fraction)> report;                                                    // false: stop
};

// `error` is what is wrong with the image, or empty. Texels come as they are in the file: straight alpha,
// floats unchecked.
using ReadImage = void(const ImageRequest &, std::string &error);
inline constexpr const char *read_image_symbol = "arhost_read_image";

} // namespace arhost::scene
