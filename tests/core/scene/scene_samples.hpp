// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "scene/arena.hpp"

#include <filesystem>
#include <fstream>
#include <string_view>

namespace arhost::scene::test {

inline arhost_material grey() {
    arhost_material material = make_material(ARHOST_DIFFUSE);
    for (float &value : material.diffuse)
        value = 0.5f;
    return material;
}

inline arhost_light lamp() {
    arhost_light light = make_light(ARHOST_POINT_LIGHT);
    light.position[2] = 300;
    return light;
}

// A square of two triangles with normals and texcoords.
inline TriangleMesh square() {
    return {{{-10, -10, 5}, {10, -10, 5}, {10, 10, 5}, {-10, 10, 5}},
            std::vector<glm::vec3>(4, glm::vec3(0, 0, 1)),
            {{0, 0}, {1, 0}, {1, 1}, {0, 1}},
            {{0, 1, 2}, {0, 2, 3}}};
}

// Geometry 0: the square, geometry 1: a ball; a material, two objects, a light.
inline ArenaBuilder small_scene() {
    ArenaBuilder builder;
    const std::uint32_t material = builder.add_material(grey());
    builder.add_object("square", builder.add_triangles(square()), material);
    builder.add_object("ball", builder.add_spheres({{0, 0, 20, 7}}), material, ARHOST_CATCHER);
    builder.add_light(lamp());
    return builder;
}

// The elements of a buffer, to be read or spoilt.
template <class T> T *elements(Arena &arena, const arhost_buffer &buffer) {
    return reinterpret_cast<T *>(arena.bytes().data() + buffer.offset);
}

inline void write_file(const std::filesystem::path &path, std::string_view content) {
    std::ofstream(path, std::ios::binary) << content;
}

} // namespace arhost::scene::test
