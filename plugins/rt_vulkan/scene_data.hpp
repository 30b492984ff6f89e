// SPDX-License-Identifier: Apache-2.0
//
// Converts a scene to the buffers that the shaders read; for the path `plain`, also builds BVHs. In each buffer, the
// parts that may move are together, so a single copy updates them on the device.
#pragma once

#include "bvh.hpp"
#include "raytracer_common/light_sources.hpp"
#include "raytracer_common/photon_map.hpp"

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
// Returns the bounding box of each triangle or sphere of a geometry whose positions are `points`.
std::vector<Box> boxes_of(const arhost_scene &arena, const arhost_geometry &geometry, Points points);

class SceneData {
public:
    // `has_bvhs`: build BVHs for software traversal. `setup.scene` must outlive this object.
    SceneData(const arhost_raytracer_setup &setup, bool has_bvhs, const arhost::Host &host);

    void update(const arhost_motion &motion);
    std::uint64_t rebuilds() const {
        return rebuilds_;
    } // number of BVHs rebuilt so far because they had degraded too much

    // parts() returns the contents of a buffer, to be concatenated; moving_part() returns the bytes that may change,
    // and moving_offset() where in the buffer they begin.
    std::vector<Bytes> parts(Binding binding) const;
    Bytes moving_part(Binding binding) const;
    std::size_t moving_offset(Binding binding) const {
        return binding == tables_binding ? sizeof(std::uint32_t) * first_source_ : 0;
    }
    // The bytes of the texels that the video occupies, after those of parts(); its size is 0 if no image has a video.
    std::size_t video_offset() const { return video_offset_; }
    std::size_t video_size() const { return video_size_; }
    // Frees the data that never changes. Call it after the data has been uploaded.
    void release_static_parts();

    std::span<const Object> objects() const { return objects_; }
    // Returns a frame in which only the fields that depend on the scene are set; all others are 0.
    Frame frame() const;
    // Sets the fields that depend on where the light sources and the virtual objects are. Only with the path
    // integrator.
    void write_lights(Frame &frame) const;
    const arhost::raytracer_common::LightSources &lights() const { return *light_sources_; } // path integrator only
    const arhost::raytracer_common::PhotonTargets &photon_targets() const { return photon_targets_; }
    // One per object. Path integrator only.
    std::span<const arhost::raytracer_common::PlacedObject> placed_objects() const { return placed_; }
    const arhost_environment &environment() const { return arena_.environment; }
    bool has_glass() const { return has_glass_; }
    bool has_catchers() const { return has_catchers_; }
    bool has_holes() const { return has_holes_; } // whether any object rejects hits (ObjectFlag)
    bool has_coat() const { return has_coat_; }
    bool has_sheen() const { return has_sheen_; }
    bool is_anisotropic() const { return is_anisotropic_; }
    bool has_film() const { return has_film_; }
    bool blends() const { return blends_; }       // whether any object is translucent
    bool has_gloss() const { return has_gloss_; } // whether a catcher may mirror
    bool has_area_lights() const { return has_area_lights_; }
    // Virtual objects that reflect or refract like mirrors or glass, or are translucent.
    bool has_specular() const { return has_specular_; }
    bool may_have_photons() const { return has_specular_ && arena_.lights.count > 0; } // path integrator only
    bool has_textures() const { return arena_.textures.count > 0; }                    // including the environment

private:
    // The offsets of a geometry's data in the arrays below.
    struct Mesh {
        std::uint32_t root, first_primitive, first_index, first_normal, first_texcoord, first_tangent, first_colour;
        Box local;
        bool is_empty;
        // The following members are set for deforming meshes only.
        Bvh bvh;               // has no nodes if !has_bvhs_
        double built_cost = 0; // sah_cost() after the last build
    };

    Mesh &mesh_of(std::uint32_t geometry, bool deforms);
    void add_normals(Mesh &mesh, const arhost_geometry &geometry);
    template <std::size_t size> std::uint32_t add_attribute(const arhost_buffer &buffer);
    void add_tangents(Mesh &mesh, const arhost_geometry &geometry);
    void add_texcoords(Mesh &mesh, const arhost_geometry &geometry);
    void add_colours(Mesh &mesh, const arhost_geometry &geometry);
    void write_bvh(const Mesh &mesh, const arhost_geometry &geometry, Points points);
    std::uint32_t mask_of(const arhost_object &object) const;
    void add_object(const arhost_object &object, const Mesh &mesh);
    static void set_transform(Object &object, const Mesh &mesh, const float *world_from_object);
    void deform(const arhost_deformed_geometry &deformed);
    void refit_bvh(Mesh &mesh, std::span<const Box> boxes);
    void build_top_level();
    void add_textures();
    void add_path_textures(const arhost_raytracer_setup &setup);
    void add_tables();
    void add_light_sources();
    void place_lights();
    void check_cancelled() const; // throws if the host has cancelled, else reports progress

    const arhost_scene &arena_;
    bool has_bvhs_;
    arhost::Host host_;
    std::map<std::uint32_t, Mesh> meshes_;          // key: geometry index
    std::vector<std::array<float, 12>> transforms_; // world from object, one per object
    std::vector<Object> objects_;
    std::vector<Material> materials_;
    std::vector<Light> lights_;
    std::vector<Node> nodes_; // the nodes of the top-level BVH come first
    std::vector<Primitive> primitives_;
    std::vector<std::uint32_t> indices_;
    std::vector<float> attributes_;
    std::vector<Texture> textures_;
    std::vector<Bytes> texels_;
    std::vector<std::uint32_t> tables_;
    // The path integrator; empty with another integrator.
    std::optional<arhost::raytracer_common::LightSources> light_sources_;
    std::vector<arhost::raytracer_common::PlacedObject> placed_; // one per object
    std::vector<float> irradiance_;                              // of the environment
    arhost::raytracer_common::PhotonTargets photon_targets_;
    // The end of `tables_`: records of the light sources, then their cumulative chances, and the cumulative and other
    // chances of the targets of photons.
    std::vector<std::uint32_t> sources_;
    std::uint32_t first_source_ = 0, max_sources_ = 0, max_targets_ = 0, irradiance_texture_ = ARHOST_NONE,
                  video_texture_ = ARHOST_NONE;
    std::size_t video_offset_ = 0, video_size_ = 0;

    std::size_t moving_nodes_ = 0, moving_primitives_ = 0, moving_attributes_ = 0;
    std::uint32_t solid_objects_ = 0, environment_rows_ = 0, environment_columns_ = 0;
    bool anything_moves_ = false, has_glass_ = false, has_catchers_ = false, has_holes_ = false, has_gloss_ = false,
         has_area_lights_ = false, has_real_ = false, has_several_real_ = false, has_specular_ = false,
         has_coat_ = false, has_sheen_ = false, is_anisotropic_ = false, has_film_ = false, blends_ = false;
    std::uint64_t rebuilds_ = 0;
};

} // namespace rt_vulkan
