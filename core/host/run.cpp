// SPDX-License-Identifier: Apache-2.0
#include "host/run.hpp"

#include "host/outcome.hpp"
#include "host/run_description.hpp"
#include "run_config/access.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>

namespace arhost::host {

using namespace ipc;
using namespace model;
using supervise::Component;

namespace {

FrameFlow::Settings settings_of(const run_config::Configuration &configuration) {
    FrameFlow::Settings settings;
    settings.live = configuration.mode == run_config::Mode::live;
    settings.has_source = configuration.source.has_value();
    settings.has_tracker = configuration.tracker.has_value();
    settings.has_raytracer = configuration.raytracer.has_value();
    settings.max_frames = configuration.frames;
    settings.max_latency = configuration.max_latency;
    settings.has_timeline = configuration.timeline.has_value();
    settings.trajectory = configuration.trajectory ? &*configuration.trajectory : nullptr;
    settings.recording = configuration.recording ? &*configuration.recording : nullptr;
    return settings;
}

} // namespace

Run::Run(const run_config::Configuration &configuration, const supervise::Context &context, Options options)
    : configuration_(configuration), context_{context.reactor, context.launcher, context.worker_program,
                                              [this, log = context.log](arhost_severity severity,
                                                                        const std::string &component,
                                                                        const std::string &text) {
                                                  this->log(log, severity, component, text);
                                              }},
      options_(std::move(options)), failures_(context_.log), component_options_(context_.log),
      cameras_(configuration.trajectory ? &*configuration.trajectory : nullptr),
      flow_(settings_of(configuration), context_.reactor.clock(), cameras_, statistics_),
      parts_{configuration, context_, statistics_, failures_, component_options_, totals_, cameras_, flow_, video_},
      sightings_(configuration, context_.reactor.clock(), context_.log, statistics_),
      assembly_(parts_, sightings_,
                [this](const FileWatch::Files &files) {
                    if (edits_)
                        edits_->watch(files);
                }),
      outputs_(parts_,
               {[this](const std::string &id) { return run_description(parts_, assembly_, id); },
                [this](SinkQueue &sink, const messages::Request &request) { commands_.execute(sink, request); },
                [this] { end_input(); }},
               options_.check_scratch),
      commands_(parts_, assembly_, outputs_, [this] { end_input(); }) {
    statistics_.contract_checks =
        contracts::ContractChecks([this](const std::string &name, const std::string &violation) {
            context_.log(ARHOST_SEVERITY_WARNING, name.substr(0, name.find('.')),
                         "violates the contract: " + name + ": " + violation);
        });
    flow_.set_paced(configuration.paced.value_or(false));
    if (options_.read_configuration)
        edits_.emplace(parts_, assembly_, options_.read_configuration);
}

void Run::log(const supervise::LogFunction &log, arhost_severity severity, const std::string &component,
              const std::string &text) {
    if (severity != ARHOST_SEVERITY_HINT || component != "tracker")
        log(severity, component, text);
    else if (!assembly_.has_retired()) // otherwise it may be of a tracker that was replaced
        sightings_.add_hint(text);
}

std::vector<Component *> Run::components() const {
    std::vector<Component *> all = assembly_.components();
    for (const auto &sink : outputs_.sinks())
        all.push_back(sink->component.get());
    return all;
}

std::vector<Target> Run::targets() const {
    return assembly_.tracker() ? assembly_.tracker()->configuration()->targets : std::vector<Target>();
}

// ---- phases ---------------------------------------------------------------------------------------------

bool Run::run() {
    assembly_.start();
    while (phase_ != Phase::finished) {
        context_.reactor.run_once();
        pump();
    }
    report_frame_errors();
    return failures_.text().empty();
}

void Run::pump() {
    if (killed_ || failures_.ends_run())
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
    failures_.set_phase(Failures::Phase::video_runs);
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
        std::optional<FrameFlow::Action> action = flow_.next(intakes);
        if (!action)
            break;
        std::visit([this](auto &each) { execute(each); }, *action);
    }
    due_ = flow_.due() ? context_.reactor.at(*flow_.due(), [] {}) : Reactor::Registration(); // wakes this run
    assembly_.remove_ended();
    outputs_.remove_ended();
    if (edits_)
        edits_->apply();
    outputs_.pump();
    if (flow_.expects_more_frames())
        return;
    if (flow_.has_only_overtaken())
        assembly_.cancel_calls();
    else if (flow_.is_empty() && outputs_.have_written_all())
        stop_components();
}

void Run::execute(FrameFlow::Show &action) {
    flow_.on_shown(*action.frame, outputs_.show(*action.frame));
    options_.on_progress(
        {statistics_.composited, configuration_.frames ? configuration_.frames : video_.frame_count, false});
}

void Run::end_input() {
    flow_.on_input_ended();
    if (Component *source = assembly_.source().component())
        source->cancel_call();
}

