// SPDX-License-Identifier: Apache-2.0
//
// Where a sphere must be seen, by the formulas of arhost/camera.h alone.
#pragma once

#include "conformance/picture.hpp"

#include <arhost/camera.h>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <optional>

namespace arhost::conformance {

// A world point in the camera's OpenCV axes: x right, y down, z forward.
glm::dvec3 in_camera(const arhost_camera &camera, const glm::dvec3 &world);

// The pixel at which a point, in the camera's axes, is seen. z > 0; no lens or Brown's.
glm::dvec2 project(const arhost_intrinsics &intrinsics, const glm::dvec3 &point);

// Centroid of a sphere's silhouette. The sphere lies in front of the camera altogether.
glm::dvec2 silhouette_centroid(const arhost_camera &camera, const glm::dvec3 &centre, double radius);

// Where the alpha is at least 128, each pixel counted whole: nothing where it is nowhere.
std::optional<glm::dvec2> centroid(const Picture &picture);

} // namespace arhost::conformance
