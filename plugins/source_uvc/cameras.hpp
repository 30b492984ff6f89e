// SPDX-License-Identifier: Apache-2.0
//
// Lists the USB cameras, for arhost/devices.h.
#pragma once

#include <arhost-cpp/plugin.hpp>

#include <vector>

namespace arhost::uvc {

// Lists the cameras with the formats that this plugin can capture, named as in the option `format`. Lists the
// controls only if no driver uses the camera, because the listing must not take the camera from the kernel's driver
// or from a program that captures.
std::vector<Device> list_cameras();

} // namespace arhost::uvc
