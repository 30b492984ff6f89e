// SPDX-License-Identifier: Apache-2.0
#include "host/documents.hpp"
#include "host/outcome.hpp"
#include "host/outputs.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>

namespace arhost::host {

using namespace ipc;
using namespace model;
using supervise::Component;
using Json = nlohmann::ordered_json;

namespace {

const char *to_text(Component::State state) {
    switch (state) {
    case Component::State::idle:
    case Component::State::starting:
        return "starting";
    case Component::State::running:
        return "running";
    case Component::State::waiting:
        return "restarting";
    case Component::State::disabled:
        return "disabled";
    case Component::State::stopped:
        return "stopped";
    }
    return "";
}

const char *to_text(const arhost_target &target) {
    return target.state == ARHOST_TARGET_DETECTED    ? "detected"
           : target.state == ARHOST_TARGET_PREDICTED ? "predicted"
                                                     : "lost";
}

Json value_of(const OptionValue &value) {
    switch (value.type) {
    case ARHOST_OPTION_BOOL:
        return value.integer != 0;
    case ARHOST_OPTION_INTEGER:
        return value.integer;
    case ARHOST_OPTION_REAL:
        return value.real;
    default:
        return value.text;
    }
}

const char *type_text(arhost_option_type type) {
    switch (type) {
    case ARHOST_OPTION_BOOL:
        return "boolean";
    case ARHOST_OPTION_INTEGER:
        return "integer";
    case ARHOST_OPTION_REAL:
        return "real";
    default:
        return "text";
    }
}

// Describes the options that the command `set` can change.
Json changeable_options(const PluginDescription &plugin, const std::vector<OptionValue> &values) {
    Json options = Json::array();
    for (std::size_t i = 0; i < std::min(plugin.options.size(), values.size()); ++i) {
        const OptionDeclaration &declared = plugin.options[i];
        if (!std::ranges::count(plugin.changeable, declared.key))
            continue;
        Json option = {{"option", declared.key},
                       {"type", type_text(declared.type)},
                       {"value", value_of(values[i])},
                       {"help", declared.help}};
        if (declared.minimum != 0 || declared.maximum != 0)
            for (const auto &[key, bound] : {std::pair{"minimum", declared.minimum}, {"maximum", declared.maximum}})
                option[key] =
                    declared.type == ARHOST_OPTION_INTEGER ? Json(static_cast<std::int64_t>(bound)) : Json(bound);
        if (!declared.choices.empty())
            option["choices"] = declared.choices;
        options.push_back(std::move(option));
    }
    return options;
}

template <class Choice> Json names_of(const std::vector<Choice> &choices) {
    Json names = Json::array();
    for (const Choice &choice : choices)
        names.push_back(choice.name);
    return names;
}

Json component_json(const Component &component, const ComponentOptions &options) {
    const PluginDescription &plugin = component.description();
    Json json = {{"name", component.name()},         {"plugin", plugin.short_name()},
                 {"version", plugin.version},        {"state", to_text(component.state())},
                 {"restarts", component.restarts()}, {"sandbox", component.sandbox_level()},
                 {"counters", component.counters()}};
    json["missing_device"] = component.missing_device().empty() ? Json() : Json(component.missing_device());
    const ComponentOptions::InUse *const in_use = options.of(component);
    json["options"] = in_use ? changeable_options(plugin, in_use->values) : Json::array();
    return json;
}

Json target_json(const arhost_target &target) {
    return {{"name", target.name},
            {"state", to_text(target)},
            {"distance_mm", std::hypot(target.mt[12], target.mt[13], target.mt[14])},
            {"reprojection_px", target.reprojection_px}};
}

} // namespace

Json status_json(const RunParts &parts, const Assembly &assembly, const Outputs &outputs) {
    const Statistics &statistics = parts.statistics;
    const run_config::Configuration &latest = *assembly.latest();
    const Tracker *const tracker = assembly.tracker();
    const std::string missing = tracker && tracker->running() && !parts.flow.is_frozen()
                                    ? missing_target(parts.configuration, statistics,
                                                     tracker->configuration()->targets, parts.context.reactor.now())
                                    : "";
    Json targets = Json::array();
    constexpr std::size_t max_poses = 64; // the status must fit into a message to a worker, as must the paths below
    std::size_t poses = 0;
    for (const arhost_target &target : parts.flow.last_targets()) {
        targets.push_back(target_json(target));
        if (is_visible(target) && poses++ < max_poses)
            targets.back()["mt"] = target.mt;
    }
    Json stages = Json::object();
    for (const auto &[name, timing] : statistics.stages.recent())
        stages[name] = timing.to_json();
    Json components = Json::array();
    if (const Component *source = assembly.source().component())
        components.push_back(component_json(*source, parts.options));
    const auto add_stage = [&](const auto *stage, const auto &choices) {
        if (!stage)
            return;
        components.push_back(component_json(stage->component(), parts.options));
        components.back().update({{"choice", stage->configuration()->name}, {"choices", names_of(choices)}});
    };
    add_stage(assembly.tracker(), latest.trackers);
    add_stage(assembly.raytracer(), latest.raytracers);
    Json recording = nullptr;
    for (const auto &sink : outputs.sinks()) {
        components.push_back(component_json(*sink->component, parts.options));
        if (sink->on_demand && sink->component->name() == "record" && !sink->closed)
            recording = sink->path;
    }
    constexpr std::size_t max_path_bytes = 16 * 1024;
    std::size_t path_bytes = 0;
    Json files = Json::array();
    for (auto each = outputs.files().rbegin(); each != outputs.files().rend(); ++each)
        if ((path_bytes += each->second.size()) <= max_path_bytes)
            files.insert(files.begin(), Json({{"number", each->first}, {"file", each->second}}));
    return {{"arhost", ARHOST_VERSION},
            {"mode", parts.live() ? "live" : "lockstep"},
            {"frozen", parts.flow.is_frozen()},
            {"fps", statistics.stages.recent_rate("latency")},
            {"frames",
             {{"in", statistics.frames_in},
              {"tracked", statistics.tracked},
              {"augmented", statistics.augmented},
              {"composited", statistics.composited},
              {"dropped", statistics.dropped},
              {"passed_unaugmented", statistics.skipped}}},
            {"stages", std::move(stages)},
            {"latency", latency_json(statistics, statistics.latencies.recent())},
            {"quality", quality_json(statistics)},
            {"targets", std::move(targets)},
            {"missing_target", missing.empty() ? Json() : Json(missing)},
            {"components", std::move(components)},
            {"scene", assembly.raytracer() ? Json(assembly.raytracer()->scene()->source.name) : Json(nullptr)},
            {"scenes", names_of(latest.scenes)},
            {"recording", std::move(recording)},
            {"files", std::move(files)},
            {"messages", parts.messages.to_json()}};
}

} // namespace arhost::host
