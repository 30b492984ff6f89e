// SPDX-License-Identifier: Apache-2.0
#include "host/pipeline.hpp"

#include "host/outcome.hpp"
#include "run_config/access.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <utility>

namespace arhost::host {

using namespace ipc;
using namespace model;
using supervise::Component;

Pipeline::Pipeline(const run_config::Configuration &configuration, supervise::Context context,
                   std::function<void(const Progress &)> on_progress)
    : configuration_(configuration), latest_(std::shared_ptr<void>(), &configuration), context_(std::move(context)),
      on_progress_(std::move(on_progress)), live_(configuration.mode == run_config::Mode::live) {
    context_.log = [this, log = context_.log](arhost_severity severity, const std::string &component,
                                              const std::string &text) {
        if (severity == ARHOST_SEVERITY_HINT && component == "tracker")
            take_hint(text);
        else
            log(severity, component, text);
    };
    statistics_.contract_checks = ContractChecks([this](const std::string &name, const std::string &violation) {
        context_.log(ARHOST_SEVERITY_WARNING, name.substr(0, name.find('.')),
                     "violates the contract: " + name + ": " + violation);
    });
}

bool Pipeline::run() {
    if (configuration_.source) {
        make_source();
        source_->start();
    } else {
        make_black_frames();
    }
    if (configuration_.raytracer)
        load_scene();
    while (phase_ != Phase::finished) {
        context_.reactor.run_once();
        pump();
    }
    report_frame_errors();
    if (!live_)
        check_all_overlays();
    return failure_.empty();
}

bool Pipeline::check(const std::filesystem::path &scratch, bool with_frames) {
    check_scratch_ = scratch;
    ends_when_started_ = !with_frames;
    return run();
}

std::filesystem::path Pipeline::check_folder(const std::filesystem::path &scratch, std::size_t output) {
    return scratch / std::to_string(output);
}

std::vector<std::string> Pipeline::findings() const {
    std::vector<std::string> lines;
    const std::string size = fmt::format("{} x {} px", format_->width, format_->height);
    if (source_)
        lines.push_back(fmt::format("source: {}: {}{}{}", source_->description().id, size,
                                    format_->fps > 0 ? fmt::format(", {:g} fps", format_->fps) : "",
                                    frame_count_ > 0 ? fmt::format(", {} frames", frame_count_) : ""));
    if (intrinsics_.width > 0)
        lines.push_back(fmt::format("camera: fx {:g} px, fy {:g} px, cx {:g} px, cy {:g} px", intrinsics_.fx,
                                    intrinsics_.fy, intrinsics_.cx, intrinsics_.cy));
    if (tracker_)
        lines.push_back(fmt::format("tracker: {}: {}", tracker_->component->description().id,
                                    describe_targets(tracker_->configuration->targets)));
    if (raytracer_)
        lines.push_back(fmt::format("raytracer: {}: {}", raytracer_->component->description().id,
                                    configuration_.raytracer->scene.string()));
    for (std::size_t i = 0; i < sinks_.size(); ++i) {
        const auto path = run_config::path_of(configuration_.outputs[i].node);
        const bool is_stdout = path && run_config::is_standard_output(*path);
        const std::string file = is_stdout ? "standard output" : path ? path->output_path().string() : "";
        std::error_code ignored;
        lines.push_back(fmt::format(
            "output: {}{}{}", sinks_[i]->component->description().id, path ? ": " + file : "",
            path && std::filesystem::is_regular_file(file, ignored) ? " (a run replaces the existing file)" : ""));
    }
    if (statistics_.frames_in == 0)
        return lines;
    lines.push_back(fmt::format("{} frames: {} with a target, {} with an overlay", statistics_.composited,
                                statistics_.tracked, statistics_.augmented));
    if (tracker_)
        for (const model::Target &target : tracker_->configuration->targets) {
            const auto seen = statistics_.targets.find(target.name);
            lines.push_back(
                seen == statistics_.targets.end()
                    ? fmt::format("target {}: not seen", target.name)
                    : fmt::format("target {}: in {} frames, {:.0f} to {:.0f} px wide, reprojection error {:.2f} px",
                                  target.name, seen->second.frames, seen->second.smallest_px, seen->second.largest_px,
                                  seen->second.mean_reprojection_px));
        }
    if (const std::string strangers = strangers_text(statistics_); !strangers.empty())
        lines.push_back("markers of no target: " + strangers);
    lines.push_back(percentiles_text(statistics_.stages.all(), statistics_.latencies.all()));
    return lines;
}

void Pipeline::report_frame_errors() const {
    for (const auto &[error, frames] : frame_errors_)
        if (frames > 1)
            context_.log(ARHOST_SEVERITY_WARNING, error.first,
                         fmt::format("{} in {} frames", status_text(error.second), frames));
}

// In mode lockstep, the output must be that of a run without failures.
void Pipeline::check_all_overlays() {
    for (const auto &[stage, count] : statistics_.skipped)
        fail(std::to_string(count) + (count == 1 ? " frame has" : " frames have") + " no overlay because the " +
                 stage + " failed; see its messages above",
             false);
}

std::vector<Component *> Pipeline::components() const {
    std::vector<Component *> all = components_before_outputs();
    for (const auto &sink : sinks_)
        all.push_back(sink->component.get());
    return all;
}

std::vector<Component *> Pipeline::components_before_outputs() const {
    std::vector<Component *> all;
    if (source_)
        all.push_back(source_.get());
    if (tracker_)
        all.push_back(tracker_->component.get());
    if (raytracer_)
        all.push_back(raytracer_->component.get());
    if (next_tracker_)
        all.push_back(next_tracker_->component.get());
    if (next_raytracer_)
        all.push_back(next_raytracer_->component.get());
    for (const auto &stage : retired_)
        all.push_back(stage->component.get());
    return all;
}

void Pipeline::pump() {
    if (abandoned_)
        return kill_components();
    if (phase_ < Phase::running)
        advance_phase();
    if (phase_ == Phase::running) {
        while (finish_swaps() || read() || track() || render() || compose()) {
        }
        remove_ended();
        apply_edits();
        bool sinks_empty = true;
        for (const auto &sink : sinks_) {
            sink->pump();
            if (sink->ending && sink->empty() && sink->component->running())
                sink->component->stop();
            sinks_empty = sinks_empty && (sink->empty() || sink->closed);
        }
        if (no_more_frames() && reads_.empty()) {
            if (frames_.empty() && sinks_empty)
                stop_components();
            else if (!frames_.empty() &&
                     std::all_of(frames_.begin(), frames_.end(), [](const auto &f) { return f.second->overtaken; }))
                cancel_stages();
        }
    }
    if (phase_ == Phase::stopping) {
        for (const auto &sink : sinks_)
            sink->pump();
        const auto all = components();
        if (std::all_of(all.begin(), all.end(),
                        [](const Component *component) { return component->state() == Component::State::stopped; }))
            phase_ = Phase::finished;
    }
}

void Pipeline::advance_phase() {
    const auto is_ready = [](const auto &part) { return !part || part->running(); };
    if (phase_ == Phase::source && is_ready(source_) && !scene_loading_ && (!configuration_.raytracer || scene_)) {
        if (configuration_.tracker) {
            tracker_ = make_tracker(shared(*configuration_.tracker));
            tracker_->component->start();
        }
        if (configuration_.raytracer) {
            raytracer_ = make_raytracer(shared(*configuration_.raytracer), scene_);
            raytracer_->component->start();
        }
        phase_ = Phase::stages;
    }
    if (phase_ == Phase::stages && is_ready(tracker_) && is_ready(raytracer_)) {
        make_outputs(); // created last, so that a run that cannot start does not touch any file
        phase_ = Phase::outputs;
    }
    if (phase_ == Phase::outputs && std::all_of(sinks_.begin(), sinks_.end(), [&](const auto &sink) {
            return sink->closed || is_ready(sink->component);
        })) {
        if (ends_when_started_)
            return kill_components();
        phase_ = Phase::running;
        const auto has_debug_view = [](const auto &sink) {
            return std::ranges::count(sink->component->description().options, "debug_view", &OptionDeclaration::key) >
                   0;
        };
        if (!configuration_.outputs.empty() && configuration_.outputs.front().debug_view &&
            std::ranges::none_of(sinks_, has_debug_view))
            context_.log(ARHOST_SEVERITY_WARNING, "arhost",
                         "--debug-view has no effect, because no output can draw it; add one that can, such as "
                         "{plugin: sink_video, path: out/debug.mp4}");
        end_without_sinks();
    }
}

bool Pipeline::no_more_frames() const {
    return input_ended_ || (configuration_.frames && next_read_ >= configuration_.frames);
}

void Pipeline::end_run() {
    input_ended_ = true;
    if (source_)
        source_->cancel_call();
}

// Cancels the tracker's and the ray tracer's calls for frames that will not be shown.
void Pipeline::cancel_stages() {
    if (tracker_)
        tracker_->component->cancel_call();
    if (raytracer_)
        raytracer_->component->cancel_call();
}

std::chrono::milliseconds Pipeline::longest_stop_deadline() const {
    std::chrono::milliseconds longest{0};
    const auto add = [&](const run_config::ComponentConfiguration &component) {
        longest = std::max(longest, component.limits.stop);
    };
    if (configuration_.source)
        add(*configuration_.source);
    if (configuration_.tracker)
        add(*configuration_.tracker);
    if (configuration_.raytracer)
        add(*configuration_.raytracer);
    std::for_each(configuration_.outputs.begin(), configuration_.outputs.end(), add);
    if (configuration_.record)
        add(*configuration_.record);
    if (configuration_.snapshot)
        add(*configuration_.snapshot);
    return longest;
}

void Pipeline::interrupt() {
    // Before the first frame nothing was written to the outputs, so there is nothing to finish.
    abandoned_ = interrupted_ || phase_ < Phase::running;
    if (!std::exchange(interrupted_, true)) {
        const std::chrono::milliseconds limit = longest_stop_deadline();
        interrupt_deadline_ = context_.reactor.at(Reactor::Clock::now() + limit, [this, limit] {
            std::string late;
            for (const Component *component : components())
                if (component->state() != Component::State::stopped)
                    late += (late.empty() ? "" : ", ") + component->name();
            fail("not stopped within " + std::to_string(limit.count()) +
                     " ms after the signal (stop_deadline_ms): " + late + "; their files may be incomplete",
                 false);
            abandoned_ = true;
        });
    }
    for (const auto &sink : sinks_)
        if (sink->component->waits())
            sink->component->cancel_call();
    end_run();
}

void Pipeline::stop_components() {
    if (phase_ >= Phase::stopping)
        return;
    phase_ = Phase::stopping;
    scene_loading_.reset();
    next_scene_loading_.reset();
    on_progress_({statistics_.composited, statistics_.composited, true});
    for (Component *component : components_before_outputs())
        component->running() ? component->stop() : component->kill();
    // A sink that is not running is restarted once more, so that it can finish its files.
    for (const auto &sink : sinks_)
        if (sink->component->state() != Component::State::stopped)
            sink->component->stop();
}

void Pipeline::kill_components() {
    for (Component *component : components())
        component->kill();
    phase_ = Phase::finished;
}

void Pipeline::fail(const std::string &reason, bool is_configuration_error, bool was_logged) {
    if (!was_logged)
        context_.log(ARHOST_SEVERITY_DEBUG, "arhost", reason);
    if (failure_.empty()) {
        failure_ = reason;
        failure_was_logged_ = was_logged;
        failed_by_configuration_ = is_configuration_error && phase_ < Phase::running;
    }
    abandoned_ = abandoned_ || phase_ < Phase::running;
}

} // namespace arhost::host
