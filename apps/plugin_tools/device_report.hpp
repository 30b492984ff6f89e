// SPDX-License-Identifier: Apache-2.0
//
// The output of `arhost devices`, as text and as JSON (docs/devices.schema.json).
#pragma once

#include "devices/device_list.hpp"

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace arhost::plugin_tools {

// The answer of one plugin to `arhost devices`.
struct PluginDevices {
    std::string plugin;
    arhost_kind kind = 0;
    devices::DeviceList list;
    std::string problem; // why the plugin cannot list its devices; "" if it can
};

// Returns the processes that have opened a character device, if this user may see them: "ffmpeg (process 1234)".
std::vector<std::string> holders_of(const std::filesystem::path &node);

// Returns why the device cannot be opened and what to do; "" if it can be opened. A worker cannot see other
// processes. Therefore the host looks for the processes that use a busy device, and for the group that may open a
// forbidden device.
std::string problem_with(const devices::DeviceDescription &device);

nlohmann::ordered_json devices_as_json(const std::vector<PluginDevices> &plugins);
// Returns one line per element. Texts of plugins are printable, but the texts of `problem` may contain other
// characters.
std::vector<std::string> devices_as_text(const std::vector<PluginDevices> &plugins);

} // namespace arhost::plugin_tools
