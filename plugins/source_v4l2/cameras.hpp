// SPDX-License-Identifier: Apache-2.0
//
// Lists the V4L2 cameras, for arhost/devices.h.
#pragma once

#include <arhost-cpp/plugin.hpp>

#include <vector>

namespace arhost {

// Lists the cameras with the formats that this plugin can capture, named as in the option `format`. Omits nodes that
// deliver no pictures, unless they cannot be opened.
std::vector<Device> list_cameras();

} // namespace arhost
