// SPDX-License-Identifier: Apache-2.0
//
// The arena as the shaders read it, and trees over it, where they are to be ours. What moves lies at the beginning of
// each array, so that one copy brings it to the device.
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
// Of each triangle or sphere.
std::vector<Box> boxes_of(const arhost_scene &arena, const arhost_geometry &geometry, Points points);

class SceneData {
public:
    // `has_trees`: with trees of ours. `arena` outlives this.
    SceneData(const arhost_scene &arena, bool has_trees, const arhost::Host &host);

    // Brings what moves to its places.
    void move(const arhost_motion &motion);
    std::uint64_t rebuilds() const { return rebuilds_; } // of deforming objects, for which a refit would not do

    // What a buffer holds, in parts that follow one another; and how much of its beginning may change.
    std::vector<Bytes> parts(Binding binding) const;
    std::size_t moving_size(Binding binding) const; // bytes
    // What never changes is forgotten: it lies on the device by now.
    void forget_still_parts();

    std::span<const Object> objects() const { return objects_; }
    // The frame's fields that the scene gives.
    Frame frame() const;
    bool has_glass() const { return has_glass_; }
    bool has_catchers() const { return has_catchers_; }
    bool has_holes() const { return has_holes_; }
    bool has_textures() const { return !textures_.empty(); } // the environment among them

private:
    // A geometry's place in the arrays.
    struct Mesh {
        std::uint32_t root, first_primitive, first_index, first_normal, first_texcoord;
        Box local;
        bool is_empty;
        // Where it deforms, or for a moment:
        Tree tree;             // without nodes where trees are not ours
        double built_area = 0; // relative_area() when its tree was built
    };

    Mesh &mesh_of(std::uint32_t geometry, bool deforms);
    void add_normals(Mesh &mesh, const arhost_geometry &geometry);
    void add_texcoords(Mesh &mesh, const arhost_geometry &geometry);
    void write_tree(const Mesh &mesh, const arhost_geometry &geometry, Points points);
    void add_object(const arhost_object &object, const Mesh &mesh);
    static void place(Object &object, const Mesh &mesh, const float *world_from_object);
    void deform(const arhost_deformed_geometry &deformed);
    void refit_tree(Mesh &mesh, std::span<const Box> boxes);
    void build_top();
    void add_textures();
    void add_tables();
    void check_cancelled() const; // throws where the host cancels

    const arhost_scene &arena_;
    bool has_trees_;
    arhost::Host host_;
    std::map<std::uint32_t, Mesh> meshes_; // by geometry
    std::vector<std::array<float, 12>> places_;
    std::vector<Object> objects_;
    std::vector<Material> materials_;
    std::vector<Light> lights_;
    std::vector<Node> nodes_; // the top tree's come first
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
