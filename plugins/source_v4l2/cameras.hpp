// SPDX-License-Identifier: Apache-2.0
//
// Lists the V4L2 cameras, for arhost/devices.h.
#pragma once

#include <arhost-cpp/plugin.hpp>

#include <vector>

namespace arhost {

// Only with formats that this plugin can capture, by the names of the option `format`. Nodes that deliver no pictures
// are left out, unless they cannot be opened.
std::vector<Device> list_cameras();

} // namespace arhost
