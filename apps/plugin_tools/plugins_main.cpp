// SPDX-License-Identifier: Apache-2.0
//
// arhost-plugins lists the plugins. `arhost plugins` runs it.
#include "base/program.hpp"
#include "base/text.hpp"
#include "plugin_tools/selection.hpp"
#include "plugin_tools/workers.hpp"
#include "supervise/probe.hpp"

#include <fmt/format.h>

#include <cstdio>

namespace {

using namespace arhost;

void print(const std::string &line) {
    std::printf("%s\n", base::printable(line).c_str());
}

void print(const model::PluginDescription &plugin, const std::string &file, bool with_options) {
    print(fmt::format("{:<18} {:<10} {:<8} {}", plugin.short_name(), model::to_text(plugin.kind), plugin.version,
                      file));
    print(fmt::format("{:<18} {}", "", plugin.description));
    for (const std::string &need : plugin.needs)
        print(fmt::format("{:<18} needs 'allow: [{}]'", "", need));
    if (!with_options)
        return;
    for (const model::OptionDeclaration &option : plugin.options) {
        const std::string standard = option.default_value ? "default '" + *option.default_value + "'" : "required";
        print(fmt::format("    {:<20} {} ({})", option.key, option.help, standard));
        if (!option.choices.empty())
            print(fmt::format("    {:<20} one of: {}", "", fmt::join(option.choices, " ")));
    }
}

int list_plugins(const plugin_tools::Selection &selection, bool with_options) {
    plugin_tools::Workers workers;
    const std::vector<std::filesystem::path> files = selection.files();
    int status = base::success;
    std::string level;
    for (const std::filesystem::path &file : files) {
        const supervise::ProbeResult result = probe(workers.context(), file, selection.policy(), &level);
        if (const auto *reason = std::get_if<std::string>(&result)) {
            print(fmt::format("{:<18} cannot be used: {}", file.stem().string(), *reason));
            status = base::failed;
        } else {
            print(std::get<model::PluginDescription>(result), file.string(), with_options);
        }
    }
    if (!level.empty())
        std::printf("\nsandbox on this machine: %s\n", level.c_str());
    if (files.empty())
        print("no plugins in " + plugin_tools::built_in_plugins().string());
    return status;
}

} // namespace

int main(int argc, char **argv) {
    base::prepare_process();
    arhost::command_line::CommandLine app("List the plugins; for unusable ones, print the reason", "arhost plugins");
    plugin_tools::Selection selection;
    bool with_options = false;
    selection.add_names(app, "List only these plugins");
    app.flag("--options", with_options, "Also list the options of each plugin");
    selection.add_reads(app);
    return base::exit_status_of([&] {
        const auto status = app.parse(argc, argv);
        return status ? *status : list_plugins(selection, with_options);
    });
}
