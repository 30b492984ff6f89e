// SPDX-License-Identifier: Apache-2.0
#include "plugin_tools/selection.hpp"

#include "base/program.hpp"
#include "plugin_tools/workers.hpp"
#include "run_config/plugin_path.hpp"

namespace arhost::plugin_tools {

void Selection::add_names(arhost::command_line::CommandLine &app, const std::string &help) {
    app.option("PLUGIN", names_, help);
}

void Selection::add_reads(arhost::command_line::CommandLine &app) {
    app.option("--reads", reads_, "A folder with libraries that the plugins need (repeatable)")
        .existing_path()
        .check(sandbox::obstacle_to_grant)
        .type_name("FOLDER")
        .one_value_each();
}

std::vector<std::filesystem::path> Selection::files() const {
    const run_config::PluginPath path({}, built_in_plugins());
    if (names_.empty())
        return path.all();
    std::vector<std::filesystem::path> files;
    try {
        for (const std::string &name : names_) { // or a path, as in configurations
            std::error_code ignored;
            const bool is_path = name.find('/') != std::string::npos || name.ends_with(".so");
            files.push_back(is_path && std::filesystem::is_regular_file(name, ignored)
                                ? std::filesystem::absolute(name)
                                : path.find(name));
        }
    } catch (const std::runtime_error &error) {
        throw base::InvalidInput(error.what());
    }
    return files;
}

sandbox::Policy Selection::policy() const {
    sandbox::Policy policy;
    for (const std::filesystem::path &path : reads_)
        policy.readable.push_back(std::filesystem::absolute(path));
    return policy;
}

} // namespace arhost::plugin_tools
