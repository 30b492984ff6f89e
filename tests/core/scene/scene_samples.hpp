// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "scene/arena_builder.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string_view>
#include <utility>

namespace arhost::scene::test {

inline arhost_material grey() {
    arhost_material material = make_material(ARHOST_MATERIAL_DIFFUSE);
    for (float &value : material.diffuse)
        value = 0.5f;
    return material;
}

inline arhost_light lamp() {
    arhost_light light = make_light(ARHOST_LIGHT_POINT);
    light.position[2] = 300;
    return light;
}

// Returns a square of two triangles with normals and texture coordinates.
inline TriangleMesh square() {
    return {{{-10, -10, 5}, {10, -10, 5}, {10, 10, 5}, {-10, 10, 5}},
            std::vector<glm::vec3>(4, glm::vec3(0, 0, 1)),
            {{0, 0}, {1, 0}, {1, 1}, {0, 1}},
            {{0, 1, 2}, {0, 2, 3}}};
}

// Returns a scene with two geometries (0: the square, 1: a ball), one material, two objects and one light.
inline ArenaBuilder small_scene() {
    ArenaBuilder builder;
    const std::uint32_t material = builder.add_material(grey());
    builder.add_object("square", builder.add_triangles(square()), material);
    builder.add_object("ball", builder.add_spheres({{0, 0, 20, 7}}), material, ARHOST_ROLE_CATCHER);
    builder.add_light(lamp());
    return builder;
}

// Returns an image with a uniform colour.
inline TexelImage plain_image(arhost_texel_format format, std::uint32_t width, std::uint32_t height) {
    TexelImage image{format, width, height, {}};
    if (format == ARHOST_TEXEL_RGBA32F) {
        image.texels = Texels::of_size(std::size_t(width) * height * 16);
        std::ranges::fill(std::span(reinterpret_cast<float *>(image.texels.bytes.get()), 4 * width * height), 0.5f);
    } else {
        image.texels = Texels::of_size(std::size_t(width) * height * 4);
        std::ranges::fill(image.texels.span(), std::byte(200));
    }
    return image;
}

// Returns the square with its left side bound to joint 0, its right side bound to joint 1, and a morph target that
// raises the square by 1 mm.
inline TriangleMesh bending_square() {
    TriangleMesh mesh = square();
    mesh.joints = {{0, 0, 0, 0}, {1, 0, 0, 0}, {1, 0, 0, 0}, {0, 0, 0, 0}};
    mesh.weights.assign(4, glm::vec4(1, 0, 0, 0));
    mesh.morph_positions.assign(4, glm::vec3(0, 0, 1));
    mesh.morph_normals.assign(4, glm::vec3(0));
    return mesh;
}

// Uses every feature of an arena. Objects: 0 'square', textured; 1 'ball', moves with node 0; 2 'bend',
// deformed by skin 0, whose joints are nodes 0 and 1. Textures: 0 has bytes; 1 has floats and is the environment.
// Channels: translation, rotation and scale of node 0, and morph weights of node 2. Node 3 is an anchor.
inline ArenaBuilder full_scene() {
    ArenaBuilder builder;
    builder.settings.duration_s = 2;
    arhost_material textured = make_material(ARHOST_MATERIAL_METALLIC_ROUGHNESS);
    textured.colour_texture =
        builder.add_texture("wood.png", plain_image(ARHOST_TEXEL_SRGB8, 2, 3), {.wrap_v = ARHOST_WRAP_CLAMP});
    builder.environment.texture =
        builder.add_texture("sky.hdr", plain_image(ARHOST_TEXEL_RGBA32F, 2, 2), {.wrap_v = ARHOST_WRAP_CLAMP});
    builder.environment.rows = {0.5f, 1};
    builder.environment.columns = {0.5f, 1, 0.25f, 1};
    const std::uint32_t material = builder.add_material(textured), plain = builder.add_material(grey());
    MotionNode moving;
    moving.animated = true;
    MotionNode child;
    child.parent = builder.add_node(moving);
    MotionNode weighted;
    weighted.morph_weights = {0};
    builder.add_node(child);
    builder.add_node(weighted);
    builder.add_channel({0, ARHOST_CHANNEL_TRANSLATION, ARHOST_INTERPOLATION_LINEAR, {0, 2}, {0, 0, 0, 10, 0, 0}});
    builder.add_channel({0, ARHOST_CHANNEL_ROTATION, ARHOST_INTERPOLATION_STEP, {0, 1}, {0, 0, 0, 1, 0, 0, 1, 0}});
    builder.add_channel({0, ARHOST_CHANNEL_SCALE, ARHOST_INTERPOLATION_LINEAR, {0}, {1, 1, 1}});
    builder.add_channel({2, ARHOST_CHANNEL_MORPH_WEIGHTS, ARHOST_INTERPOLATION_CUBIC, {0, 2}, {0, 0, 0, 0, 1, 0}});
    const std::uint32_t skin = builder.add_skin({{0, 1}, {glm::mat4x3(1), glm::mat4x3(1)}});
    builder.add_object("square", builder.add_triangles(square()), material);
    builder.add_object("ball", builder.add_spheres({{0, 0, 20, 7}}), plain, ARHOST_ROLE_CATCHER, glm::mat4x3(1),
                       {true, false, 0, ARHOST_NONE});
    builder.add_object("bend", builder.add_triangles(bending_square()), plain, ARHOST_ROLE_VIRTUAL, glm::mat4x3(1),
                       {false, true, 2, skin});
    builder.add_light(lamp());
    builder.add_anchor("cup");
    return builder;
}

// Returns the elements of a buffer.
template <class T> T *elements(Arena &arena, const arhost_buffer &buffer) {
    return reinterpret_cast<T *>(arena.bytes().data() + buffer.offset);
}
template <class T> const T *elements(const Arena &arena, const arhost_buffer &buffer) {
    return reinterpret_cast<const T *>(arena.bytes().data() + buffer.offset);
}
inline const arhost_material &material(const Arena &a, std::size_t i = 0) {
    return elements<arhost_material>(a, a.scene().materials)[i];
}
inline const arhost_object &object(const Arena &a, std::size_t i = 0) {
    return elements<arhost_object>(a, a.scene().objects)[i];
}
inline const arhost_geometry &geometry(const Arena &a, std::size_t i = 0) {
    return elements<arhost_geometry>(a, a.scene().geometries)[i];
}
inline const arhost_texel_image &image(const Arena &a, std::size_t i = 0) {
    return elements<arhost_texel_image>(a, a.scene().images)[i];
}
inline const arhost_texture &texture(const Arena &a, std::size_t i = 0) {
    return elements<arhost_texture>(a, a.scene().textures)[i];
}
inline const char *name(const Arena &a, std::size_t i = 0) {
    return elements<char>(a, a.scene().names) + object(a, i).name;
}

// Builds a scene, which must be valid.
inline Arena build(ArenaBuilder builder) {
    Arena arena = std::move(builder).build();
    EXPECT_EQ(validate(arena.bytes()), "");
    return arena;
}

inline void write_file(const std::filesystem::path &path, std::string_view content) {
    std::ofstream(path, std::ios::binary) << content;
}

} // namespace arhost::scene::test
