// SPDX-License-Identifier: Apache-2.0
//
// Builds textures, environments, materials with an alpha cutoff, and a scene that combines all features.
#pragma once

#include "scene/image.hpp"
#include "tracer.hpp"

namespace arhost::test {

inline scene::TexelImage texture_of(std::uint32_t width, std::uint32_t height, const std::vector<Pixel> &pixels) {
    scene::TexelImage texture;
    texture.width = width;
    texture.height = height;
    texture.texels.size = 4 * pixels.size();
    texture.texels.bytes = std::make_unique<std::byte[]>(texture.texels.size);
    for (std::size_t i = 0; i < pixels.size(); ++i)
        for (std::size_t c = 0; c < 4; ++c)
            texture.texels.bytes[4 * i + c] = static_cast<std::byte>(pixels[i][c]);
    return texture;
}

// Returns an image of floating-point texels.
inline scene::TexelImage float_texture_of(std::uint32_t width, std::uint32_t height,
                                          const std::vector<glm::vec4> &texels) {
    scene::TexelImage texture;
    texture.format = ARHOST_TEXEL_RGBA32F;
    texture.width = width;
    texture.height = height;
    texture.texels.size = texels.size() * sizeof(glm::vec4);
    texture.texels.bytes = std::make_unique<std::byte[]>(texture.texels.size);
    std::memcpy(texture.texels.bytes.get(), texels.data(), texture.texels.size);
    return texture;
}

// Adds an environment map of 8×4 texels. `colour(column)` returns the colour of a column's texels.
template <class Colour> void add_environment(SceneBuilder &builder, Colour colour) {
    std::vector<glm::vec4> texels;
    for (std::uint32_t i = 0; i < 8 * 4; ++i)
        texels.emplace_back(colour(i % 8), 1);
    scene::TexelImage texture = float_texture_of(8, 4, texels);
    scene::Environment environment;
    scene::add_cumulative_sums(environment, texture, scene::Reporter({}, "sky"));
    environment.texture = builder.add_texture("sky", std::move(texture), {.wrap_v = ARHOST_WRAP_CLAMP});
    environment.environment_from_world = glm::mat3(1, 0, 0, 0, 0, -1, 0, 1, 0); // the map's up direction is world +z
    builder.environment = std::move(environment);
}

// Returns a material whose texture is opaque on the left half and transparent on the right half.
inline arhost_material half_a_hole(SceneBuilder &builder, float cutoff) {
    scene::TexelImage texture = texture_of(2, 1, {{255, 255, 255, 255}, {255, 255, 255, 0}});
    arhost_material material = flat(1, 1, 1);
    material.colour_texture =
        builder.add_texture("half", std::move(texture), {.wrap_u = ARHOST_WRAP_CLAMP, .wrap_v = ARHOST_WRAP_CLAMP});
    material.alpha_cutoff = cutoff;
    return material;
}
inline scene::TriangleMesh textured_square(float half_side, float z) {
    scene::TriangleMesh mesh = square(half_side, z);
    mesh.texcoords = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
    return mesh;
}

// A ball of flat facets of 15°, with the normals of the ball.
inline scene::TriangleMesh coarse_ball(float radius) {
    constexpr int stacks = 12, slices = 24;
    scene::TriangleMesh mesh;
    for (int stack = 0; stack <= stacks; ++stack)
        for (int slice = 0; slice < slices; ++slice) {
            const double theta = std::numbers::pi * stack / stacks, phi = 2 * std::numbers::pi * slice / slices;
            mesh.normals.emplace_back(std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi),
                                      std::cos(theta));
            mesh.positions.push_back(mesh.normals.back() * radius);
        }
    for (std::uint32_t stack = 0; stack < stacks; ++stack)
        for (std::uint32_t slice = 0; slice < slices; ++slice) {
            const std::uint32_t next = (slice + 1) % slices, above = stack * slices, below = above + slices;
            mesh.triangles.push_back({above + slice, below + slice, above + next});
            mesh.triangles.push_back({above + next, below + slice, below + next});
        }
    return mesh;
}

