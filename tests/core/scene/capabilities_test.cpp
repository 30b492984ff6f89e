// SPDX-License-Identifier: Apache-2.0
#include "scene/arena_builder.hpp"
#include "scene/capabilities.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <utility>

namespace arhost::scene {
namespace {

// A ball of this material.
ArenaBuilder ball(const arhost_material &material, arhost_role role = ARHOST_ROLE_VIRTUAL) {
    ArenaBuilder builder;
    builder.add_object("ball", builder.add_spheres({{0, 0, 0, 10}}), builder.add_material(material), role);
    return builder;
}

std::uint64_t needed(ArenaBuilder builder) {
    const Arena arena = std::move(builder).build();
    EXPECT_EQ(validate(arena.bytes()), "");
    return needed_capabilities(arena.scene());
}

TEST(Capabilities, DependOnTheModelsOfMaterials) {
    const std::pair<arhost_material_model, std::uint32_t> models[] = {
        {ARHOST_MATERIAL_DIFFUSE, 0},
        {ARHOST_MATERIAL_SPECULAR, ARHOST_RAYTRACER_CAPABILITY_REFLECTION},
        {ARHOST_MATERIAL_MIRROR, ARHOST_RAYTRACER_CAPABILITY_REFLECTION},
        {ARHOST_MATERIAL_METAL, ARHOST_RAYTRACER_CAPABILITY_REFLECTION},
        {ARHOST_MATERIAL_GLASS, ARHOST_RAYTRACER_CAPABILITY_GLASS},
        {ARHOST_MATERIAL_METALLIC_ROUGHNESS, ARHOST_RAYTRACER_CAPABILITY_ROUGHNESS}};
    for (const auto &[model, expected] : models) {
        EXPECT_EQ(needed(ball(make_material(model))), expected) << model;
        EXPECT_EQ(needed(ball(make_material(model), ARHOST_ROLE_CATCHER)), expected) << model;
        EXPECT_EQ(needed(ball(make_material(model), ARHOST_ROLE_OCCLUDER)), 0u) << model;
    }
}

TEST(Capabilities, IncludeRoughGlassWithThePathIntegrator) {
    arhost_material frosted = make_material(ARHOST_MATERIAL_GLASS);
    frosted.roughness = 0.5f;
    for (const auto &[integrator, expected] :
         {std::pair{ARHOST_INTEGRATOR_WHITTED, ARHOST_RAYTRACER_CAPABILITY_GLASS},
          std::pair{ARHOST_INTEGRATOR_PATH,
                    ARHOST_RAYTRACER_CAPABILITY_GLASS | ARHOST_RAYTRACER_CAPABILITY_ROUGHNESS}}) {
        ArenaBuilder builder = ball(frosted);
        builder.settings.integrator = integrator;
        EXPECT_EQ(needed(std::move(builder)), expected);
    }
}

TEST(Capabilities, IncludeOccludersThatMirrorsShow) {
    ArenaBuilder builder = ball(make_material(ARHOST_MATERIAL_MIRROR));
    builder.add_object("post", builder.add_spheres({{30, 0, 0, 10}}),
                       builder.add_material(make_material(ARHOST_MATERIAL_GLASS)), ARHOST_ROLE_OCCLUDER);
    EXPECT_EQ(needed(std::move(builder)), ARHOST_RAYTRACER_CAPABILITY_REFLECTION | ARHOST_RAYTRACER_CAPABILITY_GLASS);
}

TEST(Capabilities, IgnoreMaterialsThatNoObjectUses) {
    ArenaBuilder builder = ball(make_material(ARHOST_MATERIAL_DIFFUSE));
    builder.add_material(make_material(ARHOST_MATERIAL_GLASS));
    EXPECT_EQ(needed(std::move(builder)), 0u);
}

TexelImage texel(arhost_texel_format format, std::size_t size) {
    TexelImage texture{.format = format, .width = 1, .height = 1, .texels = Texels::of_size(size)};
    std::ranges::fill(texture.texels.span(), std::byte{0});
    return texture;
}

TEST(Capabilities, IncludeTextures) {
    ArenaBuilder builder;
    arhost_material material = make_material(ARHOST_MATERIAL_DIFFUSE);
    material.colour_texture = builder.add_texture("texel", texel(ARHOST_TEXEL_SRGB8, 4));
    const TriangleMesh mesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {}, {{0, 0}, {1, 0}, {0, 1}}, {{0, 1, 2}}};
    builder.add_object("triangle", builder.add_triangles(mesh), builder.add_material(material));
    EXPECT_EQ(needed(std::move(builder)), ARHOST_RAYTRACER_CAPABILITY_TEXTURES);
}

TEST(Capabilities, IncludeAreaLights) {
    for (const auto &[type, expected] :
         {std::pair{ARHOST_LIGHT_POINT, 0u},
          {ARHOST_LIGHT_DIRECTIONAL, 0u},
          {ARHOST_LIGHT_SPOT, 0u},
          {ARHOST_LIGHT_RECTANGLE, std::uint64_t{ARHOST_RAYTRACER_CAPABILITY_AREA_LIGHTS}},
          {ARHOST_LIGHT_SPHERE, std::uint64_t{ARHOST_RAYTRACER_CAPABILITY_AREA_LIGHTS}}}) {
        ArenaBuilder builder;
        builder.add_light(make_light(type));
        EXPECT_EQ(needed(std::move(builder)), expected) << type;
    }
}

TEST(Capabilities, IncludeTheEnvironment) {
    ArenaBuilder builder;
    builder.environment.texture = builder.add_texture("texel", texel(ARHOST_TEXEL_RGBA32F, 16));
    builder.environment.rows = builder.environment.columns = {1};
    EXPECT_EQ(needed(std::move(builder)), ARHOST_RAYTRACER_CAPABILITY_ENVIRONMENT);
}

TEST(Capabilities, IncludeMotionOnlyOfAnimatedScenes) {
    for (const float duration_s : {0.0f, 1.0f}) {
        ArenaBuilder builder;
        builder.settings.duration_s = duration_s;
        MotionNode node;
        node.animated = true;
        Motion motion;
        motion.moves = true;
        motion.node = builder.add_node(node);
        builder.add_object("ball", builder.add_spheres({{0, 0, 0, 10}}),
                           builder.add_material(make_material(ARHOST_MATERIAL_DIFFUSE)), ARHOST_ROLE_VIRTUAL,
                           glm::mat4x3(1), motion);
        const Arena arena = std::move(builder).build();
        EXPECT_EQ(needed_capabilities(arena.scene()), duration_s > 0 ? ARHOST_RAYTRACER_CAPABILITY_MOTION : 0);
    }
}

TEST(Capabilities, EverySceneHasABitForEachPart) {
    std::uint64_t all = 0;
    for (std::uint64_t bit = ARHOST_RAYTRACER_CAPABILITY_REFLECTION; bit <= ARHOST_RAYTRACER_CAPABILITY_MOTION;
         bit <<= 1) {
        EXPECT_NE(missing_capabilities_text("rt", bit), "");
        all |= bit;
    }
    EXPECT_EQ(ARHOST_RAYTRACER_CAPABILITY_EVERY_SCENE, all);
}

TEST(Capabilities, TheWarningNamesThePluginAndTheParts) {
    EXPECT_EQ(
        missing_capabilities_text("rt_small", ARHOST_RAYTRACER_CAPABILITY_GLASS | ARHOST_RAYTRACER_CAPABILITY_MOTION),
        "rt_small does not support parts of the scene: glass, motion. The image will lack them; use another "
        "ray tracer or a simpler scene");
    EXPECT_EQ(missing_capabilities_text("rt_small", ARHOST_RAYTRACER_CAPABILITY_LENS_DISTORTION), "");
}

TEST(Capabilities, AnInstanceMayHaveFewerThanItsDescriptor) {
    arhost_descriptor descriptor{};
    descriptor.capabilities = ARHOST_RAYTRACER_CAPABILITY_EVERY_SCENE;
    arhost_raytracer functions{};
    functions.struct_size = sizeof functions;
    EXPECT_EQ(capabilities_of(descriptor, functions, nullptr), ARHOST_RAYTRACER_CAPABILITY_EVERY_SCENE);
    functions.capabilities = [](arhost_instance *) { return std::uint64_t{ARHOST_RAYTRACER_CAPABILITY_GLASS}; };
    EXPECT_EQ(capabilities_of(descriptor, functions, nullptr), ARHOST_RAYTRACER_CAPABILITY_GLASS);
    functions.struct_size = offsetof(arhost_raytracer, capabilities); // built against an older header
    EXPECT_EQ(capabilities_of(descriptor, functions, nullptr), ARHOST_RAYTRACER_CAPABILITY_EVERY_SCENE);
}

} // namespace
} // namespace arhost::scene
