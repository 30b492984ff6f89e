// SPDX-License-Identifier: Apache-2.0
//
// The scene as the shaders read it, for the plain path with BVHs. Moving parts come first in each array, so that one
// copy updates them on the device.
#pragma once

#include "bvh.hpp"

#include <arhost-cpp/plugin.hpp>
#include <arhost/motion.h>

#include <array>
#include <map>
#include <optional>
#include <span>
#include <vector>

namespace rt_vulkan {

using Bytes = std::span<const std::byte>;

struct Points {
    const std::byte *first;
    std::uint32_t stride; // bytes
};
// The bounding box of each triangle or sphere.
std::vector<Box> boxes_of(const arhost_scene &arena, const arhost_geometry &geometry, Points points);

class SceneData {
public:
    // `has_bvhs`: build BVHs, for software traversal. `arena` outlives this.
    SceneData(const arhost_scene &arena, bool has_bvhs, const arhost::Host &host);

    void update(const arhost_motion &motion);
    std::uint64_t rebuilds() const { return rebuilds_; } // of BVHs that degraded too much to be refitted

    // A buffer's contents, concatenated; moving_size(): the bytes at its start that may change.
    std::vector<Bytes> parts(Binding binding) const;
    std::size_t moving_size(Binding binding) const;
    // Frees what never changes, once it is on the device.
    void release_static_parts();

    std::span<const Object> objects() const { return objects_; }
    // The fields that depend on the scene; the rest is 0.
    Frame frame() const;
    bool has_glass() const { return has_glass_; }
    bool has_catchers() const { return has_catchers_; }
    bool has_holes() const { return has_holes_; }
    bool has_textures() const { return !textures_.empty(); } // including the environment

private:
    // A geometry's offsets in the arrays.
    struct Mesh {
        std::uint32_t root, first_primitive, first_index, first_normal, first_texcoord;
        Box local;
        bool is_empty;
        // Kept only for deforming meshes:
        Bvh bvh;               // without nodes if !has_bvhs_
        double built_cost = 0; // sah_cost() of the last build
    };

    Mesh &mesh_of(std::uint32_t geometry, bool deforms);
    void add_normals(Mesh &mesh, const arhost_geometry &geometry);
    void add_texcoords(Mesh &mesh, const arhost_geometry &geometry);
    void write_bvh(const Mesh &mesh, const arhost_geometry &geometry, Points points);
    void add_object(const arhost_object &object, const Mesh &mesh);
    static void set_transform(Object &object, const Mesh &mesh, const float *world_from_object);
    void deform(const arhost_deformed_geometry &deformed);
    void refit_bvh(Mesh &mesh, std::span<const Box> boxes);
    void build_top_level();
    void add_textures();
    void add_tables();
    void check_cancelled() const; // throws if the host cancels; reports progress

    const arhost_scene &arena_;
    bool has_bvhs_;
    arhost::Host host_;
    std::map<std::uint32_t, Mesh> meshes_;          // by geometry
    std::vector<std::array<float, 12>> transforms_; // world from object
    std::vector<Object> objects_;
    std::vector<Material> materials_;
    std::vector<Light> lights_;
    std::vector<Node> nodes_; // the top-level BVH's come first
    std::vector<Primitive> primitives_;
    std::vector<std::uint32_t> indices_;
    std::vector<float> attributes_;
    std::vector<Texture> textures_;
    std::vector<Bytes> texels_;
    std::vector<std::uint32_t> tables_;
    std::size_t moving_nodes_ = 0, moving_primitives_ = 0, moving_attributes_ = 0;
    std::uint32_t solid_objects_ = 0, environment_rows_ = 0, environment_columns_ = 0;
    bool anything_moves_ = false, has_glass_ = false, has_catchers_ = false, has_holes_ = false;
    std::uint64_t rebuilds_ = 0;
};

} // namespace rt_vulkan
