// SPDX-License-Identifier: Apache-2.0
#include "scene/textures.hpp"

#include "scene/image_levels.hpp"
#include "scene/mesh_file.hpp"

namespace arhost::scene {

LoadCallbacks Textures::image_callbacks() const {
    LoadCallbacks callbacks = callbacks_;
    if (callbacks_.progress) // loading images does not advance the progress of the scene
        callbacks.progress = [this](double fraction, const std::string &what) {
            callbacks_.progress(0, what + ": " + std::to_string(static_cast<int>(fraction * 100)) + " %");
        };
    return callbacks;
}

std::uint32_t Textures::add(const std::filesystem::path &file, const TextureUse &use,
                            std::span<const unsigned char> content, const std::string &part) {
    return add(file.lexically_normal().string() + part, use.is_colour ? "sRGB" : "linear", use.lookup,
               [&](const LoadCallbacks &) -> TexelImage {
                   Image image = read(file, content);
                   const arhost_texel_format format = image.is_float  ? ARHOST_TEXEL_RGBA32F
                                                      : use.is_colour ? ARHOST_TEXEL_SRGB8
                                                                      : ARHOST_TEXEL_RGBA8;
                   return {format, image.width, image.height, std::move(image.texels)};
               });
}

std::uint32_t Textures::add(const std::string &name, const char *kind, const Texture &lookup,
                            const std::function<TexelImage(const LoadCallbacks &)> &make) {
    const auto [image, is_new] = images_.try_emplace(name + "\n" + kind);
    if (is_new) {
        TexelImage made = make(image_callbacks());
        const std::uint64_t texels = texel_count(made.width, made.height, 1),
                            of_all_levels = texel_count(made.width, made.height, levels_of(made));
        budget_.take(made.texels.size / texels * (of_all_levels - texels), printable(name));
        add_levels(made);
        image->second = builder_.add_image(printable(name), std::move(made));
    }
    Texture texture = lookup;
    texture.image = image->second;
    static_assert(sizeof texture == 5 * 4 + sizeof texture.image_from_texcoord); // no padding
    const auto [known, is_new_texture] =
        textures_.try_emplace(std::string(reinterpret_cast<const char *>(&texture), sizeof texture));
    if (is_new_texture)
        known->second = builder_.add_texture(texture);
    return known->second;
}

Image Textures::read(const std::filesystem::path &file, std::span<const unsigned char> content) {
    const LoadCallbacks callbacks = image_callbacks();
    return read_image(file, content, Reporter(callbacks, file.filename().string()), budget_);
}

Environment Textures::add_environment(const std::filesystem::path &file) {
    const LoadCallbacks callbacks = image_callbacks();
    const Reporter reporter(callbacks, file.filename().string());
    Image image = linearized(read(file), reporter);
    return add_environment(printable(file.string()),
                           {ARHOST_TEXEL_RGBA32F, image.width, image.height, std::move(image.texels)}, reporter);
}

Environment Textures::add_environment(const std::string &name, TexelImage image) {
    const LoadCallbacks callbacks = image_callbacks();
    return add_environment(name, std::move(image), Reporter(callbacks, name));
}

Environment Textures::add_environment(const std::string &name, TexelImage image, const Reporter &reporter) {
    Environment environment;
    add_cumulative_sums(environment, image, reporter);
    environment.texture = builder_.add_texture(name, std::move(image), {.wrap_v = ARHOST_WRAP_CLAMP});
    return environment;
}

} // namespace arhost::scene
