// SPDX-License-Identifier: Apache-2.0
//
// Asks a plugin in a worker for its devices.
#pragma once

#include "devices/device_list.hpp"
#include "supervise/process.hpp"

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <variant>
#include <vector>

namespace arhost::plugin_tools {

// The plugin's devices; or nullopt if the plugin does not implement arhost/devices.h; or the reason why the devices
// cannot be listed.
using DevicesResult = std::variant<std::optional<devices::DeviceList>, std::string>;

// Grants only the permissions in `needs` (from the plugin's descriptor) that concern devices, not network and
// processes. The timeout is long because drivers may load slowly.
DevicesResult list_devices(supervise::Context &context, const std::filesystem::path &plugin, sandbox::Policy policy,
                           const std::vector<std::string> &needs,
                           std::chrono::seconds timeout = std::chrono::seconds(20));

} // namespace arhost::plugin_tools
