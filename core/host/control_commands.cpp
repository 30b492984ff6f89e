// SPDX-License-Identifier: Apache-2.0
#include "host/control_commands.hpp"

#include "base/text.hpp"
#include "host/documents.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>

namespace arhost::host {

using namespace ipc;
using namespace model;
using supervise::Component;

namespace {

template <class Choice> std::string list_of(const std::vector<Choice> &choices) {
    std::string names;
    for (const Choice &choice : choices)
        names += (names.empty() ? "" : ", ") + choice.name;
    return names;
}

// Returns the element of `choices` with this name. Throws control::Error, which lists the names.
template <class Choice> const Choice &find_choice(const std::vector<Choice> &choices, const std::string &name) {
    const auto found = std::ranges::find(choices, name, &Choice::name);
    if (found != choices.end())
        return *found;
    const std::string names = choices.empty() ? "" : "choose one of: " + list_of(choices);
    if (name.empty())
        throw control::Error(names.empty() ? "there is nothing to choose from" : names);
    throw control::Error("there is no '" + base::printable(name, 100) + "'" + (names.empty() ? "" : "; " + names));
}

void expect_no_swap(bool in_progress, const char *component) {
    if (in_progress)
        throw control::Error(std::string("the ") + component + " is being replaced; retry when this has ended");
}

} // namespace

void Commands::execute(SinkQueue &sink, const messages::Request &request) {
    const auto done = [&sink, id = request.id, restarts = sink.component->restarts()](
                          const std::string &error, const nlohmann::ordered_json &members) {
        sink.component->answer({id, control::answer_text(error, members)}, restarts);
    };
    try {
        const control::Command command = control::parse(request.command, sink.configuration->control);
        const bool changes_run = !std::holds_alternative<control::Status>(command);
        if (changes_run && !parts_.failures.video_runs())
            throw control::Error("the run is starting or ending");
        if (changes_run)
            sink.component->log(ARHOST_SEVERITY_INFO, "command: " + request.command);
        std::visit([&](const auto &each) { execute(each, done); }, command);
    } catch (const control::NotGranted &error) { // an output that may not ask for the status, too, must know its keys
        done(error.what(), {{"granted", sink.configuration->control}});
    } catch (const std::exception &error) { // also thrown if no process or memory can be created
        done(error.what(), {});
    }
}

void Commands::execute(const control::Quit &, const control::Done &done) {
    assembly_.end_input();
    done("", {});
}

void Commands::execute(const control::Freeze &freeze, const control::Done &done) {
    parts_.flow.set_frozen(freeze.on.value_or(!parts_.flow.is_frozen()));
    done("", {{"frozen", parts_.flow.is_frozen()}});
}

void Commands::execute(const control::Status &command, const control::Done &done) {
    done("", {{"status", status_json(parts_, assembly_, outputs_)}, {"granted", command.granted}});
}

void Commands::execute(const control::Swap &swap, const control::Done &done) {
    const run_config::Configuration &choices = *assembly_.latest();
    if (swap.component == "tracker") {
        expect_no_swap(assembly_.swaps_tracker(), "tracker");
        assembly_.swap_tracker(assembly_.shared(find_choice(choices.trackers, swap.plugin)), done);
    } else if (swap.component == "raytracer") {
        expect_no_swap(assembly_.swaps_raytracer(), "ray tracer");
        assembly_.swap_raytracer(assembly_.shared(find_choice(choices.raytracers, swap.plugin)), done);
    } else {
        std::string swappable;
        for (const auto &[component, names] :
             {std::pair{"tracker", list_of(choices.trackers)}, {"raytracer", list_of(choices.raytracers)}})
            if (!names.empty())
                swappable += (swappable.empty() ? "" : ", ") + std::string(component) + " (" + names + ")";
        if (swappable.empty())
            throw control::Error("this run has neither a tracker nor a ray tracer to swap");
        throw control::Error(
            (swap.component.empty() ? "" : "'" + base::printable(swap.component, 100) + "' cannot be swapped; ") +
            "choose a component and its new plugin: " + swappable);
    }
}

void Commands::execute(const control::LoadScene &command, const control::Done &done) {
    expect_no_swap(assembly_.swaps_raytracer(), "ray tracer");
    const run_config::Scene &chosen = find_choice(assembly_.latest()->scenes, command.scene);
    assembly_.swap_scene(chosen, assembly_.raytracer()->configuration(), done);
}

void Commands::execute(const control::Snapshot &, const control::Done &done) {
    outputs_.take_snapshot(done);
}

void Commands::execute(const control::Record &record, const control::Done &done) {
    outputs_.set_recording(record.on, done);
}

Component &Commands::running_component(const std::string &name) const {
    const std::vector<Component *> all = components_of(assembly_, outputs_);
    const auto found =
        std::ranges::find_if(all, [&](const Component *each) { return each->name() == name && each->running(); });
    if (found == all.end())
        throw control::Error("there is no running component '" + base::printable(name, 100) + "'");
    return **found;
}

void Commands::execute(const control::Set &set, const control::Done &done) {
    Component &component = running_component(set.component);
    const PluginDescription &plugin = component.description();
    const auto declared = std::ranges::find(plugin.options, set.option, &OptionDeclaration::key);
    if (declared == plugin.options.end() || !std::ranges::count(plugin.changeable, set.option)) {
        std::string names;
        for (const std::string &key : plugin.changeable)
            names += (names.empty() ? "" : ", ") + key;
        throw control::Error(
            (set.option.empty() ? "choose an option that can be changed while "
                                : "'" + base::printable(set.option, 100) + "' cannot be changed while ") +
            plugin.short_name() + " runs; " + (names.empty() ? "none of its options can" : "these can: " + names));
    }
    OptionValue value;
    try {
        value = run_config::option_value(*declared, set.value);
    } catch (const yaml::Error &error) {
        throw control::Error(error.what());
    }
    component.set_option(value, [this, value, done, &component](const std::string &error) {
        if (error.empty())
            parts_.options.change(component, value);
        done(error, {});
    });
}

} // namespace arhost::host
