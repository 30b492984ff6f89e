// SPDX-License-Identifier: Apache-2.0
#include "run_config/plugin_path.hpp"

#include "base/text.hpp"

#include <algorithm>
#include <cstdlib>
#include <map>
#include <sstream>
#include <stdexcept>

namespace arhost::run_config {

namespace fs = std::filesystem;

PluginPath::PluginPath(std::vector<fs::path> extra, fs::path built_in) : folders_(std::move(extra)) {
    if (const char *variable = std::getenv("ARHOST_PLUGIN_PATH")) {
        std::istringstream list(variable);
        for (std::string folder; std::getline(list, folder, ':');)
            if (!folder.empty())
                folders_.push_back(fs::absolute(folder));
    }
    folders_.push_back(std::move(built_in));
}

fs::path PluginPath::resolve(const yaml::Node &node) const {
    const std::string name = node.text();
    std::error_code ignored;
    if (name.find('/') != std::string::npos || name.ends_with(".so")) {
        fs::path file = node.input_path();
        if (!fs::is_regular_file(file, ignored))
            node.fail("there is no plugin '" + file.string() + "'");
        return file;
    }
    try {
        return find(name);
    } catch (const std::runtime_error &error) {
        node.fail(error.what());
    }
}

fs::path PluginPath::find(const std::string &name) const {
    std::error_code ignored;
    for (const fs::path &folder : folders_)
        if (fs::path file = folder / (name + ".so"); fs::is_regular_file(file, ignored))
            return file;
    const std::vector<fs::path> files = all();
    std::vector<std::string> known(files.size());
    std::transform(files.begin(), files.end(), known.begin(),
                   [](const fs::path &file) { return file.stem().string(); });
    const std::vector<std::string_view> candidates(known.begin(), known.end());
    const std::string near = base::nearest(name, candidates);
    std::string folders;
    for (const fs::path &folder : folders_)
        folders += (folders.empty() ? "" : ", ") + folder.string();
    throw std::runtime_error("there is no plugin '" + name + "'" +
                             (near.empty() ? "" : "; did you mean '" + near + "'?") + " (searched " + folders +
                             "; 'arhost plugins' lists all)");
}

std::vector<fs::path> PluginPath::all() const {
    std::map<std::string, fs::path> found;
    std::error_code ignored;
    for (const fs::path &folder : folders_)
        for (const auto &entry : fs::directory_iterator(folder, ignored))
            if (entry.path().extension() == ".so")
                found.emplace(entry.path().stem().string(), entry.path());
    std::vector<fs::path> files;
    files.reserve(found.size());
    for (const auto &[name, file] : found)
        files.push_back(file);
    return files;
}

} // namespace arhost::run_config
