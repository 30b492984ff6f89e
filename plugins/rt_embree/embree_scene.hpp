// SPDX-License-Identifier: Apache-2.0
//
// The arena as Embree sees it. Embree's buffers lie in the arena; nothing is copied.
#pragma once

#include "kernel.hpp"

#include <arhost-cpp/plugin.hpp>

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
    // In the world, of the objects that can give a pixel alpha: virtual ones and catchers.
    const std::vector<Box> &visible_boxes() const { return visible_boxes_; }

private:
    SceneHandle new_scene() const;
    GeometryHandle new_geometry(std::uint32_t geometry, arhost_role role) const;
    RTCScene instanced_scene(std::uint32_t geometry, arhost_role role);
    void commit(RTCScene scene) const;
    void check() const;

    const arhost_scene &arena_;
    arhost::Host host_;
    bool robust_;
    DeviceHandle device_;
    struct Instanced {
        std::uint32_t geometry;
        bool of_catchers;
        SceneHandle scene;
    };
    std::vector<Instanced> instanced_;
    SceneHandle root_;
    std::vector<Object> objects_;
    std::vector<Box> visible_boxes_;
    std::vector<Texture> textures_;
    std::unique_ptr<const arhost::shading::Srgb8Table> srgb8_;
    std::vector<float> linear_of_srgb8_;
    Scene view_{};
};

} // namespace rt_embree
