// SPDX-License-Identifier: Apache-2.0
//
// Checks configured options against the options that a plugin declares.
#pragma once

#include "model/plugin_description.hpp"
#include "yaml/yaml.hpp"

#include <optional>
#include <vector>

namespace arhost::run_config {

// Returns the value of `node` as a value of the declared option. Throws yaml::Error.
model::OptionValue value_of(const model::OptionDeclaration &declared, const yaml::Node &node);

// Returns a value for every option that the plugin declares, in the order of the descriptor. `options` is the YAML
// map of the configured options, if any. `path` is the component's key `path:`, which sets the option of the same
// name. Throws yaml::Error for unknown keys, wrong types, values out of range, and missing required options. The
// error for a missing option has the position of `owner`. Unknown options and choices, and an unknown `path`, may be
// left over from another plugin. They only add a note, unless they resemble a known option or choice, or the
// plugin accepts connections.
std::vector<model::OptionValue> resolve_options(const model::PluginDescription &plugin,
                                                const std::optional<yaml::Node> &options,
                                                const std::optional<yaml::Node> &path, const yaml::Node &owner,
                                                std::vector<std::string> &notes);

} // namespace arhost::run_config
