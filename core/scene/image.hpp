// SPDX-License-Identifier: Apache-2.0
//
// Images for textures and environments: PNG, JPEG, WebP, PNM, Radiance HDR and OpenEXR. Private to core/scene.
#pragma once

#include "scene/arena_builder.hpp"
#include "scene/arena_limits.hpp"
#include "scene/callbacks.hpp"

#include <filesystem>
#include <span>
#include <stdexcept>
#include <string>

namespace arhost::scene {

// what() is one sentence for the user that starts with the file name.
class ImageError : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

struct Image {
    std::uint32_t width = 0, height = 0;
    bool is_float = false; // true: RGBA floats, linear light, 0 to 1e6; false: RGBA bytes
    Texels texels;         // the top row is first
};

// Limits the decoded images of a scene in total: a small file may expand to gigabytes.
class ImageBudget {
public:
    explicit ImageBudget(std::uint64_t bytes = image_bytes_limit) : limit_(bytes), left_(bytes) {}
    // Call it before decoding. Throws ImageError if nothing is left. `name`: of the image.
    void take(std::uint64_t bytes, const std::string &name);

private:
    std::uint64_t limit_, left_;
};

// Decodes `content`, the bytes of an image file, or reads `file` if `content` is empty. Converts integer channels to
// 8 bits and keeps floats. Expands grey to RGB; images without alpha become opaque. Throws ImageError.
Image read_image(const std::filesystem::path &file, std::span<const unsigned char> content, const Reporter &reporter,
                 ImageBudget &budget);

// Converts to RGBA floats in linear light; decodes sRGB-encoded bytes.
Image linearized(Image image, const Reporter &reporter);

// Sets `rows` and `columns` to cumulative sums of luminance · sin(πv), for importance sampling. The luminance is the
// mean over a texel of the image as ray tracers interpolate it. `image` must be RGBA32F.
void add_cumulative_sums(Environment &environment, const TexelImage &image, const Reporter &reporter);

} // namespace arhost::scene
