// SPDX-License-Identifier: Apache-2.0
//
// The status document of a running pipeline (docs/control.md).
#include "host/pipeline.hpp"

#include <nlohmann/json.hpp>

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

} // namespace

Json Pipeline::status_of(const Component &component) const {
    const PluginDescription &plugin = component.description();
    Json json = {{"name", component.name()},         {"plugin", plugin.id},
                 {"version", plugin.version},        {"state", to_text(component.state())},
                 {"restarts", component.restarts()}, {"sandbox", component.sandbox_level()},
                 {"counters", component.counters()}};
    json["missing_device"] = component.missing_device().empty() ? Json() : Json(component.missing_device());
    const auto options = options_.find(&component);
    json["options"] = options == options_.end() ? Json::array() : changeable_options(plugin, options->second.values);
    return json;
}

Json Pipeline::status() const {
    Json targets = Json::array();
    for (const arhost_target &target : last_targets_)
        targets.push_back({{"name", target.name},
                           {"state", to_text(target)},
                           {"distance_mm", std::hypot(target.mt[12], target.mt[13], target.mt[14])},
                           {"reprojection_px", target.reprojection_px}});
    Json stages = Json::object();
    for (const auto &[name, timing] : statistics_.stages.recent())
        stages[name] = timing.to_json();
    Json components = Json::array();
    if (source_)
        components.push_back(status_of(*source_));
    if (tracker_) {
        components.push_back(status_of(*tracker_->component));
        components.back().update(
            {{"choice", tracker_->configuration->name}, {"choices", names_of(latest_->trackers)}});
    }
    if (raytracer_) {
        components.push_back(status_of(*raytracer_->component));
        components.back().update(
            {{"choice", raytracer_->configuration->name}, {"choices", names_of(latest_->raytracers)}});
    }
    Json recording = nullptr;
    for (const auto &sink : sinks_) {
        components.push_back(status_of(*sink->component));
        if (sink->on_demand && sink->component->name() == "record")
            recording = sink->path;
    }
    return {{"arhost", ARHOST_VERSION},
            {"mode", live_ ? "live" : "lockstep"},
            {"frozen", frozen_},
            {"fps", statistics_.stages.recent_rate("latency")},
            {"frames",
             {{"in", statistics_.frames_in},
              {"tracked", statistics_.tracked},
              {"augmented", statistics_.augmented},
              {"composited", statistics_.composited},
              {"dropped", statistics_.dropped},
              {"passed_unaugmented", statistics_.skipped}}},
            {"stages", std::move(stages)},
            {"latency", latency_json(statistics_, statistics_.latencies.recent())},
            {"quality", quality_json(statistics_)},
            {"targets", std::move(targets)},
            {"components", std::move(components)},
            {"scene", raytracer_ ? Json(raytracer_->scene->source.name) : Json(nullptr)},
            {"scenes", names_of(latest_->scenes)},
            {"recording", std::move(recording)}};
}

} // namespace arhost::host
