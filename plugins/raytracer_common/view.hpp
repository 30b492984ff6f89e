// SPDX-License-Identifier: Apache-2.0
//
// Validates setups and cameras, and computes the camera's axes in world space. Functions throw arhost::Failure with
// ARHOST_STATUS_ERROR_INVALID_ARGUMENT if their input is invalid.
#pragma once

#include <arhost-cpp/plugin.hpp>
#include <arhost/shading/lens.hpp>

namespace arhost::raytracer_common {

void check_setup(const arhost_raytracer_setup &setup);
// `intrinsics`: those passed to start.
void check_render(const arhost_camera &camera, const arhost_image &image, const arhost_intrinsics &intrinsics);

bool same_view(const arhost_camera &a, const arhost_camera &b); // compares eye, look_at and up only

// The camera's eye in mm, and its axes as unit vectors: x right, y down, z forward. All are in world space.
struct Pose {
    shading::Vec3T<double> eye, right, down, forward;

    explicit Pose(const arhost_camera &camera);
};

inline void write(const shading::Vec3T<double> &from, float *to) {
    to[0] = static_cast<float>(from.x);
    to[1] = static_cast<float>(from.y);
    to[2] = static_cast<float>(from.z);
}

} // namespace arhost::raytracer_common
