// SPDX-License-Identifier: Apache-2.0
//
// What a component's worker may touch, out of the configuration alone: what a plugin says about itself is
// known only when its code has run.
#pragma once

#include "sandbox/sandbox.hpp"
#include "yaml/yaml.hpp"

namespace arhost::run_config {

// Of the component at `node`: `allow`, `reads`, `writes`, `path` (an output's folder may be written, a
// source's file read), and each option whose value is the name of a file or folder that is there, which may
// be read. Throws yaml::Error.
sandbox::Policy access_of(const yaml::Node &node, bool is_output);

// The component's `path`, which may stand among its options.
std::optional<yaml::Node> path_of(const yaml::Node &component);

// Where an output's `path` lets its plugin write more than anybody may mean: in the whole home or working directory.
// A sentence, or "".
std::string warning_of_output(const yaml::Node &path, const std::string &plugin);

} // namespace arhost::run_config
