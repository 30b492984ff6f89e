// SPDX-License-Identifier: Apache-2.0
//
// Computes a component's sandbox policy. Uses only the configuration, because a plugin's descriptor is not known
// before the plugin's code has run.
#pragma once

#include "sandbox/sandbox.hpp"
#include "yaml/yaml.hpp"

namespace arhost::run_config {

// Returns the sandbox policy of the component at `node`, computed from `allow`, `usb`, `reads`, `writes`,
// `environment`, `path` (an output may write to its folder, a source may read the file), and options whose value is
// an existing file or folder (readable). Throws yaml::Error.
sandbox::Policy access_of(const yaml::Node &node, bool is_output, sandbox::Mode mode);

// Returns the component's `path`, which may be a key of the component or one of its options.
std::optional<yaml::Node> path_of(const yaml::Node &component);

// Whether an output's `path` names standard output.
bool is_standard_output(const yaml::Node &path);

// Returns a warning if an output's `path` makes the entire home directory or working directory writable, otherwise
// "".
std::string warning_of_output(const yaml::Node &path, const std::string &plugin);

// Returns a warning, in the format of the errors of yaml::Node.
std::string warning_at(const yaml::Node &node, const std::string &message);

} // namespace arhost::run_config
