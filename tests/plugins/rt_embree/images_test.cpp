// SPDX-License-Identifier: Apache-2.0
//
// Tests textures and environments.
#include "rich_scene.hpp"

#include <arhost/shading/scalar.hpp>

#include <gtest/gtest.h>

#include <cmath>

namespace arhost::test {
namespace {

// Renders a square with a 2×2 texture, viewed upright from above. Its top row is red and green, its bottom row is
// blue and grey.
Picture of_four_texels(arhost_wrap wrap, float repeats, arhost_texel_format format = ARHOST_TEXEL_SRGB8) {
    SceneBuilder builder({.ambient = glm::vec3(1)});
    scene::TexelImage texture =
        texture_of(2, 2, {{255, 0, 0, 255}, {0, 255, 0, 255}, {0, 0, 255, 255}, {188, 188, 188, 255}});
    texture.format = format;
    arhost_material material = flat(1, 1, 1);
    material.colour_texture = builder.add_texture("four", std::move(texture), {.wrap_u = wrap, .wrap_v = wrap});
    scene::TriangleMesh mesh = square(60);
    const float n = repeats;
    mesh.texcoords = {{0, n}, {n, n}, {n, 0}, {0, 0}};
    builder.add_mesh("square", mesh, material);
    return Tracer(std::move(builder)).render(from_above());
}

// Whether the colours differ by at most 48 codes. The tolerance is for filtering: a pixel that is not exactly at the
// texel's centre also contains some of the neighbouring texels' colours.
bool is_nearly(const Pixel &pixel, const Pixel &colour) {
    return std::ranges::equal(pixel, colour, [](int a, int b) { return std::abs(a - b) <= 48; });
}

} // namespace

TEST(Texture, IsUprightAndLinearised) {
    const Picture picture = of_four_texels(ARHOST_WRAP_REPEAT, 1);
    EXPECT_TRUE(is_nearly(picture.at(70, 44), Pixel{255, 0, 0, 255}));
    EXPECT_TRUE(is_nearly(picture.at(130, 44), Pixel{0, 255, 0, 255}));
    EXPECT_TRUE(is_nearly(picture.at(70, 104), Pixel{0, 0, 255, 255}));
    EXPECT_NEAR(picture.at(130, 104)[0], 188, 3) << "sRGB texel, decoded and encoded again";
    EXPECT_NEAR(of_four_texels(ARHOST_WRAP_REPEAT, 1, ARHOST_TEXEL_RGBA8).at(130, 104)[0],
                shading::srgb8_exact(188 / 255.0), 3);
}

TEST(Texture, IsInterpolatedInLinearLight) {
    // This pixel is halfway between the red and the green texel.
    const Pixel mixed = of_four_texels(ARHOST_WRAP_CLAMP, 1).at(99, 30);
    EXPECT_NEAR(mixed[0], shading::srgb8_exact(0.5), 2);
    EXPECT_NEAR(mixed[1], shading::srgb8_exact(0.5), 2);
}

TEST(Texture, RepeatsClampsAndMirrors) {
    // Column 130 is in the left half of the third repetition, column 89 in the left half of the second.
    EXPECT_TRUE(is_nearly(of_four_texels(ARHOST_WRAP_REPEAT, 3).at(130, 24), Pixel{255, 0, 0, 255}));
    EXPECT_TRUE(is_nearly(of_four_texels(ARHOST_WRAP_CLAMP, 3).at(130, 24), Pixel{0, 255, 0, 255}));
    EXPECT_TRUE(is_nearly(of_four_texels(ARHOST_WRAP_MIRROR, 3).at(89, 24), Pixel{0, 255, 0, 255}));
}

TEST(Texture, MultipliesTheEmission) {
    SceneBuilder builder({.ambient = glm::vec3(0), .background = glm::vec3(0)});
    arhost_material material = metallic_roughness(glm::vec3(0), 1, 1);
    set3(material.emission, 0.5f, 1, 1);
    material.emission_texture = builder.add_texture("two", texture_of(2, 1, {{255, 0, 0, 255}, {0, 255, 0, 255}}));
    builder.add_mesh("screen", textured_square(60, 0), material);
    const Picture picture = Tracer(std::move(builder)).render(from_above());
    EXPECT_TRUE(is_nearly(picture.at(70, 74), Pixel{shading::srgb8_exact(0.5), 0, 0, 255}));
    EXPECT_TRUE(is_nearly(picture.at(130, 74), Pixel{0, 255, 0, 255}));
}

// ---- Alpha cutoff ----------------------------------------------------------------------------------

TEST(AlphaCutoff, CutOutTexelsWithAlphaBelowTheCutoff) {
    for (const bool instanced : {false, true}) {
        SceneBuilder builder({.ambient = glm::vec3(1)});
        const auto material = builder.add_material(half_a_hole(builder, 0.5f));
        const auto whole = builder.add_material(half_a_hole(builder, 0));
        const auto mesh = builder.add_triangles(textured_square(60, 0));
        // If `instanced`, the same mesh also occurs in a second object, lower and without a cutoff.
        const glm::mat4x3 lower(1, 0, 0, 0, 1, 0, 0, 0, 1, instanced ? 30 : 0, 0, -50);
        builder.add_object("holed", mesh, material, ARHOST_ROLE_VIRTUAL,
                           instanced ? glm::mat4x3(1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 5, 0) : glm::mat4x3(1));
        if (instanced)
            builder.add_object("whole", mesh, whole, ARHOST_ROLE_VIRTUAL, lower);
        const Picture picture = Tracer(std::move(builder)).render(from_above());
        EXPECT_EQ(picture.alpha(70, 74), 255);
        EXPECT_EQ(picture.alpha(130, 74), instanced ? 255 : 0) << "the opaque object is visible through the hole";
        if (!instanced) {
            EXPECT_EQ(picture.alpha(97, 74), 255) << "alpha is ½ halfway between the texels";
            EXPECT_EQ(picture.alpha(102, 74), 0);
        }
    }
}

TEST(AlphaCutoff, LetLightThrough) {
    SceneBuilder builder({.ambient = glm::vec3(0)});
    builder.add_light(light(0, 0, 1000, 1));
    builder.add_mesh("holed", textured_square(60, 100), half_a_hole(builder, 0.5f));
    builder.add_mesh("floor", square(300), flat(1, 1, 1), ARHOST_ROLE_CATCHER);
    const Picture picture = Tracer(std::move(builder)).render(camera({0, -40, 60}, {0, 0, 0}, {0, 1, 0}));
    EXPECT_EQ(picture.alpha(60, 60), 153) << "shadow of the solid half";
    EXPECT_EQ(picture.alpha(140, 60), 0) << "light through the hole";
}

TEST(AlphaCutoff, HolesInACatcherReceiveNoShadow) {
    SceneBuilder builder;
    builder.add_light(light(0, 0, 1000, 1));
    builder.add_mesh("roof", square(20, 300), flat(1, 1, 1));
    builder.add_mesh("floor", textured_square(60, 0), half_a_hole(builder, 0.5f), ARHOST_ROLE_CATCHER);
    const Picture picture = Tracer(std::move(builder)).render(from_above());
    EXPECT_EQ(picture.alpha(90, 74), 153);
    EXPECT_EQ(picture.alpha(110, 74), 0);
}

// ---- Normal textures -------------------------------------------------------------------------------

struct Tilt {
    glm::vec3 tangent_space; // the normal stored in the texture
    glm::vec3 world;         // the equivalent normal on the square
    bool mirrored = false;   // the texture coordinate u increases to the left
};

Picture lit_square(const Tilt &tilt, bool by_texture, bool turned) {
    SceneBuilder builder({.ambient = glm::vec3(0), .background = glm::vec3(0)});
    builder.add_light(sun(-0.6f, 0, -0.8f));
    arhost_material material = metallic_roughness(glm::vec3(0.6f), 0, 0.7f);
    scene::TriangleMesh mesh = textured_square(60, 0);
    if (tilt.mirrored)
        mesh.texcoords = {{1, 1}, {0, 1}, {0, 0}, {1, 0}};
    if (by_texture) {
        const glm::vec4 texel(0.5f * glm::normalize(tilt.tangent_space) + 0.5f, 1);
        material.normal_texture = builder.add_texture("tilt", float_texture_of(1, 1, {texel}));
    } else {
        mesh.normals.assign(4, glm::normalize(tilt.world));
    }
    glm::mat4x3 place(1);
    // Rotates by 90° about z and scales each axis differently. Tangents and normals therefore transform differently.
    if (turned)
        place = glm::mat4x3(0, 2, 0, -2, 0, 0, 0, 0, 0.5f, 0, 0, 0);
    builder.add_mesh("square", mesh, material, ARHOST_ROLE_VIRTUAL, place);
    return Tracer(std::move(builder)).render(from_above());
}

TEST(NormalTexture, MatchesEquivalentVertexNormals) {
    for (const Tilt &tilt :
         {Tilt{{0, 0, 1}, {0, 0, 1}}, Tilt{{0.6f, 0, 0.8f}, {0.6f, 0, 0.8f}}, Tilt{{0, 0.5f, 0.8f}, {0, 0.5f, 0.8f}},
          Tilt{{-0.3f, -0.5f, 0.8f}, {-0.3f, -0.5f, 0.8f}}, Tilt{{0.6f, 0.3f, 0.8f}, {-0.6f, 0.3f, 0.8f}, true}}) {
        const auto expected = lit_square(tilt, false, false).pixels(), got = lit_square(tilt, true, false).pixels();
        for (std::size_t i = 0; i < got.size(); ++i)
            for (std::size_t c = 0; c < 4; ++c)
                ASSERT_NEAR(got[i][c], expected[i][c], 1) << i;
    }
}

TEST(NormalTexture, RotatesWithItsObject) {
    // The rotated texture's right is world +y and its up is world −x. Unlike a vertex normal, the texture's normal is
    // applied in world space and is therefore not affected by the object's scaling.
    const Tilt tilt{{0, -0.6f, 0.8f}, {}};
    const auto turned = lit_square(tilt, true, true).pixels();
    const auto expected = lit_square({{0.6f, 0, 0.8f}, {}}, true, false).pixels();
    ASSERT_NEAR(turned[74 * 200 + 99][0], expected[74 * 200 + 99][0], 1);
    EXPECT_GT(turned[74 * 200 + 99][0], lit_square({{0, 0, 1}, {}}, true, true).pixels()[74 * 200 + 99][0] + 5);
}

// Returns the mean light that a plane of albedo 0.5 reflects in this environment.
template <class Colour> double light_from_a_plane(Colour colour) {
    SceneBuilder builder({.ambient = glm::vec3(0)});
    add_environment(builder, colour);
    builder.add_mesh("plane", square(200), diffuse(0.5f, 0.5f, 0.5f));
    double sum = 0;
    for (const Pixel &pixel : Tracer(std::move(builder), {{"light_samples", "256"}}).render(from_above()).pixels())
        sum += shading::srgb_decode(pixel[0] / 255.0);
    return sum / (200 * 150);
}

TEST(Environment, LightsADiffusePlaneByItsMean) {
    EXPECT_NEAR(light_from_a_plane([](std::uint32_t) { return glm::vec3(0.6f); }), 0.5 * 0.6, 0.003);
}

TEST(Environment, LightsByItsIrradianceWithFewBrightTexels) {
    // The expected value is kd/π ∫ L cos θ dω over one eighth of the hemisphere: 0.5/π · 4 · (2π/8) · ½ = 0.25.
    EXPECT_NEAR(light_from_a_plane([](std::uint32_t column) { return glm::vec3(column == 2 ? 4.0f : 0.0f); }), 0.25,
                0.004);
}

TEST(Environment, IsReflectedInTheRightDirection) {
    SceneBuilder builder;
    // The environment is blue towards +x and red towards −x.
    add_environment(builder, [](std::uint32_t x) { return x < 4 ? glm::vec3(1, 0, 0) : glm::vec3(0, 0, 1); });
    builder.add_ball("ball", {0, 0, 0, 60}, mirror(1));
    const Picture picture = Tracer(std::move(builder)).render(from_above());
    EXPECT_TRUE(is_nearly(picture.at(130, 74), Pixel{0, 0, 255, 255}));
    EXPECT_TRUE(is_nearly(picture.at(69, 74), Pixel{255, 0, 0, 255}));
}

TEST(Environment, CastsSoftShadowsOnCatchers) {
    SceneBuilder builder;
    add_environment(builder, [](std::uint32_t) { return glm::vec3(1); });
    builder.add_mesh("floor", square(80), diffuse(1, 1, 1), ARHOST_ROLE_CATCHER);
    builder.add_ball("ball", {0, 0, 12, 12}, diffuse(1, 0, 0));
    const Picture picture = Tracer(std::move(builder), {{"light_samples", "64"}}).render(from_the_side());
    int faint = 0;
    for (const auto &[alpha, count] : picture.alphas()) {
        EXPECT_TRUE(alpha <= 153 || alpha == 255) << alpha;
        faint += alpha > 0 && alpha < 60 ? count : 0;
    }
    EXPECT_GT(faint, 500);
}

} // namespace arhost::test
