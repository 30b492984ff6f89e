// SPDX-License-Identifier: Apache-2.0
//
// Maps the marker's pose to the ray tracer's camera: equations 3.1 to 3.5 of the dissertation.
#pragma once

#include "camera/coordinates.hpp"

#include <arhost/camera.h>

#include <glm/mat4x4.hpp>

#include <optional>
#include <span>

namespace arhost::camera {

// Returns nullptr if `mt` meets the requirements of arhost_target.mt (finite; last row 0 0 0 1; right-handed
// rotation, orthonormal to 1e-6; at most 1e9 mm from the camera), otherwise a description of the problem.
// camera_from_marker always calls this function, because tracker output is untrusted.
const char *problem_with(std::span<const double, 16> mt);

// CP = (MT·R1·R2)⁻¹; eye = (c12, c13, c14), look_at = eye − (c8, c9, c10), up = (c4, c5, c6).
// Returns nullopt if problem_with(mt) is not nullptr. `coordinates` must be valid.
std::optional<arhost_camera> camera_from_marker(std::span<const double, 16> mt, const Coordinates &coordinates,
                                                const arhost_intrinsics &intrinsics);

// Returns the transform from the target's coordinates, whose axes are oriented as in the scene, to the scene's
// coordinates. `mt`: the pose of the target; problem_with(mt) must be nullptr. `camera`: the result of
// camera_from_marker for the same video frame.
glm::dmat4 scene_from_target(const arhost_camera &camera, std::span<const double, 16> mt,
                             const Coordinates &coordinates);

} // namespace arhost::camera
