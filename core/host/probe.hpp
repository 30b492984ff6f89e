// SPDX-License-Identifier: Apache-2.0
//
// Asks a plugin, in a worker of its own, who it is: for `arhost plugins` and `arhost check`.
#pragma once

#include "ring/json_abi.hpp"
#include "sandbox/sandbox.hpp"
#include "supervise/process.hpp"

#include <filesystem>
#include <string>
#include <variant>

namespace arhost::host {

// The description, or the reason why the plugin can't be used.
using ProbeResult = std::variant<ring::PluginDescription, std::string>;

// It may read what `policy` says and write nothing: who it is, a plugin tells before it is asked to do anything.
// Where it answers, `level` gets how far the sandbox was reached.
ProbeResult probe(supervise::Context &context, const std::filesystem::path &plugin, sandbox::Policy policy,
                  std::string *level = nullptr);

} // namespace arhost::host
