// SPDX-License-Identifier: Apache-2.0
//
// Queries a plugin's description and devices in a worker, for `arhost plugins`, `check` and `devices`.
#pragma once

#include "ipc/device_list.hpp"
#include "ipc/json_abi.hpp"
#include "sandbox/sandbox.hpp"
#include "supervise/process.hpp"

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <variant>

namespace arhost::host {

// The plugin's description, or the reason why the plugin cannot be used.
using ProbeResult = std::variant<ipc::PluginDescription, std::string>;

// Opens the plugin in a worker and returns its description. The plugin may read what `policy` permits, but write
// nothing. On success, the sandbox level that the worker reached is stored in `level`.
ProbeResult probe(supervise::Context &context, const std::filesystem::path &plugin, sandbox::Policy policy,
                  std::string *level = nullptr);

// The plugin's devices; nullopt if the plugin does not implement arhost/devices.h; or the reason why the devices
// cannot be listed.
using DevicesResult = std::variant<std::optional<ipc::DeviceList>, std::string>;

// Asks the plugin in a worker for its devices. Of the permissions in `needs` (from the plugin's descriptor), only
// those for devices are granted, and not network and processes. The timeout is long because drivers may load slowly.
DevicesResult list_devices(supervise::Context &context, const std::filesystem::path &plugin, sandbox::Policy policy,
                           const std::vector<std::string> &needs,
                           std::chrono::seconds timeout = std::chrono::seconds(20));

} // namespace arhost::host
