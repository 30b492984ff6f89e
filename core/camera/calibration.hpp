// SPDX-License-Identifier: Apache-2.0
//
// Camera intrinsics from calibration files and from the configuration's `camera:` block. Throws yaml::Error,
// which names file, line, column, key and the fix.
#pragma once

#include "yaml/yaml.hpp"

#include <arhost/camera.h>

#include <cstdint>
#include <filesystem>
#include <optional>

namespace arhost::camera {

struct Size {
    std::uint32_t width, height; // px
    bool operator==(const Size &) const = default;
};

// Reads a YAML calibration of OpenCV's FileStorage and calibration programs, or ROS camera_info. `expected` is used
// if the file has no image size, and must match if it has one.
arhost_intrinsics read_calibration(const std::filesystem::path &file, std::optional<Size> expected = {});

// The configuration's `camera:` block: {file: camera.yaml}, plus width and height if the file lacks them; or {width,
// height, fx, fy, cx, cy, distortion: {model: none|brown|fisheye, coefficients: […]}}. Defaults: fy = fx, cx and cy
// at the image centre, no distortion. vertical_fov_degrees may replace fx and fy for an uncalibrated camera.
arhost_intrinsics parse_camera(const yaml::Node &node);

// The fixed camera of the dissertation's ray tracers: vertical field of view of 45 degrees, square pixels, centred
// principal point, no distortion.
arhost_intrinsics dissertation_camera(const Size &size);

// Throws if the intrinsics are for another image size.
void check_size(const arhost_intrinsics &intrinsics, std::uint32_t width, std::uint32_t height);

} // namespace arhost::camera
