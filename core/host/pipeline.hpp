// SPDX-License-Identifier: Apache-2.0
//
// One run of a configuration: source → tracker → camera → ray tracer → composite → outputs. A trajectory can replace
// the tracker and also the source. Workers do everything except compositing; the pipeline runs on the thread that
// calls run(), one event at a time.
//
// Event handlers only record results; `pump` then advances every frame as far as possible. In mode lockstep, every
// frame passes through all stages, and frames are output in order. In mode live, a newer frame replaces a frame that
// is still waiting, and frames skip a stage whose worker is down.
//
// pipeline.cpp has the phases of a run, pipeline_components.cpp creates the components, pipeline_frames.cpp moves
// frames through the stages, pipeline_control.cpp executes commands, pipeline_edits.cpp applies edited files,
// pipeline_description.cpp describes the run for the sinks that record it.
#pragma once

#include "base/listening_socket.hpp"
#include "host/file_watch.hpp"
#include "host/frames.hpp"
#include "host/scene_loading.hpp"
#include "host/sink_queue.hpp"
#include "host/stage.hpp"
#include "host/statistics.hpp"
#include "host/time_codes.hpp"
#include "host/world.hpp"
#include "run_config/configuration.hpp"

#include <functional>
#include <map>

namespace arhost::host {

struct Progress {
    std::uint64_t frame = 0;       // frames composited so far
    std::uint64_t frame_count = 0; // total number of frames; 0: unknown
    bool finishing = false;        // closing the outputs
};

class Pipeline {
public:
    Pipeline(const run_config::Configuration &configuration, supervise::Context context,
             std::function<void(const Progress &)> on_progress);

    // Runs until all frames are output. Returns false if the run failed or a component was disabled; failure() then
    // returns the reason as a message for the user.
    bool run();
    // Starts all components as run() does, but processes no frame, unless `with_frames`. The outputs write to
    // subfolders of `scratch` instead of their own folders; the permissions of their components must match. Returns
    // as run().
    bool check(const std::filesystem::path &scratch, bool with_frames);
    static std::filesystem::path check_folder(const std::filesystem::path &scratch, std::size_t output);
    // Describes the started components, one per line, for the user.
    std::vector<std::string> findings() const;

    // Applies edits of the configuration's file and of the scene's files while the run lasts: exchanges the tracker,
    // the ray tracer and the scene that they change. `read` parses the configuration again and throws yaml::Error.
    // To be called before run().
    void watch(std::function<run_config::Configuration()> read);

    const std::string &failure() const { return failure_; }
    bool failure_was_logged() const { return failure_was_logged_; }
    // The targets that the tracker looks for now.
    std::vector<model::Target> targets() const {
        return tracker_ ? tracker_->configuration->targets : std::vector<model::Target>();
    }
    bool failed_by_configuration() const { return failed_by_configuration_; }

    // Handles Ctrl-C. The first call lets the frames in progress finish and then ends the run, after the longest
    // stop_deadline_ms of the components at the latest; a second call ends the run immediately. Must be called from
    // the reactor.
    void interrupt();

    const Statistics &statistics() const { return statistics_; }
    std::vector<supervise::Component *> components() const; // source, tracker, ray tracer, outputs

private:
    static constexpr std::size_t max_started_outputs = 4; // by commands, at the same time
    enum class Phase { source, stages, outputs, running, stopping, finished };

    void make_source();
    void make_black_frames();
    using TrackerPointer = std::shared_ptr<const run_config::TrackerConfiguration>;
    using RaytracerPointer = std::shared_ptr<const run_config::RaytracerConfiguration>;
    std::unique_ptr<TrackerStage> make_tracker(TrackerPointer configuration);
    std::unique_ptr<RaytracerStage> make_raytracer(RaytracerPointer configuration,
                                                   std::shared_ptr<LoadedScene> scene);
    // Returns a pointer to a part of the latest configuration, which keeps this configuration alive.
    template <class Part> std::shared_ptr<const Part> shared(const Part &part) const { return {latest_, &part}; }
    void make_outputs();
    SinkQueue &make_sink(const run_config::ComponentConfiguration &output, const std::string &name,
                         const std::string &path = "");
    std::vector<int> open_sockets(const run_config::ComponentConfiguration &output,
                                  std::vector<model::OptionValue> &options);
    void expect_distinct_files(const run_config::ComponentConfiguration &output,
                               const model::PluginDescription &plugin);
    void load_scene();
    const run_config::TrackerConfiguration *tracker_of_anchors() const;
    void write_anchors(const Frame &frame, std::span<std::byte> slot) const;
    std::unique_ptr<SceneLoading> load(const run_config::Scene &scene,
                                       const run_config::RaytracerConfiguration &raytracer,
                                       const std::function<void(std::shared_ptr<LoadedScene>)> &on_loaded,
                                       const std::function<void(const std::string &reason)> &on_failed);
    supervise::Component::Callbacks common_callbacks(const std::string &name, const yaml::Node &node);

