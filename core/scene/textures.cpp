// SPDX-License-Identifier: Apache-2.0
#include "scene/textures.hpp"

namespace arhost::scene {
namespace {

// Replaces control characters, which `validate` rejects in names.
std::string printable(std::string text) {
    for (char &c : text)
        if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f)
            c = '?';
    return text;
}

} // namespace

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
    const std::string name = file.lexically_normal().string() + part;
    const auto [known, is_new] =
        known_.try_emplace(name + '\n' + char('0' + use.is_colour) + char('0' + use.wrap_u) + char('0' + use.wrap_v));
    if (!is_new)
        return known->second;
    const LoadCallbacks callbacks = image_callbacks();
    Image image = read_image(file, content, Reporter(callbacks, file.filename().string()));
    Texture texture{image.is_float  ? ARHOST_TEXEL_RGBA32F
                    : use.is_colour ? ARHOST_TEXEL_SRGB8
                                    : ARHOST_TEXEL_RGBA8,
                    image.width,
                    image.height,
                    use.wrap_u,
                    use.wrap_v,
                    std::move(image.texels)};
    return known->second = builder_.add_texture(printable(name), std::move(texture));
}

Environment Textures::add_environment(const std::filesystem::path &file) {
    const LoadCallbacks callbacks = image_callbacks();
    const Reporter reporter(callbacks, file.filename().string());
    Image image = linearized(read_image(file, {}, reporter), reporter);
    Texture texture{ARHOST_TEXEL_RGBA32F, image.width,       image.height,
                    ARHOST_WRAP_REPEAT,   ARHOST_WRAP_CLAMP, std::move(image.texels)};
    return add_environment(printable(file.string()), std::move(texture), reporter);
}

Environment Textures::add_environment(const std::string &name, Texture texture) {
    const LoadCallbacks callbacks = image_callbacks();
    return add_environment(name, std::move(texture), Reporter(callbacks, name));
}

Environment Textures::add_environment(const std::string &name, Texture texture, const Reporter &reporter) {
    Environment environment;
    add_cumulative_sums(environment, texture, reporter);
    environment.texture = builder_.add_texture(name, std::move(texture));
    return environment;
}

} // namespace arhost::scene
