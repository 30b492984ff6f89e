// SPDX-License-Identifier: Apache-2.0
//
// Where a camera sees a point: the formulas of arhost/camera.h in double precision.
#pragma once

#include <arhost/camera.h>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <optional>

namespace arhost::camera {

// The pixel at which a point in the camera's OpenCV axes (x right, y down, z forward; mm) is seen. None
// where z ≤ 0. As in OpenCV, a Brown polynomial is not watched for folding back far outside the image.
std::optional<glm::dvec2> project(const arhost_intrinsics &intrinsics, const glm::dvec3 &point_in_camera);

// A point of the ray tracer's world (mm) in the camera's OpenCV axes.
glm::dvec3 in_camera(const arhost_camera &camera, const glm::dvec3 &point_in_world);

} // namespace arhost::camera
