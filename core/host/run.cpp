// SPDX-License-Identifier: Apache-2.0
#include "host/run.hpp"

#include "base/text.hpp"
#include "host/outcome.hpp"
#include "run_config/access.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>

namespace arhost::host {

using namespace ipc;
using namespace model;
using supervise::Component;

Run::Run(const run_config::Configuration &configuration, const supervise::Context &context, Options options)
    : options_(std::move(options)),
      parts_(configuration,
             {context.reactor, context.launcher, context.worker_program,
              [this, log = context.log](arhost_severity severity, const std::string &component,
                                        const std::string &text) { this->log(log, severity, component, text); }}),
      sightings_(parts_), assembly_(parts_, sightings_,
                                    [this](const FileWatch::Files &files) {
                                        if (edits_)
                                            edits_->watch(files);
                                    }),
      outputs_(
          parts_, assembly_,
          [this](SinkQueue &sink, const messages::Request &request) { commands_.execute(sink, request); },
          options_.check_scratch),
      commands_(parts_, assembly_, outputs_) {
    for (const std::string &warning : configuration.warnings) // which the caller has printed
        parts_.messages.add(ARHOST_SEVERITY_WARNING, "arhost", warning);
    if (options_.read_configuration)
        edits_.emplace(parts_, assembly_, options_.read_configuration);
}

void Run::log(const supervise::LogFunction &log, arhost_severity severity, const std::string &component,
              const std::string &text) {
    parts_.messages.add(severity, component, text);
    if (severity != ARHOST_SEVERITY_HINT || component != "tracker")
        log(severity, component, text);
    else if (!assembly_.has_retired()) // otherwise, the hint may be from a replaced tracker
        sightings_.add_hint(text);
}

std::vector<Target> Run::targets() const {
    return assembly_.tracker() ? assembly_.tracker()->configuration()->targets : std::vector<Target>();
}

// ---- phases ---------------------------------------------------------------------------------------------

bool Run::run() {
    assembly_.start();
    while (phase_ != Phase::finished) {
        parts_.context.reactor.run_once();
        pump();
    }
    report_frame_errors();
    return parts_.failures.text().empty();
}

void Run::pump() {
    if (killed_ || parts_.failures.ends_run())
        return kill_components();
    if (phase_ < Phase::running)
        start_next();
    if (phase_ == Phase::running)
        run_frames();
    if (phase_ == Phase::stopping) {
        outputs_.pump();
        if (std::ranges::all_of(components(), [](const Component *component) {
                return component->state() == Component::State::stopped;
            }))
            phase_ = Phase::finished;
    }
}

void Run::start_next() {
    if (phase_ == Phase::starting_stages && assembly_.advance()) {
        outputs_.start(); // last, so that a run that cannot start does not touch any file
        phase_ = Phase::starting_outputs;
    }
    if (phase_ != Phase::starting_outputs || !outputs_.have_started())
        return;
    if (options_.check_scratch && !options_.checks_frames)
        return kill_components();
    phase_ = Phase::running;
    parts_.failures.set_phase(Failures::Phase::video_runs);
    outputs_.begin_video();
}

void Run::run_frames() {
    for (;;) {
        if (const auto exchanged = assembly_.finish_swaps()) {
            if (edits_)
                edits_->on_swapped(exchanged);
            continue;
        }
        FrameFlow::Intakes intakes = assembly_.intakes();
        intakes.outputs_are_full = outputs_.are_full();
        std::optional<FrameFlow::Action> action = parts_.flow.next(intakes);
        if (!action)
            break;
        std::visit([this](auto &each) { execute(each); }, *action);
    }
    due_ = parts_.flow.due() ? parts_.context.reactor.at(*parts_.flow.due(), [] {})
                             : Reactor::Registration(); // wakes this run
    assembly_.remove_ended();
    outputs_.remove_ended();
    if (edits_)
        edits_->apply();
    outputs_.pump();
    if (parts_.flow.expects_more_frames())
        return;
    if (parts_.flow.has_only_overtaken())
        assembly_.cancel_calls();
    else if (parts_.flow.is_empty() && outputs_.have_written_all())
        stop_components();
}

void Run::execute(FrameFlow::Show &action) {
    parts_.flow.on_shown(*action.frame, outputs_.show(*action.frame));
    options_.on_progress({parts_.statistics.composited,
                          parts_.configuration.frames ? parts_.configuration.frames : parts_.video.frame_count,
                          false});
}

void Run::stop_components() {
    phase_ = Phase::stopping;
    parts_.failures.set_phase(Failures::Phase::ending);
    assembly_.stop_loading();
    options_.on_progress({parts_.statistics.composited, parts_.statistics.composited, true});
    for (Component *component : assembly_.components())
        component->running() ? component->stop() : component->kill();
    outputs_.stop();
}

void Run::kill_components() {
    for (Component *component : components())
        component->kill();
    phase_ = Phase::finished;
}

// ---- interruption ---------------------------------------------------------------------------------------

void Run::interrupt() {
    // Before the first frame nothing was written to the outputs, so there is nothing to finish.
    killed_ = parts_.flow.was_interrupted() || phase_ < Phase::running;
    if (!parts_.flow.was_interrupted()) {
        parts_.flow.on_interrupted();
        constexpr std::chrono::seconds time_to_finish(1);
        frame_deadline_ = parts_.context.reactor.at(parts_.context.reactor.now() + time_to_finish,
                                                    [this] { parts_.flow.omit_unfinished(); });
        std::chrono::milliseconds limit{0};
        for (const Component *component : components())
            limit = std::max(limit, component->limits().stop);
        interrupt_deadline_ = parts_.context.reactor.at(parts_.context.reactor.now() + limit, [this, limit] {
            std::string late;
            for (const Component *component : components())
                if (phase_ == Phase::stopping ? component->state() != Component::State::stopped
                                              : component->in_flight() > 0)
                    late += (late.empty() ? "" : ", ") + component->name();
            parts_.failures.add("not stopped within " + std::to_string(limit.count()) +
                                    " ms after the signal (stop_deadline_ms): " + late +
                                    "; their files may be incomplete",
                                false);
            killed_ = true;
        });
    }
    outputs_.stop_waiting();
    assembly_.end_input();
}

// ---- reports --------------------------------------------------------------------------------------------

void Run::report_frame_errors() {
    for (const auto &[error, frames] : parts_.statistics.errors)
        if (frames > 1)
            parts_.context.log(ARHOST_SEVERITY_WARNING, error.first,
                               fmt::format("{} in {}", status_text(error.second), base::count_of(frames, "frame")));
    if (parts_.configuration.mode == run_config::Mode::live)
        return;
    // In mode lockstep, the output must be that of a run without failures.
    for (const auto &[stage, count] : parts_.statistics.skipped)
        parts_.failures.add(base::count_of(count, "frame") + (count == 1 ? " has" : " have") +
                                " no overlay because the " + stage + " failed; see its messages above",
                            false);
}

std::vector<std::string> Run::findings() const {
    std::vector<std::string> lines;
    const arhost_frame_format &format = parts_.video.format;
    if (const Component *source = assembly_.source().component())
        lines.push_back(fmt::format(
            "source: {}: {} x {} px{}{}", source->description().short_name(), format.width, format.height,
            format.fps > 0 ? fmt::format(", {:g} fps", format.fps) : "",
            parts_.video.frame_count > 0 ? ", " + base::count_of(parts_.video.frame_count, "frame") : ""));
    if (const arhost_intrinsics &camera = parts_.video.intrinsics; camera.width > 0)
        lines.push_back(fmt::format("camera: fx {:g} px, fy {:g} px, cx {:g} px, cy {:g} px", camera.fx, camera.fy,
                                    camera.cx, camera.cy));
    if (const Tracker *tracker = assembly_.tracker())
        lines.push_back(fmt::format("tracker: {}: {}", tracker->component().description().short_name(),
                                    describe_targets(targets())));
    if (const Raytracer *raytracer = assembly_.raytracer())
        lines.push_back(fmt::format("raytracer: {}: {}", raytracer->component().description().short_name(),
                                    parts_.configuration.raytracer->scene.string()));
    for (std::size_t i = 0; i < outputs_.sinks().size(); ++i) {
        const auto path = run_config::path_of(parts_.configuration.outputs[i].node);
        const bool is_stdout = path && run_config::is_standard_output(*path);
        const std::string file = is_stdout ? "standard output" : path ? path->output_path().string() : "";
        std::error_code ignored;
        lines.push_back(fmt::format(
            "output: {}{}{}", outputs_.sinks()[i]->component->description().short_name(), path ? ": " + file : "",
            path && std::filesystem::is_regular_file(file, ignored) ? " (a run replaces the existing file)" : ""));
    }
    if (parts_.statistics.frames_in == 0)
        return lines;
    lines.push_back(fmt::format("{}: {} with a target, {} with an overlay",
                                base::count_of(parts_.statistics.composited, "frame"), parts_.statistics.tracked,
                                parts_.statistics.augmented));
    for (const Target &target : targets()) {
        const auto seen = parts_.statistics.targets.find(target.name);
        lines.push_back(seen == parts_.statistics.targets.end()
                            ? fmt::format("target {}: not seen", target.name)
                            : fmt::format("target {}: in {}, {:.0f} to {:.0f} px wide, reprojection error "
                                          "{:.2f} px",
                                          target.name, base::count_of(seen->second.frames, "frame"),
                                          seen->second.smallest_px, seen->second.largest_px,
                                          seen->second.mean_reprojection_px));
    }
    if (const std::string unlisted = unlisted_text(parts_.statistics); !unlisted.empty())
        lines.push_back("markers of no target: " + unlisted);
    lines.push_back(percentiles_text(parts_.statistics.stages.all(), parts_.statistics.latencies.all()));
    return lines;
}

} // namespace arhost::host
