// SPDX-License-Identifier: Apache-2.0
// Projection of spheres by the formulas of arhost/camera.h.
#pragma once

#include "conformance/picture.hpp"

#include <arhost/camera.h>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <optional>

namespace arhost::conformance {

// Returns a world point in the camera's OpenCV axes: x right, y down, z forward.
glm::dvec3 in_camera(const arhost_camera &camera, const glm::dvec3 &world);

// Returns the pixel of a point in the camera's axes with z > 0; no lens distortion, or Brown's model.
glm::dvec2 project(const arhost_intrinsics &intrinsics, const glm::dvec3 &point);

// Returns the centroid of a sphere's silhouette. The whole sphere must be in front of the camera.
glm::dvec2 silhouette_centroid(const arhost_camera &camera, const glm::dvec3 &centre, double radius);

// Returns the centroid of the pixels with an alpha of 128 or more, equally weighted; nullopt if there are none.
std::optional<glm::dvec2> centroid(const Picture &picture);

} // namespace arhost::conformance
