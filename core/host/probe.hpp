// SPDX-License-Identifier: Apache-2.0
//
// Queries a plugin's description and devices in a worker, for `arhost plugins` and `arhost check`.
#pragma once

#include "ipc/json_abi.hpp"
#include "sandbox/sandbox.hpp"
#include "supervise/process.hpp"

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <variant>

namespace arhost::host {

// The description, or why the plugin cannot be used.
using ProbeResult = std::variant<ipc::PluginDescription, std::string>;

// The plugin may read what `policy` permits and write nothing. On success, `level` receives the sandbox level
// reached.
ProbeResult probe(supervise::Context &context, const std::filesystem::path &plugin, sandbox::Policy policy,
                  std::string *level = nullptr);

// The devices, nullopt if the plugin lacks the extension (arhost/devices.h), or why they cannot be listed.
using DevicesResult = std::variant<std::optional<ipc::DeviceList>, std::string>;

// From `needs` (of the descriptor) it grants access to devices only, and not to network, processes and display. The
// timeout is long, as drivers may load slowly.
DevicesResult list_devices(supervise::Context &context, const std::filesystem::path &plugin, sandbox::Policy policy,
                           const std::vector<std::string> &needs,
                           std::chrono::seconds timeout = std::chrono::seconds(20));

} // namespace arhost::host
