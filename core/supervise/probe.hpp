// SPDX-License-Identifier: Apache-2.0
//
// Questions to a plugin, asked in a worker that lives only for the answer.
#pragma once

#include "supervise/process.hpp"

#include <chrono>
#include <filesystem>
#include <functional>
#include <string>
#include <variant>

namespace arhost::supervise {

// Opens the plugin in a worker and passes the worker's messages to `on_message` until it returns true. The plugin may
// read what `policy` permits, but write nothing. Returns "" or the reason for the failure.
std::string query(Context &context, const std::filesystem::path &plugin, sandbox::Policy policy,
                  std::chrono::seconds timeout,
                  const std::function<bool(Process &, const ipc::Message &)> &on_message);

// The plugin's description, or the reason why the plugin cannot be used.
using ProbeResult = std::variant<model::PluginDescription, std::string>;

// Opens the plugin in a worker and returns its description. On success, the sandbox level that the worker reached is
// stored in `level`.
ProbeResult probe(Context &context, const std::filesystem::path &plugin, const sandbox::Policy &policy,
                  std::string *level = nullptr);

} // namespace arhost::supervise
