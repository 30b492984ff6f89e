// SPDX-License-Identifier: Apache-2.0
//
// Builds Embree scenes from a scene's arena (arhost/scene.h). Embree's buffers point into the arena; no vertex data
// is copied.
#pragma once

#include "bvh_quality.hpp"
#include "hit_filter.hpp"
#include "raytracer_common/light_sources.hpp"
#include "raytracer_common/video.hpp"

#include <arhost-cpp/plugin.hpp>
#include <arhost/motion.h>

#include <array>
#include <map>
#include <memory>
#include <span>
#include <type_traits>
#include <vector>

namespace rt_embree {

template <class T, void (*release)(T)> struct Release {
    using pointer = T;
    void operator()(T handle) const { release(handle); }
};
using DeviceHandle = std::unique_ptr<std::remove_pointer_t<RTCDevice>, Release<RTCDevice, rtcReleaseDevice>>;
using SceneHandle = std::unique_ptr<std::remove_pointer_t<RTCScene>, Release<RTCScene, rtcReleaseScene>>;
using GeometryHandle = std::unique_ptr<std::remove_pointer_t<RTCGeometry>, Release<RTCGeometry, rtcReleaseGeometry>>;

struct Box {
    double min[3], max[3];
};

class EmbreeScene {
public:
    // Builds the acceleration structures. `arena` must outlive this object.
    EmbreeScene(const arhost_scene &arena, unsigned threads, bool robust, const arhost::Host &host);

    const arhost_scene &arena() const { return arena_; }
    const Scene &view() const { return view_; }
    const ColourTables &colour_tables() const { return *colour_tables_; }
    // Bounding boxes in world space, one per object. The boxes of occluders are empty: their pixels always have alpha
    // 0.
    const std::vector<Box> &visible_boxes() const { return visible_boxes_; }

    // Updates the transforms of moved objects and the deformed meshes. `motion` must stay valid until the next call
    // or until this object is no longer used.
    void move(const arhost_motion &motion);
    std::vector<arhost::raytracer_common::PlacedObject> placed_objects() const;     // valid until the next move()
    void set_emitters(std::span<const arhost::raytracer_common::Emitter> emitters); // one per object
    // Sets the factors of the environment's texels.
    void set_environment_scale(const std::array<float, 3> &scale);
    std::uint64_t rebuilds() const { return rebuilds_; } // number of full rebuilds of deforming objects' BVHs so far

private:
    // A deforming object. It has its own Embree scene, which the root scene instances.
    struct Deforming {
        SceneHandle scene;
        GeometryHandle geometry;
        BvhQuality quality;
    };
    SceneHandle new_scene(RTCSceneFlags flags) const;
    GeometryHandle new_geometry(std::uint32_t object);
    RTCScene instanced_scene(std::uint32_t object);
    RTCScene deforming_scene(std::uint32_t object);
    GeometryHandle new_instance(RTCScene of, const float *world_from_object) const;
    void attach(RTCScene to, const GeometryHandle &geometry, std::uint32_t number) const;
    void deform(const arhost_deformed_geometry &deformed);
    void show(std::uint32_t object, RTCGeometry instance, bool is_visible);
    void commit(RTCScene scene) const;
    void check() const;

    const arhost_scene &arena_;
    arhost::Host host_;
    bool robust_;
    RTCBuildQuality static_quality_;                      // of objects that do not change
    std::vector<std::unique_ptr<HitFilter>> hit_filters_; // on the heap: Embree holds their addresses
    DeviceHandle device_;
    // The Embree scene of a transformed object; shared by objects with the same geometry and filter.
    struct Instanced {
        std::uint32_t geometry;
        HitFilter filter;
        SceneHandle scene;
    };
    std::vector<Instanced> instanced_;
    std::map<std::uint32_t, Deforming> deforming_; // key: object index
    SceneHandle static_, root_;                    // static_ is NULL unless an object moves or deforms
    SceneHandle catchers_;                         // NULL unless needs_catcher_bvh()
    struct Placement {
        Box local;
        std::array<float, 12> world_from_object;
        bool is_visible = true;
    };
    void place_object(std::uint32_t object, const float *world_from_object);
    void update_bounds(std::uint32_t object);
    std::vector<Object> objects_;
    std::vector<Placement> placements_;
    std::vector<Box> visible_boxes_;
    std::uint64_t rebuilds_ = 0;
    std::vector<Texture> textures_;
    std::unique_ptr<const ColourTables> colour_tables_;
    Scene view_{};
};

} // namespace rt_embree
