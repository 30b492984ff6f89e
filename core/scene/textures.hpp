// SPDX-License-Identifier: Apache-2.0
//
// Loads the textures of a scene and adds them to an ArenaBuilder. Private to core/scene.
#pragma once

#include "scene/image.hpp"

#include <functional>
#include <map>

namespace arhost::scene {

struct TextureUse {
    bool is_colour = true; // false: linear data, not sRGB-encoded
    Texture lookup{};      // `image` is ignored
};

class Textures {
public:
    Textures(ArenaBuilder &builder, const LoadCallbacks &callbacks) : builder_(builder), callbacks_(callbacks) {}

    // Loads an image and returns the index of its texture. Loads the same image with the same encoding only once. If
    // the image is embedded in `file`, `content` must have its bytes, and `part` must identify it within the file.
    // Throws ImageError.
    std::uint32_t add(const std::filesystem::path &file, const TextureUse &use,
                      std::span<const unsigned char> content = {}, const std::string &part = "");

    // Returns the index of a texture whose image `make` returns. Calls `make` only once for each name and kind.
    std::uint32_t add(const std::string &name, const char *kind, const Texture &lookup,
                      const std::function<TexelImage(const LoadCallbacks &)> &make);

    // Reads an image without adding it, for images that are computed from others. Throws ImageError.
    Image read(const std::filesystem::path &file, std::span<const unsigned char> content = {});

    // Loads an environment map and computes its cumulative sums. Throws ImageError.
    Environment add_environment(const std::filesystem::path &file);
    // Adds an environment map (RGBA32F) and computes its cumulative sums.
    Environment add_environment(const std::string &name, TexelImage image);

private:
    LoadCallbacks image_callbacks() const;
    Environment add_environment(const std::string &name, TexelImage image, const Reporter &reporter);

    ArenaBuilder &builder_;
    const LoadCallbacks &callbacks_;
    ImageBudget budget_;
    std::map<std::string, std::uint32_t> images_;   // key: name and kind
    std::map<std::string, std::uint32_t> textures_; // key: the bytes of a Texture
};

} // namespace arhost::scene
