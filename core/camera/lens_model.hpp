// SPDX-License-Identifier: Apache-2.0
//
// Projects points to pixels: the formulas of arhost/camera.h in double precision.
#pragma once

#include <arhost/camera.h>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <cstdint>
#include <optional>
#include <string>

namespace arhost::camera {

// Returns the pixel to which a point in OpenCV camera axes (x right, y down, z forward; mm) is projected; nullopt if
// z ≤ 0. Far outside the image, a Brown polynomial may stop increasing and map points back into the image; as in
// OpenCV, this is not detected.
std::optional<glm::dvec2> project(const arhost_intrinsics &intrinsics, const glm::dvec3 &point_in_camera);

// The number of coefficients of a Brown lens without the tilt of the sensor, which nothing in arhost supports.
constexpr std::uint32_t untilted_coefficients = 12;

// Returns why the lens distortion is not supported or cannot be that of a real camera, or "". Near the principal
// point, where lenses hardly distort, the distorted image must be between half and twice as large as the undistorted
// one. Real lenses differ by a few percent there; other coefficients would make lens computations meaningless or very
// slow.
std::string problem_with_lens(const arhost_intrinsics &intrinsics);

// Transforms a point of the ray tracer's world (mm) to OpenCV camera axes.
glm::dvec3 in_camera(const arhost_camera &camera, const glm::dvec3 &point_in_world);

} // namespace arhost::camera
