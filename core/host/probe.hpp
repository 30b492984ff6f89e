// SPDX-License-Identifier: Apache-2.0
//
// Asks a plugin, in a worker of its own, who it is and what it could run on: for `arhost plugins` and `arhost check`.
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

// The description, or the reason why the plugin can't be used.
using ProbeResult = std::variant<ipc::PluginDescription, std::string>;

// It may read what `policy` says and write nothing: who it is, a plugin tells before it is asked to do anything.
// Where it answers, `level` gets how far the sandbox was reached.
ProbeResult probe(supervise::Context &context, const std::filesystem::path &plugin, sandbox::Policy policy,
                  std::string *level = nullptr);

// The devices, nullopt where the plugin tells of none (arhost/devices.h), or the reason why it can't.
using DevicesResult = std::variant<std::optional<ipc::DeviceList>, std::string>;

// Of what it needs (its descriptor's `needs`) it gets the devices, which it could not see otherwise, without a word
// of a configuration; but no network, no processes and no display. Drivers may take long to load.
DevicesResult list_devices(supervise::Context &context, const std::filesystem::path &plugin, sandbox::Policy policy,
                           const std::vector<std::string> &needs,
                           std::chrono::seconds timeout = std::chrono::seconds(20));

} // namespace arhost::host
