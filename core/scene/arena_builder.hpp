// SPDX-License-Identifier: Apache-2.0
//
// Writes and validates the arena of arhost/scene.h. Depends on no parser, since the host links it.
#pragma once

#include "scene/arena_limits.hpp"
#include "scene/mesh.hpp"

#include <arhost/scene.h>

#include <glm/mat3x2.hpp>
#include <glm/mat3x3.hpp>
#include <glm/mat4x3.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

namespace arhost::scene {

using Spheres = std::vector<glm::vec4>; // centre and radius

// Returns a material of the model `model` with the usual default in each field and without textures. Glass and
// mirrors transmit and reflect all light; materials of the other models are black.
arhost_material make_material(arhost_material_model model);
// The default of arhost_material::shadow_attenuation for colourless glass. Two surfaces then dim a lamp about as much
// as the default translucent shadow of a catcher does.
inline constexpr float default_shadow_attenuation = 0.6f;
// Returns a white light at the origin that points along −z. An area light is 1 mm wide.
arhost_light make_light(arhost_light_type type);

// Texel memory. Not initialized and not copyable, because a texture may be as large as 1 GiB.
struct Texels {
    std::unique_ptr<std::byte[]> bytes;
    std::size_t size = 0;

    static Texels of_size(std::size_t size) { return {std::make_unique_for_overwrite<std::byte[]>(size), size}; }
    std::span<std::byte> span() const { return {bytes.get(), size}; }
};

struct TexelImage {
    arhost_texel_format format = ARHOST_TEXEL_SRGB8;
    std::uint32_t width = 0, height = 0;
    Texels texels;
    std::uint32_t level_count = 1;
};

// Returns the number of texels in the first `level_count` levels of an image (arhost_texel_image).
std::uint64_t texel_count(std::uint32_t width, std::uint32_t height, std::uint32_t level_count);

struct Texture {
    std::uint32_t image = 0;
    arhost_wrap wrap_u = ARHOST_WRAP_REPEAT, wrap_v = ARHOST_WRAP_REPEAT;
    arhost_texel_filter filter = ARHOST_TEXEL_FILTER_LINEAR;
    std::uint32_t texcoord_set = 0;
    glm::mat3x2 image_from_texcoord{1};
};

struct Environment {
    std::uint32_t texture = ARHOST_NONE;
    float intensity = 1;
    glm::mat3 environment_from_world{1};
    bool follows_video = false;
    std::vector<float> rows, columns; // cumulative sums for importance sampling, see arhost/scene.h
};

// The node's pose is parent_from_node if `animated` is false; otherwise translation, rotation and scale.
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
    std::optional<float> period_s{}; // absent: Settings::duration_s
};

struct Skin {
    std::vector<std::uint32_t> joints;
    std::vector<glm::mat4x3> node_from_mesh;
};

// How an object moves: rigidly with its node (moves), by deformation (deforms: skin, morph targets or both), or not
// at all.
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
    arhost_integrator integrator = ARHOST_INTEGRATOR_WHITTED;
};

// The tables of an arena, and the scene as a whole.
enum class Table { scene, geometries, images, textures, materials, objects, lights, nodes, channels, skins, anchors };
constexpr std::size_t table_count = 11;

// A violation of the rules in arhost/scene.h, for example "object 2 'ball' refers to material 7, but the scene has
// only 3".
struct Fault {
    std::string text;
    Table table = Table::scene; // the element that violates the rule; index 0 for Table::scene
    std::size_t index = 0;
};

// The origin of each element of an arena, as the user knows it: "scene.yaml:6:5: objects[0]".
class Origins {
public:
    // Sets the origin of the elements that are added from now on.
    void set(std::string origin) { texts_.push_back(std::move(origin)); }
    void add(Table table) { of_table(table).push_back(texts_.size()); }
    // Returns the origins of all elements of a table; "": unknown.
    std::vector<std::string> all(Table table) const;
    // Returns the fault's text after its origin, or only the text if the origin is unknown.
    std::string message(const Fault &fault) const;

private:
    std::vector<std::size_t> &of_table(Table table) { return tables_[static_cast<std::size_t>(table)]; }

