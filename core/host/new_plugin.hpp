// SPDX-License-Identifier: Apache-2.0
//
// `arhost new-plugin`: a working plugin to begin with, out of the SDK's templates (sdk/templates/).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace arhost::host {

inline const std::vector<std::string> plugin_kinds = {"raytracer", "tracker", "source", "sink"};
inline const std::vector<std::string> plugin_languages = {"c", "cpp", "rust", "python"};

struct NewPlugin {
    std::string kind, name, language; // of the lists above; the name is checked
    std::filesystem::path into = "."; // the folder `name` is made in there
};

// Makes the folder, whole or not at all. `prefix` is where arhost is installed. Returns the exit status; throws
// std::runtime_error with what to mend.
int new_plugin(const NewPlugin &plugin, const std::filesystem::path &prefix);

} // namespace arhost::host
