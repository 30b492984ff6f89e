// SPDX-License-Identifier: Apache-2.0
//
// Checks configured options against the options that a plugin declares.
#pragma once

#include "ipc/json_abi.hpp"
#include "yaml/yaml.hpp"

#include <optional>
#include <vector>

namespace arhost::run_config {

// A value for every declared option, in the descriptor's order. `options`: the YAML map, if any. `path`: the
// component's `path:` key, a shorthand for the option of that name. Throws yaml::Error for unknown keys, wrong types,
// values out of range, and missing required options; the latter error names `owner`.
std::vector<ipc::OptionValue> resolve_options(const ipc::PluginDescription &plugin,
                                              const std::optional<yaml::Node> &options,
                                              const std::optional<yaml::Node> &path, const yaml::Node &owner);

} // namespace arhost::run_config
