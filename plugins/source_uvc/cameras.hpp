// SPDX-License-Identifier: Apache-2.0
//
// Lists the USB cameras, for arhost/devices.h.
#pragma once

#include <arhost-cpp/plugin.hpp>

#include <vector>

namespace arhost::uvc {

// Only with formats that this plugin can capture, by the names of the option `format`, and with controls only if no
// driver uses the camera: a listing does not take it from the kernel's driver or from a program that captures.
std::vector<Device> list_cameras();

} // namespace arhost::uvc
