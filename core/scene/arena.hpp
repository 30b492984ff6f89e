// SPDX-License-Identifier: Apache-2.0
//
// Writes and checks the arena of arhost/scene.h.
#pragma once

#include <arhost/scene.h>

#include <glm/mat4x3.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <span>
#include <string>
#include <variant>
#include <vector>

namespace arhost::scene {

// No coordinate may be larger, so that no ray tracer's arithmetic overflows.
inline constexpr float coordinate_limit_mm = 1e9f;
inline constexpr std::uint32_t max_depth_limit = 100;

struct TriangleMesh {
    std::vector<glm::vec3> positions;
    std::vector<glm::vec3> normals;   // one a vertex, unit length, or none: flat
    std::vector<glm::vec2> texcoords; // one a vertex, or none
    std::vector<glm::uvec3> triangles;
};

using Spheres = std::vector<glm::vec4>; // centre and radius

// A material with a field's customary value in each, black but for glass and mirrors; without textures.
arhost_material make_material(arhost_material_model model);
// A white light at the origin, its direction down −z; one with an extent measures 1 mm.
arhost_light make_light(arhost_light_type type);

struct Settings {
    arhost_axes axes = ARHOST_Z_UP;
    std::uint32_t max_depth = 5;
    glm::vec3 ambient{0.2f}, background{1}; // linear light
    float shadow_alpha_opaque = 0.6f, shadow_alpha_translucent = 0.3f;
    bool coloured_shadows = false;
};

// 64-byte aligned memory that holds an arena.
class Arena {
public:
    explicit Arena(std::size_t byte_size);
    std::span<std::byte> bytes() { return {bytes_.get(), size_}; }
    std::span<const std::byte> bytes() const { return {bytes_.get(), size_}; }
    const arhost_scene &scene() const { return *reinterpret_cast<const arhost_scene *>(bytes_.get()); }

private:
    struct Free {
        void operator()(std::byte *p) const { std::free(p); }
    };
    std::size_t size_;
    std::unique_ptr<std::byte, Free> bytes_;
};

// Collects a scene, then writes it as one arena:
//
//   ArenaBuilder builder;
//   builder.add_object("ball", builder.add_spheres({{0, 0, 20, 20}}), builder.add_material(red));
//   Arena arena = std::move(builder).build();
//
// It does not judge what it is given; `validate` does.
class ArenaBuilder {
public:
    Settings settings;

    // Each returns the index of what was added.
    std::uint32_t add_triangles(TriangleMesh mesh);
    std::uint32_t add_spheres(Spheres spheres);
    std::uint32_t add_material(const arhost_material &material);
    std::uint32_t add_object(const std::string &name, std::uint32_t geometry, std::uint32_t material,
                             arhost_role role = ARHOST_VIRTUAL,
                             const glm::mat4x3 &world_from_object = glm::mat4x3(1));
    std::uint32_t add_light(const arhost_light &light);

    std::size_t byte_size() const;

    // Writes into memory of the caller: byte_size() bytes at a multiple of 64. Frees each mesh once it is
    // written, so that no two are held twice.
    void write(std::span<std::byte> arena) &&;
    Arena build() &&;

    std::size_t object_count() const { return objects_.size(); }
    std::size_t triangle_count() const;

private:
    using Geometry = std::variant<TriangleMesh, Spheres>;

    std::vector<Geometry> geometries_;
    std::vector<arhost_material> materials_;
    std::vector<arhost_object> objects_;
    std::vector<arhost_light> lights_;
    std::string names_;
};

// What is wrong with an arena that another process wrote, as the end of a sentence about the scene
// ("object 2 'ball' has material 7, but there are 3"); empty where nothing is. Every offset, count, index,
// enumeration and number is checked before it is used, so a ray tracer may use all of them unchecked
// afterwards, provided that nobody can write the arena any more. Takes time in proportion to the arena's
// size, whatever stands in it.
std::string validate(std::span<const std::byte> arena);

} // namespace arhost::scene
