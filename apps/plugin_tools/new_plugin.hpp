// SPDX-License-Identifier: Apache-2.0
//
// `arhost new-plugin`: creates a working plugin from the SDK's templates (sdk/templates/).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace arhost::plugin_tools {

inline const std::vector<std::string> plugin_kinds = {"raytracer", "tracker", "source", "sink"};
inline const std::vector<std::string> plugin_languages = {"c", "cpp", "rust", "python"};

struct NewPlugin {
    std::string kind, name, language; // kind and language from the lists above
    std::filesystem::path into = "."; // parent of the new folder
};

// Creates the plugin's folder atomically. `prefix` is the folder in which arhost is installed. Returns the exit
// status; throws std::runtime_error.
int new_plugin(const NewPlugin &plugin, const std::filesystem::path &prefix);

} // namespace arhost::plugin_tools
