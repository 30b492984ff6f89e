// SPDX-License-Identifier: Apache-2.0
//
// Tests textures and environments.
#include "rich_scene.hpp"

#include <arhost/shading/scalar.hpp>

#include <gtest/gtest.h>

#include <cmath>

namespace arhost::test {
namespace {

using scene::ArenaBuilder;

// Renders a square with a 2×2 texture, viewed upright from above. Its top row is red and green, its bottom row is
// blue and grey.
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

// Whether the colours differ by at most 48 codes. The tolerance is for filtering: a pixel that is not exactly at the
// texel's centre also contains some of the neighbouring texels' colours.
bool is_nearly(const Pixel &pixel, const Pixel &colour) {
    for (std::size_t c = 0; c < 4; ++c)
        if (std::abs(pixel[c] - colour[c]) > 48)
            return false;
    return true;
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
    ArenaBuilder builder;
    builder.settings.ambient = glm::vec3(0);
    arhost_material material = scene::make_material(ARHOST_MATERIAL_METALLIC_ROUGHNESS);
    set3(material.emission, 0.5f, 1, 1);
    material.emission_texture = builder.add_texture("two", texture_of(2, 1, {{255, 0, 0, 255}, {0, 255, 0, 255}}));
    scene::TriangleMesh mesh = square(60);
    mesh.texcoords = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
    builder.add_object("screen", builder.add_triangles(std::move(mesh)), builder.add_material(material));
    builder.settings.background = glm::vec3(0);
    const Picture picture = Tracer(std::move(builder)).render(from_above());
    EXPECT_TRUE(is_nearly(picture.at(70, 74), Pixel{shading::srgb8_exact(0.5), 0, 0, 255}));
    EXPECT_TRUE(is_nearly(picture.at(130, 74), Pixel{0, 255, 0, 255}));
}

// ---- Alpha cutoff ----------------------------------------------------------------------------------

TEST(AlphaCutoff, CutOutTexelsWithAlphaBelowTheCutoff) {
    for (const bool instanced : {false, true}) {
        ArenaBuilder builder;
        builder.settings.ambient = glm::vec3(1);
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
    ArenaBuilder builder;
    builder.settings.ambient = glm::vec3(0);
    builder.add_light(light(0, 0, 1000, 1));
    const auto material = builder.add_material(half_a_hole(builder, 0.5f));
    builder.add_object("holed", builder.add_triangles(textured_square(60, 100)), material);
    builder.add_object("floor", builder.add_triangles(square(300)), builder.add_material(flat(1, 1, 1)),
                       ARHOST_ROLE_CATCHER);
    const Picture picture = Tracer(std::move(builder)).render(camera({0, -40, 60}, {0, 0, 0}, {0, 1, 0}));
    EXPECT_EQ(picture.alpha(60, 60), 153) << "shadow of the solid half";
    EXPECT_EQ(picture.alpha(140, 60), 0) << "light through the hole";
}

TEST(AlphaCutoff, HolesInACatcherReceiveNoShadow) {
    ArenaBuilder builder;
    builder.add_light(light(0, 0, 1000, 1));
    builder.add_object("roof", builder.add_triangles(square(20, 300)), builder.add_material(flat(1, 1, 1)));
    builder.add_object("floor", builder.add_triangles(textured_square(60, 0)),
                       builder.add_material(half_a_hole(builder, 0.5f)), ARHOST_ROLE_CATCHER);
    const Picture picture = Tracer(std::move(builder)).render(from_above());
    EXPECT_EQ(picture.alpha(90, 74), 153);
    EXPECT_EQ(picture.alpha(110, 74), 0);
}

// ---- Combined features -----------------------------------------------------------------------------

TEST(RichScene, IsIdenticalForAnyThreadCountAndRepeatedly) {
    for (const char *mode : {"tree", "path"}) {
        Tracer one(rich_scene(), {{"threads", "1"}, {"samples", "2"}, {"glass", mode}}),
            three(rich_scene(), {{"threads", "3"}, {"samples", "2"}, {"glass", mode}});
        const auto expected = one.render(from_the_side()).pixels();
        EXPECT_TRUE(three.render(from_the_side()).pixels() == expected) << mode;
        EXPECT_TRUE(three.render(from_the_side()).pixels() == expected) << mode;
    }
}

TEST(RichScene, IsIdenticalForEveryInstructionSet) {
#if defined(__x86_64__)
    const auto base = Tracer(rich_scene(), {{"instruction_set", "base"}}).render(from_the_side()).pixels();
    if (__builtin_cpu_supports("avx2")) {
        EXPECT_TRUE(Tracer(rich_scene(), {{"instruction_set", "avx2"}}).render(from_the_side()).pixels() == base);
    }
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) // those builds have no AVX-512
    if (__builtin_cpu_supports("avx512dq")) {
        EXPECT_TRUE(Tracer(rich_scene(), {{"instruction_set", "avx512"}}).render(from_the_side()).pixels() == base);
    }
#endif
#endif
}

// ---- Normal textures -------------------------------------------------------------------------------

struct Tilt {
    glm::vec3 tangent_space; // the normal stored in the texture
    glm::vec3 world;         // the equivalent normal on the square
    bool mirrored = false;   // the texture coordinate u increases to the left
};

Picture lit_square(const Tilt &tilt, bool by_texture, bool turned) {
    ArenaBuilder builder;
    builder.settings.ambient = glm::vec3(0);
    builder.settings.background = glm::vec3(0);
    arhost_light sun = scene::make_light(ARHOST_LIGHT_DIRECTIONAL);
    set3(sun.direction, -0.6f, 0, -0.8f);
    builder.add_light(sun);
    arhost_material material = scene::make_material(ARHOST_MATERIAL_METALLIC_ROUGHNESS);
    set3(material.diffuse, 0.6f, 0.6f, 0.6f);
    material.metallic = 0;
    material.roughness = 0.7f;
    scene::TriangleMesh mesh = textured_square(60, 0);
    if (tilt.mirrored)
        mesh.texcoords = {{1, 1}, {0, 1}, {0, 0}, {1, 0}};
    if (by_texture) {
        scene::Texture texture;
        texture.format = ARHOST_TEXEL_RGBA32F;
        texture.width = texture.height = 1;
        const glm::vec3 t = 0.5f * glm::normalize(tilt.tangent_space) + 0.5f;
        const float texel[4] = {t.x, t.y, t.z, 1};
        texture.texels.size = sizeof texel;
        texture.texels.bytes = std::make_unique<std::byte[]>(sizeof texel);
        std::memcpy(texture.texels.bytes.get(), texel, sizeof texel);
        material.normal_texture = builder.add_texture("tilt", std::move(texture));
    } else {
        mesh.normals.assign(4, glm::normalize(tilt.world));
    }
    glm::mat4x3 place(1);
    // Rotates by 90° about z and scales each axis differently. Tangents and normals therefore transform differently.
    if (turned)
        place = glm::mat4x3(0, 2, 0, -2, 0, 0, 0, 0, 0.5f, 0, 0, 0);
    builder.add_object("square", builder.add_triangles(std::move(mesh)), builder.add_material(material),
                       ARHOST_ROLE_VIRTUAL, place);
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

TEST(Environment, LightsByItsIrradianceWithFewBrightTexels) {
    ArenaBuilder builder;
    builder.settings.ambient = glm::vec3(0);
    add_environment(builder, [](std::uint32_t column) { return glm::vec3(column == 2 ? 4.0f : 0.0f); });
    builder.add_object("plane", builder.add_triangles(square(200)), builder.add_material(diffuse(0.5f, 0.5f, 0.5f)));
    const Picture picture = Tracer(std::move(builder), {{"light_samples", "256"}}).render(from_above());
    // The expected value is kd/π ∫ L cos θ dω over one eighth of the hemisphere: 0.5/π · 4 · (2π/8) · ½ = 0.25.
    double sum = 0;
    for (const Pixel &pixel : picture.pixels())
        sum += shading::srgb_decode(pixel[0] / 255.0);
    EXPECT_NEAR(sum / static_cast<double>(picture.pixels().size()), 0.25, 0.004);
}

TEST(Environment, IsReflectedInTheRightDirection) {
    ArenaBuilder builder;
    // The environment is blue towards +x and red towards −x.
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
                       ARHOST_ROLE_CATCHER);
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
