// SPDX-License-Identifier: Apache-2.0
//
// Where plugins are looked for.
#pragma once

#include "yaml/yaml.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace arhost::run_config {

class PluginPath {
public:
    // In this order: `extra`, the folders of the environment variable ARHOST_PLUGIN_PATH (colons between
    // them), and `built_in`.
    PluginPath(std::vector<std::filesystem::path> extra, std::filesystem::path built_in);

    // The shared object that `node` names: a plugin's name, or a path (it has a "/" or ends in ".so")
    // relative to the configuration's folder. Fails on the node where there is none.
    std::filesystem::path resolve(const yaml::Node &node) const;

    // Every plugin file there is; of two with one name the first found.
    std::vector<std::filesystem::path> all() const;

private:
    std::vector<std::filesystem::path> folders_;
};

} // namespace arhost::run_config
