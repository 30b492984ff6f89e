// SPDX-License-Identifier: Apache-2.0
//
// One run of one configuration: source → tracker → camera → ray tracer → composite → outputs. A trajectory
// gives the cameras in place of the tracker, and does without a source. Everything
// happens on the thread that calls run(), one event at a time; the work is done by the workers, all but
// the composite.
//
// Events only note what has come in; `pump` then moves every frame as far as it can go. Modes differ in
// little: in lockstep a frame waits for its stage and frames leave in order; in live a newer frame takes
// the place of one that waits, and a stage that is down is passed by.
#pragma once

#include "host/frames.hpp"
#include "host/scene_loading.hpp"
#include "host/sink_queue.hpp"
#include "host/statistics.hpp"
#include "run_config/configuration.hpp"

#include <functional>
#include <map>

namespace arhost::host {

// How far a run is.
struct Progress {
    std::uint64_t frame = 0;       // composited so far
    std::uint64_t frame_count = 0; // in all; 0: unknown
    bool finishing = false;        // the outputs are being closed
};

class Pipeline {
public:
    Pipeline(const run_config::Configuration &configuration, supervise::Context context,
             std::function<void(const Progress &)> on_progress);

    // Runs to the end. Returns false where the run failed or ended with a component given up; failure()
    // then says why, in words for the user.
    bool run();
    const std::string &failure() const { return failure_; }
    bool failed_by_configuration() const { return failed_by_configuration_; }

    // Ctrl-C: lets what is under way finish, then ends. A second call ends at once. From the reactor.
    void interrupt();

    const Statistics &statistics() const { return statistics_; }
    std::vector<supervise::Component *> components() const; // source, tracker, ray tracer, outputs

private:
    enum class Phase { source, stages, outputs, running, stopping, over };

    void make_source();
    void make_black_frames();
    void make_tracker();
    void make_raytracer();
    void make_outputs();
    supervise::Component::Hooks hooks_for(const std::string &name, const yaml::Node &node);

    void pump();
    void enter_next_phase();
    void end_run(); // as if the source had no more
    bool no_more_frames() const;
    bool read();
    bool read_from_trajectory();
    bool track();
    bool render();
    bool compose();
    void compose(Frame &frame, std::span<std::byte> slot);
    ImageView overlay_of(const Frame &frame) const;
    void check_buffers_unmodified(const Frame &frame);
    void cancel_stages();
    void stop_components();

    void on_read(const ipc::Command &command, const ipc::Result &result);
    void begin(std::unique_ptr<Frame> frame);
    void take_camera_of_markers(Frame &frame);
    void take_camera_of_trajectory(Frame &frame) const;
    void on_camera_known(Frame &frame);
    Frame *take_answer(const ipc::Command &command, const ipc::Result &result, const char *stage);
    void on_tracked(const ipc::Command &command, const ipc::Result &result);
    void on_rendered(const ipc::Command &command, const ipc::Result &result);
    void on_stage_lost(const std::vector<ipc::Command> &unanswered, Frame::Stage waiting, const char *stage);

    // A stage that does not answer commands at the moment: may the frame go on without it?
    bool may_pass(const supervise::Component *stage) const;
    bool is_behind() const;
    void pass(Frame &frame, const char *stage);
    void wait_for(Frame &frame, Frame::Stage stage);
    Frame *next_waiting(Frame::Stage stage);
    void forget_overtaken(std::uint64_t shown);

    void give_up_sink(SinkQueue &sink);
    void fail(const std::string &reason, bool by_configuration);
    void give_up(const std::string &name, const yaml::Node &node, const std::string &reason, bool by_configuration);

    const run_config::Configuration &configuration_;
    supervise::Context context_;
    std::function<void(const Progress &)> on_progress_;
    const bool live_;
    Phase phase_ = Phase::source;

    std::unique_ptr<SceneLoading> scene_loading_;
    ipc::SharedMemory arena_;
    camera::Coordinates coordinates_;

    std::unique_ptr<supervise::Component> source_, tracker_, raytracer_;
    std::vector<std::unique_ptr<SinkQueue>> sinks_;
    std::shared_ptr<SlotPool> source_slots_, tracker_slots_, raytracer_slots_, output_slots_;

    std::optional<arhost_frame_format> format_;
    std::uint64_t frame_count_ = 0;
    arhost_intrinsics intrinsics_{};
    std::shared_ptr<LensWarp> warp_; // NULL where the ray tracer traces through the lens
    std::set<std::int32_t> marker_ids_;

    std::deque<Lease> reads_; // the slots of the reads under way, oldest first
    std::uint64_t next_read_ = 0;
    std::uint64_t skipped_ = 0; // by the source, before that
    std::int64_t last_capture_ns_ = INT64_MIN;
    bool ended_ = false; // the source has said so, or shall give no more
    bool interrupted_ = false;
    bool abandoned_ = false; // everything is to end at once
    std::map<std::uint64_t, std::unique_ptr<Frame>> frames_;
    std::optional<std::pair<std::uint64_t, arhost_camera>> last_camera_; // and the frame it belongs to

    Statistics statistics_;
    std::optional<SourcePromises> source_promises_; // of the plugin at work, over its restarts
    std::optional<OverlayPromises> overlay_promises_;
    std::string failure_;
    bool failed_by_configuration_ = false;
};

} // namespace arhost::host
