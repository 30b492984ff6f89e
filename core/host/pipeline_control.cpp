// SPDX-License-Identifier: Apache-2.0
//
// Executes the commands of outputs: freezes the video, exchanges the tracker, the ray tracer and the scene, starts
// and stops outputs, changes options.
#include "host/pipeline.hpp"

#include "base/text.hpp"
#include "run_config/access.hpp"

#include <arhost-cpp/numbered_name.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>

namespace arhost::host {

using namespace ipc;
using namespace model;
using supervise::Component;

namespace {

// Returns the element of `choices` with this name. Throws control::Error, which lists the names.
template <class Choice> const Choice &find_choice(const std::vector<Choice> &choices, const std::string &name) {
    const auto found = std::ranges::find(choices, name, &Choice::name);
    if (found != choices.end())
        return *found;
    std::string names;
    for (const Choice &choice : choices)
        names += (names.empty() ? "; choose one of: " : ", ") + choice.name;
    throw control::Error("there is no '" + base::printable(name, 100) + "'" + names);
}

} // namespace

void Pipeline::on_request(SinkQueue &sink, const messages::Request &request) {
    const auto done = [&sink, id = request.id, restarts = sink.component->restarts()](
                          const std::string &error, const nlohmann::ordered_json &members) {
        sink.component->answer({id, control::answer_text(error, members)}, restarts);
    };
    try {
        const control::Command command = control::parse(request.command, sink.configuration->control);
        const bool changes_run = !std::holds_alternative<control::Status>(command);
        if (changes_run && phase_ != Phase::running)
            throw control::Error("the run is starting or ending");
        if (changes_run)
            sink.component->log(ARHOST_SEVERITY_INFO, "command: " + request.command);
        std::visit([&](const auto &each) { execute(each, done); }, command);
    } catch (const control::Error &error) {
        done(error.what(), {});
    }
}

void Pipeline::execute(const control::Quit &, const control::Done &done) {
    end_run();
    done("", {});
}

void Pipeline::execute(const control::Freeze &freeze, const control::Done &done) {
    frozen_ = freeze.on.value_or(!frozen_);
    done("", {{"frozen", frozen_}});
}

void Pipeline::execute(const control::Status &command, const control::Done &done) {
    done("", {{"status", status()}, {"granted", command.granted}});
}

void Pipeline::execute(const control::Swap &swap, const control::Done &done) {
    if (swap.component == "tracker") {
        expect_no_swap(next_tracker_ != nullptr, "tracker");
        start_next_tracker(shared(find_choice(latest_->trackers, swap.plugin)), done);
    } else {
        expect_no_swap(raytracer_swap_in_progress(), "ray tracer");
        RaytracerPointer chosen = shared(find_choice(latest_->raytracers, swap.plugin));
        start_next_raytracer(std::move(chosen), raytracer_->scene, done);
    }
}

void Pipeline::execute(const control::LoadScene &command, const control::Done &done) {
    expect_no_swap(raytracer_swap_in_progress(), "ray tracer");
    const run_config::Scene &chosen = find_choice(latest_->scenes, command.scene);
    load_next_scene(chosen, raytracer_->configuration, done);
}

void Pipeline::load_next_scene(const run_config::Scene &scene, const RaytracerPointer &raytracer,
                               const control::Done &done) {
    next_scene_loading_ = load(
        scene, *raytracer,
        [this, raytracer, done](std::shared_ptr<LoadedScene> loaded) {
            next_scene_loading_.reset();
            start_next_raytracer(raytracer, std::move(loaded), done);
        },
        [this, done](const std::string &reason) {
            context_.log(ARHOST_SEVERITY_WARNING, "arhost", reason + "; the previous scene stays");
            done(reason, {});
            next_scene_loading_.reset();
        });
}

void Pipeline::expect_no_swap(bool in_progress, const char *component) {
    if (in_progress)
        throw control::Error(std::string("the ") + component + " is being replaced; retry when this has ended");
}

void Pipeline::start_next_tracker(TrackerPointer configuration, const control::Done &done) {
    next_tracker_ = make_tracker(std::move(configuration));
    next_tracker_->swapped = done;
    next_tracker_->component->start();
}

void Pipeline::start_next_raytracer(RaytracerPointer configuration, std::shared_ptr<LoadedScene> scene,
                                    const control::Done &done) {
    next_raytracer_ = make_raytracer(std::move(configuration), std::move(scene));
    next_raytracer_->swapped = done;
    if (next_raytracer_->configuration == raytracer_->configuration) // keeps what `set` has changed
        options_[next_raytracer_->component.get()] = options_[raytracer_->component.get()];
    next_raytracer_->component->start();
}

// Exchanges a stage for its successor, once the successor runs and no frame is in the old stage.
bool Pipeline::finish_swaps() {
    const auto finish = [this](auto &current, auto &next) {
        if (!next || !next->running() || current->component->in_flight() > 0)
            return false;
        if constexpr (requires { next->inherit_state(*current); }) {
            next->inherit_state(*current);
            if (next->configuration->targets != current->configuration->targets) { // perhaps another world
                world_ = World();
                last_camera_.reset();
            }
        }
        retire(std::exchange(current, std::exchange(next, nullptr)));
        std::string text = current->component->name() + " is now " + current->configuration->name;
        nlohmann::ordered_json members = {{"plugin", current->configuration->name}};
        if constexpr (requires { current->scene; }) {
            members["scene"] = current->scene->source.name;
            text += " with the scene " + current->scene->source.name;
        }
        context_.log(ARHOST_SEVERITY_INFO, "arhost", text);
        current->swapped("", members);
        return true;
    };
    const bool targets_change =
        next_tracker_ && next_tracker_->configuration->targets != tracker_->configuration->targets;
    const bool tracker = finish(tracker_, next_tracker_);
    anchors_unchecked_ |= tracker && targets_change;
    if (tracker)
        statistics_.hints.clear();
    const std::shared_ptr<LoadedScene> scene = raytracer_ ? raytracer_->scene : nullptr;
    const bool raytracer = finish(raytracer_, next_raytracer_);
    if (raytracer && raytracer_->scene != scene) {
        recompute_cameras();
        anchors_unchecked_ = true; // the edit of the tracker that it was checked with may have been abandoned
    }
    // An edit that failed before is not tried again.
    tracker_edit_failed_ = tracker_edit_failed_ && !tracker;
    if (raytracer)
        failed_raytracer_edit_.reset();
    // The same edit may have changed both.
    if (anchors_unchecked_ && !next_tracker_ && !raytracer_swap_in_progress()) {
        anchors_unchecked_ = false;
        warn_of_hidden_objects();
    }
    return tracker || raytracer;
}

void Pipeline::warn_of_hidden_objects() const {
    if (!raytracer_)
        return;
    const auto *tracker = tracker_ ? tracker_->configuration.get() : tracker_of_anchors(); // a replay has no tracker
    for (const Anchor &anchor : raytracer_->scene->anchors)
        if (const std::string problem = problem_with({anchor}, tracker); !problem.empty())
            context_.log(ARHOST_SEVERITY_WARNING, "arhost", problem + "; until then, objects on it are hidden");
}

void Pipeline::abandon_swap(std::unique_ptr<Stage> next, const std::string &reason) {
    context_.log(ARHOST_SEVERITY_WARNING, "arhost", reason + "; the previous " + next->component->name() + " stays");
    next->swapped(reason, {});
    retire(std::move(next));
}

void Pipeline::retire(std::unique_ptr<Stage> stage) {
    if (stage->running())
        stage->component->stop();
    else if (stage->component->state() != Component::State::disabled)
        stage->component->kill();
    retired_.push_back(std::move(stage));
}

// The previous and the new scene may have different axes.
void Pipeline::recompute_cameras() {
    if (configuration_.trajectory)
        return;
    last_camera_.reset();
    for (const auto &[sequence, frame] : frames_) {
        if (frame->stage != Frame::Stage::to_render)
            continue;
        frame->record.has_camera = 0;
        set_camera_from_targets(*frame);
        if (!frame->record.has_camera) // its camera was that of an earlier frame
            frame->stage = Frame::Stage::done;
    }
}

void Pipeline::remove_ended() {
    const auto take_if_ended = [this](const Component &component) {
        const bool ended =
            component.state() == Component::State::stopped || component.state() == Component::State::disabled;
        if (ended) {
            statistics_.ended.add(component);
            options_.erase(&component);
        }
        return ended;
    };
    std::erase_if(retired_, [&](const auto &stage) { return take_if_ended(*stage->component); });
    std::erase_if(sinks_, [&](const auto &sink) { return sink->on_demand && take_if_ended(*sink->component); });
}

void Pipeline::execute(const control::Snapshot &, const control::Done &done) {
    if (!last_output_)
        throw control::Error("there is no frame yet");
    SinkQueue &sink = start_output(*configuration_.snapshot, "snapshot", done);
    sink.is_single = true;
    sink.offer(last_output_);
}

void Pipeline::execute(const control::Record &record, const control::Done &done) {
    const auto active = std::ranges::find_if(sinks_, [](const auto &sink) {
        return sink->on_demand && sink->component->name() == "record" && !sink->ending;
    });
    const bool is_recording = active != sinks_.end();
    if (record.on.value_or(!is_recording) == is_recording)
        throw control::Error(is_recording ? "a recording is already in progress" : "there is no recording to stop");
    if (!is_recording) {
        start_output(*configuration_.record, "record", done);
        return;
    }
    SinkQueue &sink = **active;
    if (!sink.component->running())
        throw control::Error("the recording is starting; retry when it has started");
    sink.done = done;
    sink.ending = true;
}

// Starts an output that is not in the list `outputs`.
SinkQueue &Pipeline::start_output(const run_config::ComponentConfiguration &output, const std::string &name,
                                  const control::Done &done) {
    std::string path;
    if (const auto node = run_config::path_of(output.node))
        path = free_path(node->output_path()).string();
    const auto started = std::ranges::count_if(sinks_, [](const auto &sink) { return sink->on_demand; });
    if (std::cmp_greater_equal(started, max_started_outputs))
        throw control::Error("too many recordings and snapshots are being written; retry later");
    SinkQueue &sink = make_sink(output, name, path);
    sink.on_demand = true;
    sink.done = done;
    return sink;
}

// Replaces the number in a numbered file name by the first one for which there is no file.
std::filesystem::path Pipeline::free_path(const std::filesystem::path &pattern) const {
    if (pattern.filename().string().find('%') == std::string::npos)
        return pattern;
    const NumberedName name(pattern.filename().string());
    for (std::uint64_t number = 1;; ++number) {
        std::filesystem::path path = pattern.parent_path() / name.name(number);
        std::error_code ignored;
        if (!std::filesystem::exists(std::filesystem::symlink_status(path, ignored)) &&
            std::ranges::none_of(sinks_, [&](const auto &sink) { return sink->path == path; }))
            return path;
    }
}

void Pipeline::execute(const control::Set &set, const control::Done &done) {
    const auto all = components();
    const auto component = std::ranges::find_if(
        all, [&](const Component *each) { return each->name() == set.component && each->running(); });
    if (component == all.end())
        throw control::Error("there is no running component '" + base::printable(set.component, 100) + "'");
    const PluginDescription &plugin = (*component)->description();
    const auto declared = std::ranges::find(plugin.options, set.option, &OptionDeclaration::key);
    if (declared == plugin.options.end() || !std::ranges::count(plugin.changeable, set.option)) {
        std::string names;
        for (const std::string &key : plugin.changeable)
            names += (names.empty() ? "" : ", ") + key;
        throw control::Error("'" + base::printable(set.option, 100) + "' cannot be changed while " + plugin.id +
                             " runs; " + (names.empty() ? "none of its options can" : "these can: " + names));
    }
    OptionValue value;
    try {
        value = run_config::option_value(*declared, set.value);
    } catch (const yaml::Error &error) {
        throw control::Error(error.what());
    }
    OptionsInUse &options = options_[*component];
    (*component)->set_option(value, [this, &options, value, done, changed = *component](const std::string &error) {
        if (const auto old = std::ranges::find(options.values, value.key, &OptionValue::key);
            error.empty() && old != options.values.end()) {
            *old = value;
            options.changed.insert(value.key);
            if (raytracer_ && raytracer_->component.get() == changed && value.key == "samples") {
                start_quality(*raytracer_);     // its limit is the new value
                raytracer_->samples_in_use = 0; // a reduction may have followed the new value
            }
        }
        done(error, {});
    });
}

// Returns the options for creating a plugin: the configured ones, except for those that `set` has changed.
std::vector<OptionValue> Pipeline::options_for(const Component &component, arhost_kind kind,
                                               const run_config::ComponentConfiguration &configuration,
                                               std::size_t candidate) {
    std::vector<std::string> notes;
    std::vector<OptionValue> values =
        run_config::options_for(component.description(), kind, configuration, candidate, notes);
    const auto [entry, is_first] = options_.try_emplace(&component);
    OptionsInUse &in_use = entry->second;
    for (const std::string &note : notes)
        if (is_first)
            context_.log(ARHOST_SEVERITY_WARNING, component.description().id, note);
    in_use.path = configuration.node.path();
    if (candidate > 0)
        in_use.changed.clear();
    for (OptionValue &value : values)
        if (in_use.changed.contains(value.key))
            value = *std::ranges::find(in_use.values, value.key, &OptionValue::key);
    in_use.values = values;
    return values;
}

} // namespace arhost::host
