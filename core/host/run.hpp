// SPDX-License-Identifier: Apache-2.0
//
// One run of a configuration: source → tracker → camera → ray tracer → composite → outputs. Workers do everything
// except compositing. The run handles one event at a time on the thread that calls run(): the handlers report each
// event to FrameFlow, and `pump` then executes the actions that FrameFlow returns.
#pragma once

#include "host/control_commands.hpp"
#include "host/edits.hpp"

namespace arhost::host {

struct Progress {
    std::uint64_t frame = 0;       // frames composited so far
    std::uint64_t frame_count = 0; // total number of frames; 0: unknown
    bool finishing = false;        // closing the outputs
};

class Run {
public:
    struct Options {
        std::function<void(const Progress &)> on_progress = [](const Progress &) {};
        // Applies edits of the configuration and of the scene while the run lasts. Parses the configuration again and
        // throws yaml::Error. Empty: edits are not applied.
        std::function<run_config::Configuration()> read_configuration{};
        // Only checks that all components start. Outputs write to subfolders of this folder instead of their own
        // folders; the permissions of their components must allow this. No frame is processed, unless
        // `checks_frames`.
        std::optional<std::filesystem::path> check_scratch{};
        bool checks_frames = false;
    };
    Run(const run_config::Configuration &configuration, const supervise::Context &context, Options options);
    Run(const Run &) = delete;
    Run &operator=(const Run &) = delete;

    // Runs until all frames are output. Returns false if the run failed or a component was disabled.
    bool run();
    // Handles Ctrl-C. The first call lets the frames in progress finish and then ends the run, at the latest after
    // the longest stop_deadline_ms of the components that run at the time of the call. A second call ends the run
    // immediately. Must be called from the reactor.
    void interrupt();

    const Failures &failures() const { return parts_.failures; }
    const Statistics &statistics() const { return parts_.statistics; }
    ComponentTotals component_totals() const { return parts_.totals.plus(components()); }
    std::vector<model::Target> targets() const; // the targets that the tracker currently looks for
    // Describes the started components and their findings, one per line, for the user.
    std::vector<std::string> findings() const;

private:
    enum class Phase { starting_stages, starting_outputs, running, stopping, finished };

    void log(const supervise::LogFunction &log, arhost_severity severity, const std::string &component,
             const std::string &text);
    std::vector<supervise::Component *> components() const { return components_of(assembly_, outputs_); }
    void pump();
    void start_next();
    void run_frames();
    void execute(FrameFlow::Read &action) { assembly_.source().read(action); }
    void execute(FrameFlow::Track &action) { assembly_.tracker()->track(action.frame); }
    void execute(FrameFlow::Render &action) { assembly_.raytracer()->render(action.frame); }
    void execute(FrameFlow::Show &action);
    void stop_components();
    void kill_components();
    void report_frame_errors();

    const Options options_;
    RunParts parts_;
    Sightings sightings_;
    Assembly assembly_;
    Outputs outputs_;
    Commands commands_;
    std::optional<Edits> edits_;

    Phase phase_ = Phase::starting_stages;
    bool killed_ = false; // the run must end immediately
    ipc::Reactor::Registration due_, frame_deadline_, interrupt_deadline_;
};

} // namespace arhost::host
