// SPDX-License-Identifier: Apache-2.0
//
// The textures of a scene that is being loaded. Private to core/scene.
#pragma once

#include "scene/image.hpp"

#include <map>

namespace arhost::scene {

struct TextureUse {
    bool is_colour = true; // else numbers: bytes are not sRGB-encoded
    arhost_wrap wrap_u = ARHOST_WRAP_REPEAT, wrap_v = ARHOST_WRAP_REPEAT;
};

class Textures {
public:
    Textures(ArenaBuilder &builder, const LoadCallbacks &callbacks) : builder_(builder), callbacks_(callbacks) {}

    // The texture's index. An image that was asked for before in the same way is not loaded again. `content`
    // stands for a file's where one file holds several; `part` tells them apart. Throws ImageError.
    std::uint32_t add(const std::filesystem::path &file, const TextureUse &use,
                      std::span<const unsigned char> content = {}, const std::string &part = "");

    // With its cumulative sums.
    Environment add_environment(const std::filesystem::path &file);

private:
    LoadCallbacks of_an_image() const;

    ArenaBuilder &builder_;
    const LoadCallbacks &callbacks_;
    std::map<std::string, std::uint32_t> known_;
};

} // namespace arhost::scene
