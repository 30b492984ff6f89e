// SPDX-License-Identifier: Apache-2.0
//
// Textures and environments.
#include "tracer.hpp"

#include <arhost/shading/scalar.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace arhost::test {
namespace {

using scene::ArenaBuilder;

scene::Texture texture_of(std::uint32_t width, std::uint32_t height, const std::vector<Pixel> &pixels) {
    scene::Texture texture;
    texture.width = width;
    texture.height = height;
    texture.texels.size = 4 * pixels.size();
    texture.texels.bytes = std::make_unique<std::byte[]>(texture.texels.size);
    for (std::size_t i = 0; i < pixels.size(); ++i)
        for (std::size_t c = 0; c < 4; ++c)
            texture.texels.bytes[4 * i + c] = static_cast<std::byte>(pixels[i][c]);
    return texture;
}

// Four texels, seen from above upright: red, green / blue, white.
Picture of_four_texels(arhost_wrap wrap, float repeats, arhost_texel_format format = ARHOST_TEXEL_SRGB8) {
    ArenaBuilder builder;
    builder.settings.ambient = glm::vec3(1);
    scene::Texture texture =
        texture_of(2, 2, {{255, 0, 0, 255}, {0, 255, 0, 255}, {0, 0, 255, 255}, {188, 188, 188, 255}});
    texture.wrap_u = texture.wrap_v = wrap;
    texture.format = format;
    arhost_material material = flat(1, 1, 1);
    material.colour_texture = builder.add_texture("four", std::move(texture));
    scene::TriangleMesh mesh = square(60);
    const float n = repeats;
    mesh.texcoords = {{0, n}, {n, n}, {n, 0}, {0, 0}};
    builder.add_object("square", builder.add_triangles(std::move(mesh)), builder.add_material(material));
    return Tracer(std::move(builder)).render(from_above());
}

// Nearly so: half a pixel beside a texel's centre its neighbours are mixed in.
bool is_nearly(const Pixel &pixel, const Pixel &colour) {
    for (std::size_t c = 0; c < 4; ++c)
        if (std::abs(pixel[c] - colour[c]) > 48)
            return false;
    return true;
}

// An environment of 8×4 texels; `colour` gives one by its column.
template <class Colour> void add_environment(ArenaBuilder &builder, Colour colour) {
    constexpr std::uint32_t width = 8, height = 4;
    scene::Texture texture;
    texture.format = ARHOST_TEXEL_RGBA32F;
    texture.width = width;
    texture.height = height;
    std::vector<float> texels;
    scene::Environment environment;
    double total = 0;
    std::vector<double> row_sums;
    for (std::uint32_t y = 0; y < height; ++y) {
        double sum = 0;
        std::vector<double> sums;
        for (std::uint32_t x = 0; x < width; ++x) {
            const glm::vec3 c = colour(x);
            texels.insert(texels.end(), {c.x, c.y, c.z, 1});
            sums.push_back(sum += 0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z);
        }
        for (const double s : sums)
            environment.columns.push_back(static_cast<float>(s / sum));
        row_sums.push_back(total += sum * std::sin(std::numbers::pi * (y + 0.5) / height));
    }
    for (const double s : row_sums)
        environment.rows.push_back(static_cast<float>(s / total));
    texture.texels.size = texels.size() * sizeof(float);
    texture.texels.bytes = std::make_unique<std::byte[]>(texture.texels.size);
    std::memcpy(texture.texels.bytes.get(), texels.data(), texture.texels.size);
    environment.texture = builder.add_texture("sky", std::move(texture));
    environment.environment_from_world = glm::mat3(1, 0, 0, 0, 0, -1, 0, 1, 0); // z is up
    builder.environment = std::move(environment);
}

} // namespace

