// SPDX-License-Identifier: Apache-2.0
//
// Writes and checks the arena of arhost/scene.h. Needs no library that parses anything: the host uses it.
#pragma once

#include <arhost/scene.h>

#include <glm/gtc/type_precision.hpp>
#include <glm/mat3x3.hpp>
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
inline constexpr std::size_t arena_alignment = 64, arena_spare_bytes = 16; // of and behind each buffer, by scene.h
inline constexpr std::uint32_t max_depth_limit = 100;
inline constexpr std::uint32_t texture_side_limit = 16384;
inline constexpr float radiance_limit = 1e6f;   // of texels and of what is given off
inline constexpr float duration_limit_s = 1e6f; // floats tell 1/16 s apart there

struct TriangleMesh {
    std::vector<glm::vec3> positions;
    std::vector<glm::vec3> normals;   // one a vertex, unit length, or none: flat
    std::vector<glm::vec2> texcoords; // one a vertex, or none
    std::vector<glm::uvec3> triangles;
    // Of one that deforms, as arhost_geometry has them; else none.
    std::vector<glm::u16vec4> joints{};
    std::vector<glm::vec4> weights{};
    std::vector<glm::vec3> morph_positions{}, morph_normals{};
};

using Spheres = std::vector<glm::vec4>; // centre and radius

// A material with a field's customary value in each, black but for glass and mirrors; without textures.
arhost_material make_material(arhost_material_model model);
// A white light at the origin, its direction down −z; one with an extent measures 1 mm.
arhost_light make_light(arhost_light_type type);

// Memory that is neither zeroed nor copied: a texture may have a gigabyte.
struct Texels {
    std::unique_ptr<std::byte[]> bytes;
    std::size_t size = 0;

    static Texels of_size(std::size_t size) { return {std::make_unique_for_overwrite<std::byte[]>(size), size}; }
    std::span<std::byte> span() const { return {bytes.get(), size}; }
};

struct Texture {
    arhost_texel_format format = ARHOST_TEXEL_SRGB8;
    std::uint32_t width = 0, height = 0;
    arhost_wrap wrap_u = ARHOST_WRAP_REPEAT, wrap_v = ARHOST_WRAP_REPEAT;
    Texels texels;
};

struct Environment {
    std::uint32_t texture = ARHOST_NONE;
    float intensity = 1;
    glm::mat3 environment_from_world{1};
    std::vector<float> rows, columns; // cumulative sums
};

// A place without animation: parent_from_node. With one, the other three stand for it.
struct MotionNode {
    std::uint32_t parent = ARHOST_NONE;
    bool animated = false;
    glm::mat4x3 parent_from_node{1};
    glm::vec3 translation{0};
    glm::vec4 rotation{0, 0, 0, 1}; // x, y, z, w
    glm::vec3 scale{1};
    std::vector<float> morph_weights;
};

struct Channel {
    std::uint32_t node = 0;
    arhost_channel_target target = ARHOST_CHANNEL_TRANSLATION;
    arhost_interpolation interpolation = ARHOST_INTERPOLATION_LINEAR;
    std::vector<float> times, values;
};

struct Skin {
    std::vector<std::uint32_t> joints;
    std::vector<glm::mat4x3> node_from_mesh;
};

// How an object moves: with a node, by a skin's joints, or not at all.
struct Motion {
    bool moves = false, deforms = false;
    std::uint32_t node = ARHOST_NONE, skin = ARHOST_NONE;
};

struct Settings {
    arhost_axes axes = ARHOST_AXES_Z_UP;
    std::uint32_t max_depth = 5;
    glm::vec3 ambient{0.2f}, background{1}; // linear light
    float shadow_alpha_opaque = 0.6f, shadow_alpha_translucent = 0.3f;
    bool coloured_shadows = false;
    float duration_s = 0;
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
    Environment environment;

    // Each returns the index of what was added.
    std::uint32_t add_triangles(TriangleMesh mesh);
    std::uint32_t add_spheres(Spheres spheres);
    std::uint32_t add_texture(const std::string &name, Texture texture);
    std::uint32_t add_material(const arhost_material &material);
    std::uint32_t add_object(const std::string &name, std::uint32_t geometry, std::uint32_t material,
                             arhost_role role = ARHOST_ROLE_VIRTUAL,
                             const glm::mat4x3 &world_from_object = glm::mat4x3(1), const Motion &motion = {});
    std::uint32_t add_light(const arhost_light &light);
    std::uint32_t add_node(MotionNode node);
    std::uint32_t add_channel(Channel channel);
    std::uint32_t add_skin(Skin skin);

    std::size_t byte_size() const;

    // Writes into memory of the caller: byte_size() bytes at a multiple of 64. Frees each mesh and texture
    // once it is written, so that no two are held twice. Where things move, they are put where they are at
    // time 0: then what was added must be valid.
    void write(std::span<std::byte> arena) &&;
    Arena build() &&;

    std::size_t object_count() const { return objects_.size(); }
    std::size_t triangle_count() const;
    const arhost_material &material(std::uint32_t index) const { return materials_[index]; }
    const Texture &texture(std::uint32_t index) const { return textures_[index].second; }

private:
    using Geometry = std::variant<TriangleMesh, Spheres>;

    std::uint32_t add_name(const std::string &name);
    void settle(std::span<std::byte> arena) const;

    std::vector<Geometry> geometries_;
    std::vector<std::pair<std::uint32_t, Texture>> textures_; // and the name's place
    std::vector<arhost_material> materials_;
    std::vector<arhost_object> objects_;
    std::vector<arhost_light> lights_;
    std::vector<MotionNode> nodes_;
    std::vector<Channel> channels_;
    std::vector<Skin> skins_;
    std::string names_;
};

// What is wrong with an arena that another process wrote, as the end of a sentence about the scene
// ("object 2 'ball' has material 7, but there are 3"); empty where nothing is. Every offset, count, index,
// enumeration and number is checked before it is used, so a ray tracer may use all of them unchecked
// afterwards, provided that nobody can write the arena any more. Takes time in proportion to the arena's
// size, whatever stands in it.
std::string validate(std::span<const std::byte> arena);

} // namespace arhost::scene
