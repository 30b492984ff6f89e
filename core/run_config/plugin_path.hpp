// SPDX-License-Identifier: Apache-2.0
//
// Search path for plugins.
#pragma once

#include "yaml/yaml.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace arhost::run_config {

class PluginPath {
public:
    // Search order: `extra`, the colon-separated environment variable ARHOST_PLUGIN_PATH, `built_in`.
    PluginPath(std::vector<std::filesystem::path> extra, std::filesystem::path built_in);

    // Returns the shared object for the value of `node`: a plugin name, or a path (contains "/" or ends in ".so")
    // that is relative to the configuration file. Throws yaml::Error if the file does not exist.
    std::filesystem::path resolve(const yaml::Node &node) const;

    // Returns the shared object of the plugin with this name. Throws std::runtime_error if there is none.
    std::filesystem::path find(const std::string &name) const;

    // Returns all plugin files. Of files with the same name, only the first in search order is included.
    std::vector<std::filesystem::path> all() const;

private:
    std::vector<std::filesystem::path> folders_;
};

} // namespace arhost::run_config
