// SPDX-License-Identifier: Apache-2.0
//
// A plugin's options: what the configuration gives against what the plugin's descriptor declares.
#pragma once

#include "ipc/json_abi.hpp"
#include "yaml/yaml.hpp"

#include <optional>
#include <vector>

namespace arhost::run_config {

// A value for every declared option, in the descriptor's order. `options` is the YAML map, or nothing;
// `path` is the component's own `path:` key, which stands for the option of that name. Throws yaml::Error
// for unknown keys, wrong types and ranges, missing required options; `owner` is named in the latter.
std::vector<ipc::OptionValue> resolve_options(const ipc::PluginDescription &plugin,
                                              const std::optional<yaml::Node> &options,
                                              const std::optional<yaml::Node> &path, const yaml::Node &owner);

} // namespace arhost::run_config
