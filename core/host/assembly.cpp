// SPDX-License-Identifier: Apache-2.0
#include "host/assembly.hpp"

#include "base/text.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <utility>

namespace arhost::host {

using namespace ipc;
using supervise::Component;

Assembly::Assembly(RunParts &parts, Sightings &sightings, WatchFiles watch_files)
    : parts_(parts), sightings_(sightings), watch_files_(std::move(watch_files)),
      latest_(std::shared_ptr<void>(), &parts.configuration), source_(parts) {}

void Assembly::start() {
    source_.start();
    if (!parts_.configuration.raytracer)
        return;
    scene_loading_ = load(
        parts_.configuration.scenes.front(), *parts_.configuration.raytracer,
        [this](std::shared_ptr<LoadedScene> scene) {
            scene_ = std::move(scene);
            scene_loading_.reset();
        },
        [this](const std::string &reason) {
            parts_.failures.add(reason, true);
            scene_loading_.reset();
        });
}

bool Assembly::advance() {
    if (!has_started_stages_) {
        if (!source_.has_started() || scene_loading_ || (parts_.configuration.raytracer && !scene_))
            return false;
        if (parts_.configuration.tracker)
            swap_tracker(shared(*parts_.configuration.tracker), nullptr);
        if (parts_.configuration.raytracer)
            start_next_raytracer(shared(*parts_.configuration.raytracer), scene_, nullptr);
        has_started_stages_ = true;
    }
    if ((next_tracker_ && !next_tracker_->running()) || (next_raytracer_ && !next_raytracer_->running()))
        return false;
    finish_swap(tracker_, next_tracker_);
    finish_swap(raytracer_, next_raytracer_);
    return true;
}

FrameFlow::Intakes Assembly::intakes() const {
    // Once its successor runs, a stage gets no more frames.
    const auto intake_of = [](const auto &current, const auto &next) {
        FrameFlow::Intake intake = current ? current->intake() : FrameFlow::Intake();
        if (next && next->running())
            intake.readiness = FrameFlow::Readiness::busy;
        return intake;
    };
    return {source_.intake(), intake_of(tracker_, next_tracker_), intake_of(raytracer_, next_raytracer_)};
}

void Assembly::end_input() {
    parts_.flow.on_input_ended();
    if (source_.component())
        source_.component()->cancel_call();
}

void Assembly::cancel_calls() {
    if (tracker_)
        tracker_->component().cancel_call();
    if (raytracer_)
        raytracer_->component().cancel_call();
}

void Assembly::stop_loading() {
    scene_loading_.reset();
    next_scene_loading_.reset();
}

std::vector<Component *> Assembly::components() const {
    std::vector<Component *> all;
    if (source_.component())
        all.push_back(source_.component());
    for (const Stage *stage : std::initializer_list<const Stage *>{tracker_.get(), raytracer_.get(),
                                                                   next_tracker_.get(), next_raytracer_.get()})
        if (stage)
            all.push_back(&stage->component());
    for (const auto &stage : retired_)
        all.push_back(&stage->component());
    return all;
}

// ---- scenes ---------------------------------------------------------------------------------------------

// Returns the tracker to whose targets objects of a scene can be attached; null if there is none.
const run_config::TrackerConfiguration *Assembly::tracker_of_anchors() const {
    // A session contains the poses of the targets, so its replay needs no tracker.
    const auto &recording = parts_.configuration.recording;
    const bool replays_poses = recording && recording->repeats_decisions;
    return latest_->tracker                              ? &*latest_->tracker
           : replays_poses && !latest_->trackers.empty() ? &latest_->trackers.front()
                                                         : nullptr;
}

// Starts to load a scene. Calls one of the two functions, which may destroy the returned object.
std::unique_ptr<SceneLoading> Assembly::load(const run_config::Scene &scene,
                                             const run_config::RaytracerConfiguration &raytracer,
                                             const std::function<void(std::shared_ptr<LoadedScene>)> &on_loaded,
                                             const std::function<void(const std::string &reason)> &on_failed) {
    auto loaded = std::make_shared<LoadedScene>();
    loaded->source = scene;
    SceneLoading::Callbacks callbacks;
    callbacks.loaded = [this, loaded, conform = raytracer.conform, on_loaded,
                        on_failed](SharedMemory arena, const std::vector<Anchor> &anchors,
                                   const SceneLoading::Callbacks::Files &files) {
        const Mapping mapping = arena.map(Access::read_only);
        const auto &content = mapping.as<const arhost_scene>();
        loaded->files = files;
        loaded->anchors = anchors;
        if (const std::string problem = problem_with(anchors, tracker_of_anchors()); !problem.empty())
            return on_failed(problem);
        loaded->coordinates = latest_->coordinates.value_or(camera::default_for(content.axes));
        loaded->integrator = content.integrator;
        if (conform)
            loaded->overlay_checks.emplace(content);
        loaded->arena = std::move(arena);
        watch_files_(files);
        on_loaded(loaded);
    };
    callbacks.failed = [this, on_failed](const std::string &reason, const SceneLoading::Callbacks::Files &files) {
        watch_files_(files);
        on_failed(reason);
    };
    watch_files_({scene.file, base::real_path(scene.file)});
    return std::make_unique<SceneLoading>(parts_.context, scene.file, raytracer.policy, raytracer.limits,
                                          parts_.configuration.files, std::move(callbacks));
}

// ---- swaps ----------------------------------------------------------------------------------------------

void Assembly::swap_tracker(Tracker::Configuration configuration, const control::Done &done) {
    next_tracker_ = std::make_unique<Tracker>(
        parts_, sightings_, std::move(configuration),
        [this](const Stage &stage, const std::string &reason) { return abandon_swap(stage, reason); });
    next_tracker_->swapped = done;
    next_tracker_->start();
}

void Assembly::swap_raytracer(Raytracer::Configuration configuration, const control::Done &done) {
    start_next_raytracer(std::move(configuration), raytracer_->scene(), done);
}

void Assembly::swap_scene(const run_config::Scene &scene, const Raytracer::Configuration &raytracer,
                          const control::Done &done) {
    next_scene_loading_ = load(
        scene, *raytracer,
        [this, raytracer, done](std::shared_ptr<LoadedScene> loaded) {
            next_scene_loading_.reset();
            start_next_raytracer(raytracer, std::move(loaded), done);
        },
        [this, done](const std::string &reason) {
            parts_.log(ARHOST_SEVERITY_WARNING, reason + "; the previous scene stays");
            done(reason, {});
            next_scene_loading_.reset();
        });
}

void Assembly::start_next_raytracer(Raytracer::Configuration configuration, std::shared_ptr<LoadedScene> scene,
                                    const control::Done &done) {
    next_raytracer_ = std::make_unique<Raytracer>(
        parts_, std::move(configuration), std::move(scene),
        [this](const Stage &stage, const std::string &reason) { return abandon_swap(stage, reason); });
    next_raytracer_->swapped = done;
    // Keeps the changes by the command `set`.
    if (raytracer_ && next_raytracer_->configuration() == raytracer_->configuration())
        parts_.options.copy(raytracer_->component(), next_raytracer_->component());
    next_raytracer_->start();
}

bool Assembly::abandon_swap(const Stage &stage, const std::string &reason) {
    std::unique_ptr<Stage> next;
    if (tracker_ && &stage == next_tracker_.get())
        next = std::move(next_tracker_);
    else if (raytracer_ && &stage == next_raytracer_.get())
        next = std::move(next_raytracer_);
    else
        return false;
    parts_.log(ARHOST_SEVERITY_WARNING, reason + "; the previous " + next->component().name() + " stays");
    next->swapped(reason, {});
    retire(std::move(next));
    return true;
}

// Replaces a stage, which may be null, by its successor, once the successor runs and the old stage has no frames.
template <class Kind> bool Assembly::finish_swap(std::unique_ptr<Kind> &current, std::unique_ptr<Kind> &next) {
    if (!next || !next->running() || (current && current->component().in_flight() > 0))
        return false;
    next->take_over(current.get());
    std::unique_ptr<Kind> previous = std::exchange(current, std::move(next));
    if (!previous) // the first stage of the run
        return true;
    retire(std::move(previous));
    const std::string &name = current->configuration()->name;
    std::string text = current->component().name() + " is now " + name;
    nlohmann::ordered_json members = {{"plugin", name}};
    if constexpr (std::is_same_v<Kind, Raytracer>) {
        members["scene"] = current->scene()->source.name;
        text += " with the scene " + current->scene()->source.name;
    }
    parts_.log(ARHOST_SEVERITY_INFO, text);
    current->swapped("", members);
    return true;
}

Assembly::Exchanged Assembly::finish_swaps() {
    const auto targets_before = tracker_ ? tracker_->configuration() : nullptr;
    const auto scene_before = raytracer_ ? raytracer_->scene() : nullptr;
    const Exchanged exchanged{finish_swap(tracker_, next_tracker_), finish_swap(raytracer_, next_raytracer_)};
    if ((exchanged.tracker && tracker_->configuration()->targets != targets_before->targets) ||
        (exchanged.raytracer && raytracer_->scene() != scene_before))
        anchors_unchecked_ = true; // the scene was checked against an edit that may have been abandoned
    // The same edit may have changed the tracker and the ray tracer.
    if (anchors_unchecked_ && !swaps_tracker() && !swaps_raytracer()) {
        anchors_unchecked_ = false;
        warn_of_hidden_objects();
    }
    return exchanged;
}

void Assembly::warn_of_hidden_objects() const {
    if (!raytracer_)
        return;
    const auto *tracker =
        tracker_ ? tracker_->configuration().get() : tracker_of_anchors(); // a replay has no tracker
    for (const Anchor &anchor : raytracer_->scene()->anchors)
        if (const std::string problem = problem_with({anchor}, tracker); !problem.empty())
            parts_.log(ARHOST_SEVERITY_WARNING, problem + "; until then, objects on it are hidden");
}

void Assembly::retire(std::unique_ptr<Stage> stage) {
    if (stage->running())
        stage->component().stop();
    else if (stage->component().state() != Component::State::disabled)
        stage->component().kill();
    retired_.push_back(std::move(stage));
}

void Assembly::remove_ended() {
    std::erase_if(retired_, [this](const auto &stage) { return parts_.take_if_ended(stage->component()); });
}

} // namespace arhost::host
