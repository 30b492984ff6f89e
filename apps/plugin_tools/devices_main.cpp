// SPDX-License-Identifier: Apache-2.0
//
// arhost-devices lists the devices of the plugins. `arhost devices` runs it.
#include "base/program.hpp"
#include "base/text.hpp"
#include "plugin_tools/device_listing.hpp"
#include "plugin_tools/device_report.hpp"
#include "plugin_tools/selection.hpp"
#include "plugin_tools/workers.hpp"
#include "supervise/probe.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstdio>

namespace {

using namespace arhost;

// Returns nullopt if the plugin does not list devices.
std::optional<plugin_tools::PluginDevices> devices_of(supervise::Context &context, const std::filesystem::path &file,
                                                      const sandbox::Policy &policy) {
    plugin_tools::PluginDevices found;
    found.plugin = file.stem().string();
    const supervise::ProbeResult probed = probe(context, file, policy);
    if (const auto *reason = std::get_if<std::string>(&probed)) {
        found.problem = "cannot be used: " + *reason;
        return found;
    }
    const auto &plugin = std::get<model::PluginDescription>(probed);
    found.kind = plugin.kind;
    const plugin_tools::DevicesResult listed = plugin_tools::list_devices(context, file, policy, plugin.needs);
    if (const auto *reason = std::get_if<std::string>(&listed)) {
        found.problem = "cannot list its devices: " + *reason;
        return found;
    }
    const auto &list = std::get<std::optional<devices::DeviceList>>(listed);
    if (!list)
        return std::nullopt;
    found.list = *list;
    return found;
}

int list(const plugin_tools::Selection &selection, bool as_json) {
    plugin_tools::Workers workers;
    std::vector<plugin_tools::PluginDevices> found;
    for (const std::filesystem::path &file : selection.files())
        if (auto devices = devices_of(workers.context(), file, selection.policy()))
            found.push_back(std::move(*devices));
    if (as_json)
        std::printf(
            "%s\n",
            devices_as_json(found).dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace).c_str());
    else
        for (const std::string &line : devices_as_text(found))
            std::printf("%s\n", base::printable(line).c_str());
    const bool failed = std::ranges::any_of(found, [](const auto &each) { return !each.problem.empty(); });
    return failed ? base::failed : base::success;
}

} // namespace

int main(int argc, char **argv) {
    base::prepare_process();
    arhost::command_line::CommandLine app("List cameras, GPUs and displays; for unusable ones, print the reason",
                                          "arhost devices");
    plugin_tools::Selection selection;
    bool as_json = false;
    selection.add_names(app, "List only the devices of these plugins");
    app.flag("--json", as_json, "Print JSON (docs/devices.schema.json)");
    selection.add_reads(app);
    return base::exit_status_of([&] {
        const auto status = app.parse(argc, argv);
        return status ? *status : list(selection, as_json);
    });
}