    void on_request(SinkQueue &sink, const ipc::messages::Request &request);
    void execute(const control::Quit &command, const control::Done &done);
    void execute(const control::Freeze &command, const control::Done &done);
    void execute(const control::Snapshot &command, const control::Done &done);
    void execute(const control::Record &command, const control::Done &done);
    void execute(const control::LoadScene &command, const control::Done &done);
    void execute(const control::Swap &command, const control::Done &done);
    void execute(const control::Set &command, const control::Done &done);
    void execute(const control::Status &command, const control::Done &done);
    static void expect_no_swap(bool in_progress, const char *component);
    bool raytracer_swap_in_progress() const { return next_raytracer_ || next_scene_loading_; }
    void start_next_tracker(TrackerPointer configuration, const control::Done &done);
    void start_next_raytracer(RaytracerPointer configuration, std::shared_ptr<LoadedScene> scene,
                              const control::Done &done);
    void load_next_scene(const run_config::Scene &scene, const RaytracerPointer &raytracer,
                         const control::Done &done);
    void watch_files(const FileWatch::Files &files);
    void apply_edits();
    void apply(const run_config::Configuration &edited, const run_config::Configuration &previous, bool scene_changed,
               bool print_changed);
    bool finish_swaps();
    void warn_of_hidden_objects() const; // those on targets that the tracker does not look for
    void abandon_swap(std::unique_ptr<Stage> next, const std::string &reason);
    void retire(std::unique_ptr<Stage> stage);
    void recompute_cameras();
    void remove_ended();
    SinkQueue &start_output(const run_config::ComponentConfiguration &output, const std::string &name,
                            const control::Done &done);
    std::filesystem::path free_path(const std::filesystem::path &pattern) const;
    std::vector<model::OptionValue> options_for(const supervise::Component &component, arhost_kind kind,
                                                const run_config::ComponentConfiguration &configuration,
                                                std::size_t candidate);
    std::string run_description(const std::string &id) const;
    nlohmann::ordered_json status() const;
    nlohmann::ordered_json status_of(const supervise::Component &component) const;
    std::size_t index_of(const run_config::ComponentConfiguration &output) const {
        return static_cast<std::size_t>(&output - configuration_.outputs.data());
    }

    std::vector<supervise::Component *> components_before_outputs() const;
    void pump();
    void advance_phase();
    void end_run(); // has the same effect as the end of the source
    bool no_more_frames() const;
    bool read();
    bool read_from_trajectory();
    bool track();
    bool render();
    bool is_early(const Frame &frame);
    bool compose();
    void compose(Frame &frame, std::uint32_t inputs, std::span<std::byte> slot);
    void exchange_time_code(std::span<const arhost_observation> observations, const OutputView &out);
    void start_quality(RaytracerStage &stage);
    void request_samples(RaytracerStage &stage, std::uint32_t samples);
    std::pair<std::uint32_t, std::uint32_t> overlay_size(const Quality &quality) const; // width, height in px
    ImageView overlay_of(const Frame &frame) const;
    std::pair<ImageView, Region> full_size_overlay(const Frame &frame);
    camera::Coordinates coordinates() const {
        return raytracer_ ? raytracer_->scene->coordinates : camera::Coordinates();
    }
    void copy_sink_inputs(const Frame &frame, const ImageView &overlay, const Region &region, std::uint32_t inputs,
                          std::span<std::byte> slot) const;
    void check_buffers_unmodified(const Frame &frame);
    void cancel_stages();
    std::chrono::milliseconds longest_stop_deadline() const;
    void stop_components();
    void kill_components();

    void on_read(const ipc::Command &command, const ipc::Result &result);
    void start_frame(std::unique_ptr<Frame> frame);
    void repeat_record(Frame &frame, const run_config::RecordedFrame &recorded);
    bool repeats_decisions(const Frame &frame) const;
    void set_recorded_camera(Frame &frame) const;
    void count_targets(const Frame &frame);
    void count_strangers(Frame &frame);
    void take_hint(std::string text);
    void set_camera_from_targets(Frame &frame);
    void set_camera_from_trajectory(Frame &frame) const;
    void on_camera_known(Frame &frame);
    Frame *accept_result(const ipc::Command &command, const ipc::Result &result, supervise::Component &stage);
    void on_tracked(const ipc::Command &command, const ipc::Result &result);
    void on_rendered(const ipc::Command &command, const ipc::Result &result);
    void on_stage_lost(Stage &stage, const std::vector<ipc::Command> &unanswered, Frame::Stage waiting);

