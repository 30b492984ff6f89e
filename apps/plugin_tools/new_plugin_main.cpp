// SPDX-License-Identifier: Apache-2.0
//
// arhost-new-plugin creates a skeleton plugin. `arhost new-plugin` runs it.
#include "base/program.hpp"
#include "command_line/command_line.hpp"
#include "plugin_tools/new_plugin.hpp"

int main(int argc, char **argv) {
    using namespace arhost;
    base::prepare_process();
    arhost::command_line::CommandLine app("Create a working skeleton plugin (docs/backend-guide.md)",
                                          "arhost new-plugin");
    plugin_tools::NewPlugin plugin;
    app.option("KIND", plugin.kind, "Kind of plugin").required().one_of(plugin_tools::plugin_kinds);
    app.option("NAME", plugin.name, "Name of the plugin and its folder").required();
    app.option("--language", plugin.language, "Programming language")
        .required()
        .one_of(plugin_tools::plugin_languages);
    app.option("--into", plugin.into, "Parent folder (default: current folder)").type_name("DIR");
    return base::exit_status_of([&] {
        const auto status = app.parse(argc, argv);
        return status ? *status : new_plugin(plugin, base::own_prefix());
    });
}
