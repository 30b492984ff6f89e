// SPDX-License-Identifier: Apache-2.0
//
// Embree scenes of an arena. Embree's buffers lie in the arena; nothing is copied.
#pragma once

#include "bvh_quality.hpp"
#include "hit_filter.hpp"

#include <arhost-cpp/plugin.hpp>
#include <arhost/motion.h>

#include <array>
#include <map>
#include <memory>
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
    // Builds the acceleration structures. `arena` outlives this.
    EmbreeScene(const arhost_scene &arena, unsigned threads, bool robust, const arhost::Host &host);

    const Scene &view() const { return view_; }
    // World bounding boxes, by object. Empty for occluders, which never give a pixel alpha.
    const std::vector<Box> &visible_boxes() const { return visible_boxes_; }

    // Updates transforms and deformed meshes. `motion` must stay valid until the next call or the end of tracing.
    void move(const arhost_motion &motion);
    std::uint64_t rebuilds() const { return rebuilds_; } // full BVH rebuilds of deforming objects

private:
    // A deforming object, in its own scene.
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
    void commit(RTCScene scene) const;
    void check() const;

    const arhost_scene &arena_;
    arhost::Host host_;
    bool robust_;
    std::vector<std::unique_ptr<HitFilter>> hit_filters_; // Embree holds their addresses
    DeviceHandle device_;
    struct Instanced {
        std::uint32_t geometry;
        HitFilter filter;
        SceneHandle scene;
    };
    std::vector<Instanced> instanced_;
    std::map<std::uint32_t, Deforming> deforming_; // by object
    SceneHandle static_, root_;                    // static_ only if something moves
    SceneHandle catchers_;                         // only if needs_catcher_bvh()
    struct Placement {
        Box local;
        std::array<float, 12> world_from_object;
    };
    void place_object(std::uint32_t object, const float *world_from_object);
    void update_bounds(std::uint32_t object);
    std::vector<Object> objects_;
    std::vector<Placement> placements_;
    std::vector<Box> visible_boxes_;
    std::uint64_t rebuilds_ = 0;
    std::vector<Texture> textures_;
    std::unique_ptr<const arhost::shading::Srgb8Table> srgb8_;
    std::vector<float> linear_of_srgb8_;
    Scene view_{};
};

} // namespace rt_embree
