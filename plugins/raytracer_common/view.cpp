// SPDX-License-Identifier: Apache-2.0
#include "raytracer_common/view.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <string>

namespace arhost::raytracer_common {
namespace {

using Vec3d = shading::Vec3T<double>;

[[noreturn]] void reject(const std::string &message) {
    throw Failure(ARHOST_STATUS_ERROR_INVALID_ARGUMENT, message);
}

bool all_finite(std::span<const double> values) {
    return std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); });
}

bool same(const arhost_intrinsics &a, const arhost_intrinsics &b) {
    return a.width == b.width && a.height == b.height && a.distortion == b.distortion && a.fx == b.fx &&
           a.fy == b.fy && a.cx == b.cx && a.cy == b.cy && a.coefficient_count == b.coefficient_count &&
           std::equal(a.coefficients,
                      a.coefficients + std::min<std::uint32_t>(a.coefficient_count, ARHOST_MAX_DISTORTION),
                      b.coefficients);
}

} // namespace

void check_setup(const arhost_raytracer_setup &setup) {
    const arhost_intrinsics &in = *setup.intrinsics;
    if (setup.width < 1 || setup.height < 1 || setup.width > ARHOST_MAX_IMAGE_SIDE ||
        setup.height > ARHOST_MAX_IMAGE_SIDE)
        reject("the image's width and height must be 1 to " + std::to_string(ARHOST_MAX_IMAGE_SIDE) + " px");
    if (in.width != setup.width || in.height != setup.height)
        reject("the intrinsics are for images of " + std::to_string(in.width) + "x" + std::to_string(in.height) +
               " px, but the image to render has " + std::to_string(setup.width) + "x" +
               std::to_string(setup.height) + " px");
    if (!all_finite({&in.fx, 4}))
        reject("the intrinsics' focal lengths and principal point must be finite");
    if (!(in.fx > 0) || !(in.fy > 0))
        reject("the intrinsics' focal lengths must be above 0");
    const std::uint32_t count = in.coefficient_count;
    const bool fits = in.distortion == ARHOST_DISTORTION_NONE ? count == 0
                      : in.distortion == ARHOST_DISTORTION_BROWN
                          ? count == 4 || count == 5 || count == 8 || count == 12
                      : in.distortion == ARHOST_DISTORTION_FISHEYE ? count == 4
                                                                   : false;
    if (!fits)
        reject("distortion model " + std::to_string(in.distortion) + " with " + std::to_string(count) +
               " coefficients is not supported (arhost/camera.h)");
    if (!all_finite({in.coefficients, count}))
        reject("the distortion coefficients must be finite");
    if (setup.scene->magic != ARHOST_SCENE_MAGIC)
        reject("the scene does not begin with ARHOST_SCENE_MAGIC (arhost/scene.h)");
    if (setup.scene->version != ARHOST_SCENE_VERSION)
        reject("the scene's arena has version " + std::to_string(setup.scene->version) + ", but version " +
               std::to_string(ARHOST_SCENE_VERSION) + " is required");
}

void check_render(const arhost_camera &camera, const arhost_image &image, const arhost_intrinsics &intrinsics) {
    if (!same(camera.intrinsics, intrinsics))
        reject("the camera's intrinsics differ from the intrinsics passed to start");
    const std::uint32_t pixel_bytes = image.linear ? 16 : 4;
    if (image.width != intrinsics.width || image.height != intrinsics.height || !image.rgba == !image.linear ||
        image.stride < pixel_bytes * image.width)
        reject("the image buffer must have the form and size passed to start and a stride of at least 4 bytes per "
               "pixel, or 16 if it is linear");
}

bool same_view(const arhost_camera &a, const arhost_camera &b) {
    return std::equal(a.eye, a.eye + 3, b.eye) && std::equal(a.look_at, a.look_at + 3, b.look_at) &&
           std::equal(a.up, a.up + 3, b.up);
}

Pose::Pose(const arhost_camera &camera) {
    if (!all_finite(camera.eye) || !all_finite(camera.look_at) || !all_finite(camera.up))
        reject("the camera's eye, look_at and up must be finite");
    constexpr double limit_mm = 1e12; // farther away, numbers exceed the range of float or of Embree
    if (std::any_of(camera.eye, camera.eye + 3, [](double number) { return std::abs(number) > limit_mm; }))
        reject("the camera's eye must be within 1e12 mm of the world origin along each axis");
    eye = {camera.eye[0], camera.eye[1], camera.eye[2]};
    const Vec3d w = eye - Vec3d{camera.look_at[0], camera.look_at[1], camera.look_at[2]};
    const Vec3d up{camera.up[0], camera.up[1], camera.up[2]};
    const Vec3d u = cross(up, w);
    if (!(length(w) > 0))
        reject("the camera's look_at must differ from its eye");
    if (!(length(u) > 1e-9 * length(up) * length(w)))
        reject("the camera's up is parallel to its view direction");
    forward = w * (-1 / length(w));
    right = u * (1 / length(u));
    down = cross(forward, right);
}

} // namespace arhost::raytracer_common
