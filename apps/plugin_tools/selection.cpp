// SPDX-License-Identifier: Apache-2.0
#include "plugin_tools/selection.hpp"

#include "base/program.hpp"
#include "base/text.hpp"
#include "run_config/plugin_path.hpp"

#include <cstdio>

namespace arhost::plugin_tools {
namespace {

void log(arhost_severity severity, const std::string &component, const std::string &text) {
    if (severity < ARHOST_SEVERITY_INFO)
        return;
    const char *level = severity >= ARHOST_SEVERITY_ERROR     ? "error"
                        : severity == ARHOST_SEVERITY_WARNING ? "warning"
                                                              : "info";
    const char *blame = severity == ARHOST_SEVERITY_PLUGIN_MISBEHAVING ? "the plugin misbehaves: "
                        : severity == ARHOST_SEVERITY_HOST_MISBEHAVING ? "the host misbehaves: "
                                                                       : "";
    std::fprintf(stderr, "%s: %s: %s%s\n", level, component.c_str(), blame, base::printable(text).c_str());
}

} // namespace

std::filesystem::path built_in_plugins() {
    return base::own_prefix() / "lib/arhost/plugins";
}

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
        for (const std::string &name : names_)
            files.push_back(path.find(name));
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

Workers::Workers()
    : launcher_(base::own_folder() / "arhost-launcher"), context_{reactor_, launcher_,
                                                                  base::own_folder() / "arhost-worker", log} {}

} // namespace arhost::plugin_tools
