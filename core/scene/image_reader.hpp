// SPDX-License-Identifier: Apache-2.0
//
// Interface between the loader and the shared object that links OpenImageIO. OpenImageIO pulls in two hundred
// libraries, which take a quarter of a second to link at the start of every worker. So the loader opens the
// shared object only if a scene has images.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>

namespace arhost::scene {

struct ImageRequest {
    const char *format; // OpenImageIO's format name
    std::string file;
    std::span<const unsigned char> content; // replaces the file unless empty
    std::function<std::byte *(std::uint32_t width, std::uint32_t height, bool is_float)> allocate; // RGBA texels
    std::function<bool(float fraction)> report;                                                    // false: stop
};

// `error` is empty on success. Texels are returned as in the file: straight alpha, floats unchecked.
using ReadImage = void(const ImageRequest &, std::string &error);
inline constexpr const char *read_image_symbol = "arhost_read_image";

} // namespace arhost::scene
