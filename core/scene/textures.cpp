// SPDX-License-Identifier: Apache-2.0
#include "scene/textures.hpp"

namespace arhost::scene {
namespace {

// A texture's name is shown to users, and `validate` refuses control characters.
std::string shown(std::string text) {
    for (char &c : text)
        if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f)
            c = '?';
    return text;
}

} // namespace

Image Textures::read(const std::filesystem::path &file, std::span<const unsigned char> content) const {
    LoadCallbacks callbacks = callbacks_;
    if (callbacks_.progress) // of the scene's whole work, decoding counts as nothing
        callbacks.progress = [&](double fraction, const std::string &what) {
            callbacks_.progress(0, what + ": " + std::to_string(static_cast<int>(fraction * 100)) + " %");
        };
    return read_image(file, content, Watch(callbacks, file.filename().string()));
}

std::uint32_t Textures::add(const std::filesystem::path &file, const TextureUse &use,
                            std::span<const unsigned char> content, const std::string &part) {
    const std::string name = file.lexically_normal().string() + part;
    const auto [known, is_new] =
        known_.try_emplace(name + '\n' + char('0' + use.is_colour) + char('0' + use.wrap_u) + char('0' + use.wrap_v));
    if (!is_new)
        return known->second;
    Image image = read(file, content);
    Texture texture{image.is_float  ? ARHOST_TEXEL_RGBA32F
                    : use.is_colour ? ARHOST_TEXEL_SRGB8
                                    : ARHOST_TEXEL_RGBA8,
                    image.width,
                    image.height,
                    use.wrap_u,
                    use.wrap_v,
                    std::move(image.texels)};
    return known->second = builder_.add_texture(shown(name), std::move(texture));
}

Environment Textures::add_environment(const std::filesystem::path &file) {
    Image image = linearised(read(file, {}));
    Texture texture{ARHOST_TEXEL_RGBA32F, image.width,       image.height,
                    ARHOST_WRAP_REPEAT,   ARHOST_WRAP_CLAMP, std::move(image.texels)};
    Environment environment;
    add_cumulative_sums(environment, texture);
    environment.texture = builder_.add_texture(shown(file.string()), std::move(texture));
    return environment;
}

} // namespace arhost::scene
