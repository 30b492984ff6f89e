// SPDX-License-Identifier: Apache-2.0
#include "view/plugin.hpp"

#include "base/program.hpp"
#include "base/text.hpp"
#include "run_config/options.hpp"
#include "run_config/plugin_path.hpp"
#include "view/interruption.hpp"
#include "worker/library.hpp"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <vector>

namespace arhost::view {
namespace {

constexpr arhost_host host = {sizeof(arhost_host),
                              ARHOST_ABI_VERSION,
                              "arhost-view",
                              ARHOST_VERSION,
                              nullptr,
                              [](const arhost_host *, arhost_severity severity, const char *text) {
                                  if (severity >= ARHOST_SEVERITY_WARNING && interruption == 0)
                                      std::fprintf(stderr, "%s\n", base::printable(text ? text : "").c_str());
                              },
                              [](const arhost_host *, double, const char *) {},
                              [](const arhost_host *) -> std::int32_t { return interruption != 0; },
                              [](const arhost_host *, const char *) -> const void * { return nullptr; }};

} // namespace

yaml::Node OptionSettings::node() const {
    yaml::Node options = yaml::Node::parse("{}", "options");
    for (const auto &[key, number] : numbers) {
        std::string option = "--" + key;
        std::ranges::replace(option, '_', '-');
        options.override_value(key, std::to_string(number), option);
    }
    for (const std::string &setting : settings) {
        const std::size_t equals = setting.find('=');
        if (equals == 0 || equals == std::string::npos)
            throw base::InvalidInput("--set " + setting + ": the argument must be key=value, as in --set samples=4");
        options.override_value(setting.substr(0, equals), setting.substr(equals + 1));
    }
    return options;
}

Plugin::Plugin(const std::string &name, const std::string &option, arhost_kind kind, const OptionSettings &settings,
               const Defaults &defaults) {
    yaml::Node options = settings.node();
    const yaml::Node requested = yaml::Node::scalar(name, option);
    const std::filesystem::path file =
        run_config::PluginPath({}, base::own_prefix() / "lib/arhost/plugins").resolve(requested);
    plugin_ = &worker::negotiate(file, worker::open_library(file));
    description_ = model::describe(*plugin_->descriptor);
    model::check(description_);
    if (description_.kind != kind)
        requested.fail("'" + description_.short_name() + "' is a " + model::to_text(description_.kind) + ", not a " +
                       (kind == ARHOST_KIND_RAYTRACER ? "ray tracer" : model::to_text(kind)));
    if (defaults)
        defaults(options, description_);
    std::vector<std::string> notes;
    const std::vector<model::OptionValue> values =
        run_config::resolve_options(description_, options, std::nullopt, requested, notes);
    for (const std::string &note : notes)
        std::fprintf(stderr, "warning: %s\n", base::printable(note).c_str());
    std::vector<arhost_option> passed;
    passed.reserve(values.size());
    for (const model::OptionValue &v : values)
        passed.push_back({sizeof(arhost_option), v.type, v.key.c_str(), v.integer, v.real, v.text.c_str()});
    expect_ok("create", plugin_->create(&host, passed.data(), static_cast<std::uint32_t>(passed.size()), &instance_));
    if (!instance_)
        throw std::runtime_error(description_.short_name() +
                                 ": the function create returned ARHOST_STATUS_OK, but no instance");
}

void Plugin::expect_ok(const char *call, arhost_status status) const {
    if (status == ARHOST_STATUS_OK)
        return;
    throw_if_interrupted();
    // the plugin has logged the reason
    throw std::runtime_error(description_.short_name() + ": " + call + ": " + model::status_text(status));
}

} // namespace arhost::view