// Returns a scene that exercises random numbers, ray queues, textures and transcendental functions.
inline SceneBuilder rich_scene() {
    SceneBuilder builder({.max_depth = 6, .coloured_shadows = true});
    add_environment(builder, [](std::uint32_t column) {
        return glm::vec3(0.1f * static_cast<float>(column), 0.3f, 0.8f - 0.1f * static_cast<float>(column));
    });
    arhost_light lamp = bulb({-60, -20, 200}, 30);
    set3(lamp.intensity, 0.6f, 0.5f, 0.4f);
    builder.add_light(lamp);
    arhost_light bluish = panel({60, 40, 150}, {20, 30}, 0.2f);
    bluish.intensity[2] = 0.3f;
    builder.add_light(bluish);
    builder.add_mesh("desk", square(90), flat(0.7f, 0.6f, 0.5f), ARHOST_ROLE_CATCHER);
    arhost_material glass = glass_of(1.5f);
    set3(glass.extinction, 0.02f, 0.005f, 0.01f);
    set3(glass.shadow_attenuation, 0.4f, 0.7f, 0.4f);
    builder.add_ball("glass", {-25, 0, 25, 20}, glass);
    arhost_material rough = metallic_roughness({0.9f, 0.7f, 0.4f}, 0.8f, 0.35f);
    rough.normal_texture = builder.add_texture(
        "bumps",
        texture_of(2, 2, {{128, 128, 255, 255}, {160, 128, 250, 255}, {128, 160, 250, 255}, {100, 110, 240, 255}}));
    const glm::mat4x3 upright(1, 0, 0, 0, 0.3f, 1, 0, -1, 0.3f, 30, 20, 26);
    builder.add_mesh("rough", textured_square(25, 0), rough, ARHOST_ROLE_VIRTUAL, upright);
    const arhost_material plastic = metallic_roughness({0.3f, 0.5f, 0.8f}, 0, 0.2f);
    builder.add_mesh("smooth", coarse_ball(12), plastic, ARHOST_ROLE_VIRTUAL,
                     glm::mat4x3(1, 0, 0, 0, 1, 0, 0, 0, 1.3f, 10, -40, 16));
    builder.add_mesh("holed", textured_square(15, 60), half_a_hole(builder, 0.5f));
    return builder;
}

// Returns the instruction sets, besides "base", with which rt_embree can trace on this processor.
inline std::vector<std::string> instruction_sets() {
    std::vector<std::string> sets;
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2"))
        sets.emplace_back("avx2");
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
        __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl"))
        sets.emplace_back("avx512");
#endif
    return sets;
}

// Checks that changed options have the same effect on a running plugin as on a new one.
inline void expect_changed_options_apply(const std::string &plugin, const Options &options,
                                         const arhost_intrinsics &intrinsics) {
    const arhost_camera view = from_the_side(intrinsics);
    Tracer tracer(rich_scene(), options, plugin);
    ASSERT_EQ(tracer.start(intrinsics), ARHOST_STATUS_OK) << tracer.log();
    Picture picture(intrinsics); // its memory remains the same
    ASSERT_EQ(tracer.try_render(view, picture), ARHOST_STATUS_OK);
    Options changed = options;
    for (const auto &[key, value] : {std::pair{"samples", "3"}, {"light_samples", "2"}, {"samples", "1"}}) {
        changed[key] = value;
        ASSERT_EQ(tracer.plugin().set_text(key, value), ARHOST_STATUS_OK) << tracer.log();
        ASSERT_EQ(tracer.try_render(view, picture), ARHOST_STATUS_OK) << tracer.log();
        EXPECT_EQ(picture.pixels(), Tracer(rich_scene(), changed, plugin).render(view).pixels())
            << key << " " << value;
    }
}

} // namespace arhost::test
