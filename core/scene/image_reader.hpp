// SPDX-License-Identifier: Apache-2.0
//
// Interface between the loader and the shared object that links OpenImageIO. OpenImageIO depends on two hundred
// libraries, whose dynamic linking would take a quarter of a second at the start of every worker. Therefore the
// loader opens this shared object only if a scene has images.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>

namespace arhost::scene {

struct ImageRequest {
    const char *format; // OpenImageIO's name of the format
    std::string file;
    std::span<const unsigned char> content; // if not empty, these bytes are decoded instead of the file
    std::function<std::byte *(std::uint32_t width, std::uint32_t height, bool is_float)> allocate; // RGBA texels
    std::function<bool(float fraction)> report; // returns false: stop decoding
};

// Sets `error` to a message, or leaves it empty on success. Does not change the texel values of the file: alpha is
// straight (not premultiplied), and floats may be any value.
using ReadImage = void(const ImageRequest &, std::string &error);
inline constexpr const char *read_image_symbol = "arhost_read_image";

} // namespace arhost::scene
