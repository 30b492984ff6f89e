// SPDX-License-Identifier: Apache-2.0
//
// Reads the camera parameters of ARToolKit and artoolkitX (camera_para.dat).
#pragma once

#include <arhost/camera.h>

#include <string>
#include <string_view>

namespace arhost::camera {

// Converts the contents of a file; `name` is its name in error messages. Throws yaml::Error if the contents are
// invalid, or if no lens of arhost agrees with the file's lens within 0.1 px in the whole image.
arhost_intrinsics parse_artoolkit(std::string_view bytes, const std::string &name);

} // namespace arhost::camera
