// SPDX-License-Identifier: Apache-2.0
//
// Reads camera intrinsics from calibration files and from the configuration's `camera:` block. Errors are thrown as
// yaml::Error, whose message names file, line, column and key, and how to fix the error.
#pragma once

#include "yaml/yaml.hpp"

#include <arhost/camera.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace arhost::camera {

struct Size {
    std::uint32_t width, height; // px
    bool operator==(const Size &) const = default;
};

// Reads a calibration, whose format is recognised by its content: YAML of OpenCV's FileStorage, of OpenCV's
// calibration programs, of ROS (camera_info) or of Kalibr (camchain), or camera parameters of ARToolKit. If the file
// has an image size, it must equal `expected`; otherwise `expected` is the image size. `name` is the camera in a
// camchain; default: cam0.
arhost_intrinsics read_calibration(const std::filesystem::path &file, std::optional<Size> expected = {},
                                   const std::optional<std::string> &name = {});

// Reads the configuration's `camera:` block: {file: camera.yaml}, plus width and height if the file lacks them, plus
// the name of the camera in a camchain; or
// {width, height, fx, fy, cx, cy, distortion: {model: none|brown|fisheye, coefficients: […]}}. Defaults: fy = fx, cx
// and cy at the image centre, no distortion. vertical_fov_degrees may replace fx and fy for an uncalibrated camera.
arhost_intrinsics parse_camera(const yaml::Node &node);

// Returns the fixed camera of the dissertation's ray tracers: vertical field of view of 45 degrees, square pixels,
// principal point at the image centre, no distortion.
arhost_intrinsics dissertation_camera(const Size &size);

// Returns a warning that the focal length is probably wrong, or "". The warning occurs if the focal length is below
// 100 px and gives the image a larger field of view than most lenses have.
std::string doubt_about_focal_length(const arhost_intrinsics &intrinsics);

// Throws if the intrinsics are not for an image of `width` × `height` px.
void check_size(const arhost_intrinsics &intrinsics, std::uint32_t width, std::uint32_t height);

} // namespace arhost::camera