    static bool is_running(const auto &part) { return part && part->running(); }
    // Returns whether a frame may skip `stage` because the stage's worker is down.
    bool may_skip(const Stage &stage) const;
    bool is_behind() const;
    void skip(Frame &frame, const char *stage);
    void report_frame_errors() const;
    void check_all_overlays();
    void enqueue(Frame &frame, Frame::Stage stage);
    Frame *next_waiting(Frame::Stage stage);
    void drop_overtaken(std::uint64_t shown);

    void end_sink(SinkQueue &sink);
    void close_sink(SinkQueue &sink);
    void end_without_sinks(); // ends the run if all outputs are closed
    // `was_logged`: the user has already seen the reason.
    void fail(const std::string &reason, bool is_configuration_error, bool was_logged = false);
    void on_disabled(const std::string &name, const yaml::Node &node, const std::string &reason,
                     bool is_configuration_error);

    const run_config::Configuration &configuration_;
    // The choices for commands: those of `configuration_`, or of its last edit.
    std::shared_ptr<const run_config::Configuration> latest_;
    supervise::Context context_;
    std::function<void(const Progress &)> on_progress_;
    const bool live_;
    Phase phase_ = Phase::source;

    std::unique_ptr<SceneLoading> scene_loading_;
    std::shared_ptr<LoadedScene> scene_;

    std::unique_ptr<supervise::Component> source_;
    std::unique_ptr<TrackerStage> tracker_;
    std::unique_ptr<RaytracerStage> raytracer_;
    // The successors that a command has started, and the stages that were replaced and have not ended yet.
    std::unique_ptr<TrackerStage> next_tracker_;
    std::unique_ptr<RaytracerStage> next_raytracer_;
    std::unique_ptr<SceneLoading> next_scene_loading_;
    std::vector<std::unique_ptr<Stage>> retired_;
    std::vector<std::unique_ptr<SinkQueue>> sinks_;
    std::map<const run_config::ComponentConfiguration *, run_config::OutputFile> output_files_;
    std::shared_ptr<SlotPool> source_slots_, output_slots_;

    std::optional<arhost_frame_format> format_;
    std::uint64_t frame_count_ = 0;
    arhost_intrinsics intrinsics_{};

    std::deque<Lease> reads_; // slots of the pending read commands, oldest first
    std::uint64_t next_read_ = 0;
    std::uint64_t skipped_ = 0; // number of frames before next_read_ that the source skipped
    std::int64_t last_capture_ns_ = INT64_MIN;
    bool input_ended_ = false; // the source has ended, or no more frames are to be read from it
    bool interrupted_ = false;
    bool abandoned_ = false; // the run must end immediately
    ipc::Reactor::Registration interrupt_deadline_;
    std::map<std::uint64_t, std::unique_ptr<Frame>> frames_;
    std::vector<arhost_target> last_targets_; // of the last composited frame
    World world_;
    bool has_window_ = false;
    bool reported_missing_targets_ = false;
    // The last frame of a paced run.
    struct Paced {
        std::int64_t media_ns;
        std::chrono::steady_clock::time_point due;
    };
    std::optional<Paced> paced_;
    ipc::Reactor::Registration due_;
    bool frozen_ = false;
    std::vector<std::uint8_t> enlarged_; // the overlay of a frame that was rendered smaller
    OutputFramePointer last_output_;     // for the command `snapshot`
    struct OptionsInUse {
        std::string path; // of the component in the configuration
        std::vector<model::OptionValue> values;
        std::set<std::string> changed; // the keys that the command `set` has changed
    };
    std::map<const supervise::Component *, OptionsInUse> options_;
    std::function<run_config::Configuration()> read_configuration_; // empty unless edits are applied
    std::optional<FileWatch> file_watch_;
    struct RaytracerEdit {
        RaytracerPointer raytracer;
        run_config::Scene scene;
    };
    bool tracker_edit_failed_ = false;
    // A swap has changed the targets or the scene, and warn_of_hidden_objects has not been called since.
    bool anchors_unchecked_ = false;
    std::optional<RaytracerEdit> failed_raytracer_edit_;
    FileWatch::Files edited_files_;                                      // to be applied
    std::optional<std::pair<std::uint64_t, arhost_camera>> last_camera_; // with the number of its frame

    std::optional<TimeCodes> time_codes_; // only for `arhost latency`
    Statistics statistics_;
    std::map<std::pair<std::string, arhost_status>, std::uint64_t>
        frame_errors_;                          // number of frames by stage and error
    std::optional<SourceChecks> source_checks_; // for the current plugin; survives restarts
    std::string failure_;
    bool failed_by_configuration_ = false, failure_was_logged_ = false;
    std::map<std::pair<const run_config::ComponentConfiguration *, std::string>, base::ListeningSocket>
        sockets_;                                        // by output and option
    std::optional<std::filesystem::path> check_scratch_; // set by check()
    bool ends_when_started_ = false;                     // likewise
};

} // namespace arhost::host
