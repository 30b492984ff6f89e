// SPDX-License-Identifier: Apache-2.0
//
// A component's sandbox policy. Derived from the configuration only, as a plugin's descriptor is known only after its
// code has run.
#pragma once

#include "sandbox/sandbox.hpp"
#include "yaml/yaml.hpp"

namespace arhost::run_config {

// The policy of the component at `node`, from `allow`, `reads`, `writes`, `environment`, `path` (an output may write
// to its folder, a source may read the file), and options whose value is an existing file or folder (readable).
// Throws yaml::Error.
sandbox::Policy access_of(const yaml::Node &node, bool is_output);

// The component's `path`, which may also be in its options.
std::optional<yaml::Node> path_of(const yaml::Node &component);

// A warning if an output's `path` makes the whole home or working directory writable, else "".
std::string warning_of_output(const yaml::Node &path, const std::string &plugin);

} // namespace arhost::run_config
