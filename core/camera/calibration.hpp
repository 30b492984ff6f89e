// SPDX-License-Identifier: Apache-2.0
//
// The camera's intrinsics: from calibration files and from the configuration's `camera:` block. Errors
// are yaml::Error: file:line:column, key, and what to mend.
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

// A calibration as OpenCV's FileStorage and calibration programs write it (YAML), or ROS's camera_info.
// `expected` stands in where the file tells no image size, and must agree where it does.
arhost_intrinsics read_calibration(const std::filesystem::path &file, std::optional<Size> expected = {});

// The configuration's `camera:` block: {file: camera.yaml}, with width and height beside it where the
// file has none; or {width, height, fx, fy, cx, cy, distortion: {model: none|brown|fisheye,
// coefficients: […]}}, where fy defaults to fx, cx and cy to the image's centre, distortion to none. Of a
// camera that was not calibrated, vertical_fov_degrees may stand for fx and fy.
arhost_intrinsics parse_camera(const yaml::Node &node);

// The camera that the dissertation's ray tracers have, whatever films: 45 degrees from the image's upper edge
// to the lower one, square pixels, the axis in the middle, no distortion.
arhost_intrinsics dissertation_camera(const Size &size);

// Throws where the intrinsics belong to another image size.
void check_size(const arhost_intrinsics &intrinsics, std::uint32_t width, std::uint32_t height);

} // namespace arhost::camera
