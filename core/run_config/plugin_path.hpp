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

    // The shared object for a plugin name, or for a path (with a "/" or ending in ".so") relative to the
    // configuration file. Throws yaml::Error if it does not exist.
    std::filesystem::path resolve(const yaml::Node &node) const;

    // All plugin files; for duplicate names, the first in search order.
    std::vector<std::filesystem::path> all() const;

private:
    std::vector<std::filesystem::path> folders_;
};

} // namespace arhost::run_config