    std::vector<std::string> texts_;
    // For each element: the index of its text in texts_, plus 1; 0: none.
    std::array<std::vector<std::size_t>, table_count> tables_;
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

// The contents of the files of a scene that only the user needs, and names that are not in the arena.
struct Contents {
    struct Animation {
        std::string name;
        float duration_s;
    };
    std::vector<Animation> animations; // also those that are not selected
    std::vector<std::string> variants;
    std::vector<std::string> materials; // names, in the order of the arena; "": none
    std::size_t nodes = 0;
};

// Collects a scene, then writes it as one arena:
//
//   ArenaBuilder builder;
//   builder.add_object("ball", builder.add_spheres({{0, 0, 20, 20}}), builder.add_material(red));
//   Arena arena = std::move(builder).build();
//
// It does not check its input; `validate` does.
class ArenaBuilder {
public:
    Settings settings;
    Environment environment;
    Contents contents;

    // Sets the origin of the elements that are added from now on.
    void set_origin(std::string origin) { origins_.set(std::move(origin)); }
    const Origins &origins() const { return origins_; }

    // Each function returns the index of the new element.
    std::uint32_t add_triangles(TriangleMesh mesh);
    std::uint32_t add_spheres(Spheres spheres);
    std::uint32_t add_image(const std::string &name, TexelImage image);
    std::uint32_t add_texture(const Texture &texture);
    // Adds an image, and `texture` to show it.
    std::uint32_t add_texture(const std::string &name, TexelImage image, Texture texture = {});
    std::uint32_t add_material(const arhost_material &material, const std::string &name = "");
    std::uint32_t add_object(const std::string &name, std::uint32_t geometry, std::uint32_t material,
                             arhost_role role = ARHOST_ROLE_VIRTUAL,
                             const glm::mat4x3 &world_from_object = glm::mat4x3(1), const Motion &motion = {},
                             bool hides_back_faces = false);
    std::uint32_t add_light(const arhost_light &light);
    std::uint32_t add_node(MotionNode node);
    std::uint32_t add_channel(Channel channel);
    std::uint32_t add_skin(Skin skin);
    // Adds a node that follows a target; returns the index of the node.
    std::uint32_t add_anchor(const std::string &target);

    std::size_t byte_size() const;

    // Writes the arena to `arena`, which must have byte_size() bytes and be aligned to 64 bytes. Frees each mesh and
    // texture after writing it, to limit peak memory. If there are moving objects, the scene must be valid, because
    // this function evaluates their poses at time 0.
    void write(std::span<std::byte> arena) &&;
    Arena build() &&;

    std::size_t object_count() const { return objects_.size(); }
    std::size_t triangle_count() const;
    const arhost_material &material(std::uint32_t index) const { return materials_[index]; }
    arhost_material &material(std::uint32_t index) { return materials_[index]; }
    const TexelImage &image_of_texture(std::uint32_t index) const { return images_[textures_[index].image].second; }
    const Texture &texture(std::uint32_t index) const { return textures_[index]; }

private:
    using Geometry = std::variant<TriangleMesh, Spheres>;

    std::uint32_t add_name(const std::string &name);
    void apply_initial_motion(std::span<std::byte> arena) const;

    std::vector<Geometry> geometries_;
    std::vector<std::pair<std::uint32_t, TexelImage>> images_; // first: offset of the name in `names`
    std::vector<Texture> textures_;
    std::vector<arhost_material> materials_;
    std::vector<arhost_object> objects_;
    std::vector<arhost_light> lights_;
    std::vector<MotionNode> nodes_;
    std::vector<Channel> channels_;
    std::vector<Skin> skins_;
    std::vector<arhost_anchor> anchors_;
    std::string names_;
    Origins origins_;
};

// Validates an arena that another process wrote. Returns the first fault; nullopt if the arena is valid. Checks every
// offset, count, index, enumerator and number. Ray tracers may therefore use the values without checks, once nobody
// can write to the arena any more. Takes linear time in the size of the arena for any content.
std::optional<Fault> find_fault(std::span<const std::byte> arena);

// Returns the text of find_fault, or "" if the arena is valid.
std::string validate(std::span<const std::byte> arena);

} // namespace arhost::scene