void Run::stop_components() {
    phase_ = Phase::stopping;
    failures_.set_phase(Failures::Phase::ending);
    assembly_.stop_loading();
    options_.on_progress({statistics_.composited, statistics_.composited, true});
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
    killed_ = flow_.was_interrupted() || phase_ < Phase::running;
    if (!flow_.was_interrupted()) {
        flow_.on_interrupted();
        const std::chrono::milliseconds limit = longest_stop_deadline();
        interrupt_deadline_ = context_.reactor.at(context_.reactor.now() + limit, [this, limit] {
            std::string late;
            for (const Component *component : components())
                if (component->state() != Component::State::stopped)
                    late += (late.empty() ? "" : ", ") + component->name();
            failures_.add("not stopped within " + std::to_string(limit.count()) +
                              " ms after the signal (stop_deadline_ms): " + late + "; their files may be incomplete",
                          false);
            killed_ = true;
        });
    }
    outputs_.stop_waiting();
    end_input();
}

std::chrono::milliseconds Run::longest_stop_deadline() const {
    std::chrono::milliseconds longest{0};
    const auto add = [&](const run_config::ComponentConfiguration &component) {
        longest = std::max(longest, component.limits.stop);
    };
    const auto add_if_any = [&](const auto &...components) { (..., (components ? add(*components) : void())); };
    add_if_any(configuration_.source, configuration_.tracker, configuration_.raytracer, configuration_.record,
               configuration_.snapshot);
    std::ranges::for_each(configuration_.outputs, add);
    return longest;
}

// ---- reports --------------------------------------------------------------------------------------------

void Run::report_frame_errors() {
    for (const auto &[error, frames] : statistics_.errors)
        if (frames > 1)
            context_.log(ARHOST_SEVERITY_WARNING, error.first,
                         fmt::format("{} in {} frames", status_text(error.second), frames));
    if (configuration_.mode == run_config::Mode::live)
        return;
    // In mode lockstep, the output must be that of a run without failures.
    for (const auto &[stage, count] : statistics_.skipped)
        failures_.add(std::to_string(count) + (count == 1 ? " frame has" : " frames have") +
                          " no overlay because the " + stage + " failed; see its messages above",
                      false);
}

std::vector<std::string> Run::findings() const {
    std::vector<std::string> lines;
    const arhost_frame_format &format = video_.format;
    if (const Component *source = assembly_.source().component())
        lines.push_back(fmt::format("source: {}: {} x {} px{}{}", source->description().id, format.width,
                                    format.height, format.fps > 0 ? fmt::format(", {:g} fps", format.fps) : "",
                                    video_.frame_count > 0 ? fmt::format(", {} frames", video_.frame_count) : ""));
    if (const arhost_intrinsics &camera = video_.intrinsics; camera.width > 0)
        lines.push_back(fmt::format("camera: fx {:g} px, fy {:g} px, cx {:g} px, cy {:g} px", camera.fx, camera.fy,
                                    camera.cx, camera.cy));
    if (const Tracker *tracker = assembly_.tracker())
        lines.push_back(
            fmt::format("tracker: {}: {}", tracker->component().description().id, describe_targets(targets())));
    if (const Raytracer *raytracer = assembly_.raytracer())
        lines.push_back(fmt::format("raytracer: {}: {}", raytracer->component().description().id,
                                    configuration_.raytracer->scene.string()));
    for (std::size_t i = 0; i < outputs_.sinks().size(); ++i) {
        const auto path = run_config::path_of(configuration_.outputs[i].node);
        const bool is_stdout = path && run_config::is_standard_output(*path);
        const std::string file = is_stdout ? "standard output" : path ? path->output_path().string() : "";
        std::error_code ignored;
        lines.push_back(fmt::format(
            "output: {}{}{}", outputs_.sinks()[i]->component->description().id, path ? ": " + file : "",
            path && std::filesystem::is_regular_file(file, ignored) ? " (a run replaces the existing file)" : ""));
    }
    if (statistics_.frames_in == 0)
        return lines;
    lines.push_back(fmt::format("{} frames: {} with a target, {} with an overlay", statistics_.composited,
                                statistics_.tracked, statistics_.augmented));
    for (const Target &target : targets()) {
        const auto seen = statistics_.targets.find(target.name);
        lines.push_back(seen == statistics_.targets.end()
                            ? fmt::format("target {}: not seen", target.name)
                            : fmt::format("target {}: in {} frames, {:.0f} to {:.0f} px wide, reprojection error "
                                          "{:.2f} px",
                                          target.name, seen->second.frames, seen->second.smallest_px,
                                          seen->second.largest_px, seen->second.mean_reprojection_px));
    }
    if (const std::string unlisted = unlisted_text(statistics_); !unlisted.empty())
        lines.push_back("markers of no target: " + unlisted);
    lines.push_back(percentiles_text(statistics_.stages.all(), statistics_.latencies.all()));
    return lines;
}

} // namespace arhost::host
