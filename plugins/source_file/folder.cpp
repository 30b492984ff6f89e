// SPDX-License-Identifier: Apache-2.0
#include "folder.hpp"

#include <set>

namespace arhost {

namespace fs = std::filesystem;

std::string quoted(const fs::path &path) {
    std::string text(1, '\'');
    return text.append(path.string()).append(1, '\'');
}

std::string describe_folder(const fs::path &folder) {
    std::error_code error;
    std::set<std::string> names;
    for (const auto &entry : fs::directory_iterator(folder, error))
        names.insert(entry.path().filename().string());
    if (error)
        return "the folder " + quoted(folder) + " cannot be listed: " + error.message();
    if (names.empty())
        return "the folder " + quoted(folder) + " is empty";
    std::string text = "the folder " + quoted(folder) + " has " + std::to_string(names.size()) +
                       (names.size() == 1 ? " entry:" : " entries:");
    constexpr std::size_t shown = 4;
    std::size_t i = 0;
    for (const std::string &name : names) {
        if (i == shown)
            return text + " …";
        text += (i++ ? ", " : " ") + name;
    }
    return text;
}

} // namespace arhost
