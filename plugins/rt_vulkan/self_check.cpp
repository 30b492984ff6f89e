// SPDX-License-Identifier: Apache-2.0
#include "self_check.hpp"

#include "raytracer_common/scene_geometry.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <span>

namespace rt_vulkan {
namespace {

using arhost::raytracer_common::bytes;
using arhost::raytracer_common::elements;
using arhost::raytracer_common::transform_box;

constexpr std::uint32_t width = 64, height = 48;
constexpr int max_code_difference = 16; // differences in rounding between the paths are smaller

using Pixels = std::vector<std::uint8_t>;

// Returns the bounding box of the virtual objects in world space.
Box box_of_virtual_objects(const arhost_scene &scene) {
    Box all = empty_box();
    const std::span geometries = elements<arhost_geometry>(scene, scene.geometries);
    for (const arhost_object &object : elements<arhost_object>(scene, scene.objects)) {
        if (object.role != ARHOST_ROLE_VIRTUAL)
            continue;
        const arhost_geometry &geometry = geometries[object.geometry];
        Box local = empty_box();
        for (const Box &box :
             boxes_of(scene, geometry, {bytes(scene) + geometry.positions.offset, geometry.positions.stride}))
            include(local, box);
        if (local.low[0] > local.high[0])
            continue;
        double low[3], high[3];
        transform_box(local.low, local.high, object.world_from_object, low, high);
        Box world;
        std::copy_n(low, 3, world.low);
        std::copy_n(high, 3, world.high);
        include(all, world);
    }
    return all;
}

// Returns a camera that sees all of `box` obliquely from above.
arhost_camera camera_for(const Box &box, arhost_axes axes, const arhost_intrinsics &intrinsics) {
    double centre[3], radius = 0;
    for (int axis = 0; axis < 3; ++axis) {
        centre[axis] = 0.5 * (double{box.low[axis]} + box.high[axis]);
        radius = std::hypot(radius, 0.5 * (double{box.high[axis]} - box.low[axis]));
    }
    const double distance = 2.5 * std::max(radius, 1e-3); // the vertical field of view is 53°
    const double z_up[3] = {0.3, -0.8, 0.5}, y_up[3] = {0.3, 0.5, 0.8};
    arhost_camera camera{};
    camera.struct_size = sizeof camera;
    for (int axis = 0; axis < 3; ++axis) {
        camera.look_at[axis] = centre[axis];
        camera.eye[axis] = centre[axis] + distance * (axes == ARHOST_AXES_Z_UP ? z_up : y_up)[axis];
    }
    camera.up[axes == ARHOST_AXES_Z_UP ? 2 : 1] = 1;
    camera.intrinsics = intrinsics;
    return camera;
}

Pixels picture_by(const Shaders &shaders, const arhost_raytracer_setup &setup, const Settings &settings,
                  const arhost::Host &host, const PhysicalDevice &physical, const arhost_camera &camera) {
    Renderer renderer(setup, settings, host, physical, shaders);
    Pixels pixels(std::size_t{4} * width * height);
    arhost_image image{};
    image.struct_size = sizeof image;
    image.stride = 4 * width;
    image.width = width;
    image.height = height;
    image.rgba = pixels.data();
    std::vector<std::byte> state(renderer.state_size()); // so that the image is denoised, if those of the run are
    renderer.render(camera, image, nullptr, nullptr, 0, {nullptr, state.empty() ? nullptr : state.data()});
    return pixels;
}

} // namespace

std::string difference_from_plain(const arhost_raytracer_setup &setup, const Settings &settings,
                                  const arhost::Host &host, const PhysicalDevice &physical, const Shaders &shaders) {
    const Box box = box_of_virtual_objects(*setup.scene);
    if (!(box.low[0] <= box.high[0])) // no virtual object
        return {};
    arhost_intrinsics intrinsics{};
    intrinsics.struct_size = sizeof intrinsics;
    intrinsics.width = width;
    intrinsics.height = height;
    intrinsics.fx = intrinsics.fy = height;
    intrinsics.cx = (width - 1) / 2.0;
    intrinsics.cy = (height - 1) / 2.0;
    intrinsics.distortion = ARHOST_DISTORTION_NONE;
    arhost_raytracer_setup small = setup;
    small.form = ARHOST_IMAGE_FORM_STRAIGHT;
    small.video_format = nullptr;
    small.width = width;
    small.height = height;
    small.intrinsics = &intrinsics;
    Settings once = settings;
    once.samples = once.light_samples = 1;
    once.accumulate = false;
    once.view = arhost::raytracer_common::View::picture;
    const arhost_camera camera = camera_for(box, setup.scene->axes, intrinsics);

    const Pixels got = picture_by(shaders, small, once, host, physical, camera);
    Pixels expected;
    try {
        expected = picture_by(shaders_of(Path::plain, setup.scene->integrator), small, once, host, physical, camera);
    } catch (const arhost::Failure &failure) {
        if (failure.status() == ARHOST_STATUS_ERROR_CANCELLED)
            throw;
        return {};
    }
    int drawn = 0, different = 0;
    for (std::size_t i = 0; i < got.size(); i += 4) {
        if (got[i + 3] == 0 && expected[i + 3] == 0)
            continue;
        ++drawn;
        bool differs = false;
        for (std::size_t c = 0; c < 4; ++c)
            differs = differs || std::abs(got[i + c] - expected[i + c]) > max_code_difference;
        different += differs;
    }
    // At edges and behind glass, rounding may select another triangle.
    if (different <= drawn / 10 + 8)
        return {};
    return std::to_string(different) + " of " + std::to_string(drawn) +
           " drawn pixels of a small picture differ from those of the path 'plain'";
}

} // namespace rt_vulkan