TEST(Texture, LiesUprightAndIsLinearised) {
    const Picture picture = of_four_texels(ARHOST_WRAP_REPEAT, 1);
    EXPECT_TRUE(is_nearly(picture.at(70, 44), Pixel{255, 0, 0, 255}));
    EXPECT_TRUE(is_nearly(picture.at(130, 44), Pixel{0, 255, 0, 255}));
    EXPECT_TRUE(is_nearly(picture.at(70, 104), Pixel{0, 0, 255, 255}));
    EXPECT_NEAR(picture.at(130, 104)[0], 188, 3) << "decoded and encoded again";
    EXPECT_NEAR(of_four_texels(ARHOST_WRAP_REPEAT, 1, ARHOST_TEXEL_RGBA8).at(130, 104)[0],
                shading::srgb8_exact(188 / 255.0), 3);
}

TEST(Texture, IsMixedBetweenTexelsInLinearLight) {
    // Half way from red to green.
    const Pixel mixed = of_four_texels(ARHOST_WRAP_CLAMP, 1).at(99, 30);
    EXPECT_NEAR(mixed[0], shading::srgb8_exact(0.5), 2);
    EXPECT_NEAR(mixed[1], shading::srgb8_exact(0.5), 2);
}

TEST(Texture, RepeatsClampsAndMirrors) {
    // Of three repeats the middle of the last one's left half.
    EXPECT_TRUE(is_nearly(of_four_texels(ARHOST_WRAP_REPEAT, 3).at(130, 24), Pixel{255, 0, 0, 255}));
    EXPECT_TRUE(is_nearly(of_four_texels(ARHOST_WRAP_CLAMP, 3).at(130, 24), Pixel{0, 255, 0, 255}));
    EXPECT_TRUE(is_nearly(of_four_texels(ARHOST_WRAP_MIRROR, 3).at(89, 24), Pixel{0, 255, 0, 255}));
}

TEST(Environment, LightsADiffusePlaneByItsMean) {
    ArenaBuilder builder;
    builder.settings.ambient = glm::vec3(0);
    add_environment(builder, [](std::uint32_t) { return glm::vec3(0.6f); });
    builder.add_object("plane", builder.add_triangles(square(200)), builder.add_material(diffuse(0.5f, 0.5f, 0.5f)));
    const Picture picture = Tracer(std::move(builder), {{"light_samples", "256"}}).render(from_above());
    double sum = 0;
    for (const Pixel &pixel : picture.pixels())
        sum += shading::srgb_decode(pixel[0] / 255.0);
    EXPECT_NEAR(sum / (200 * 150), 0.5 * 0.6, 0.003);
}

TEST(Environment, IsSeenInMirrorsWhereItStands) {
    ArenaBuilder builder;
    // Blue towards +x, red towards −x.
    add_environment(builder, [](std::uint32_t x) { return x < 4 ? glm::vec3(1, 0, 0) : glm::vec3(0, 0, 1); });
    builder.add_object("ball", builder.add_spheres({{0, 0, 0, 60}}), builder.add_material(mirror(1)));
    const Picture picture = Tracer(std::move(builder)).render(from_above());
    EXPECT_TRUE(is_nearly(picture.at(130, 74), Pixel{0, 0, 255, 255}));
    EXPECT_TRUE(is_nearly(picture.at(69, 74), Pixel{255, 0, 0, 255}));
}

TEST(Environment, CastsSoftShadowsOnCatchers) {
    ArenaBuilder builder;
    add_environment(builder, [](std::uint32_t) { return glm::vec3(1); });
    builder.add_object("floor", builder.add_triangles(square(80)), builder.add_material(diffuse(1, 1, 1)),
                       ARHOST_CATCHER);
    builder.add_object("ball", builder.add_spheres({{0, 0, 12, 12}}), builder.add_material(diffuse(1, 0, 0)));
    const Picture picture = Tracer(std::move(builder), {{"light_samples", "64"}}).render(from_the_side());
    int faint = 0;
    for (const auto &[alpha, count] : picture.alphas()) {
        EXPECT_TRUE(alpha <= 153 || alpha == 255) << alpha;
        faint += alpha > 0 && alpha < 60 ? count : 0;
    }
    EXPECT_GT(faint, 500);
}

} // namespace arhost::test
