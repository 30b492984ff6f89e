// SPDX-License-Identifier: Apache-2.0
//
// Decides which frame goes to which component and when, and which frames are dropped. The inputs are events: a frame
// has arrived, a component has answered or has died. The outputs are actions: read, track, render, show. FrameFlow
// starts no process, does not access the memory of frames, and takes the time from a clock.
//
// In mode lockstep, every frame passes through all stages, and frames are shown in order; after the death of a
// worker, its frames are processed again. In mode live, a newer frame replaces a frame that is still waiting, and
// frames skip a component that has no worker at present.
#pragma once

#include "base/clock.hpp"
#include "host/frame.hpp"
#include "run_config/recording.hpp"

#include <deque>
#include <map>
#include <span>
#include <variant>

namespace arhost::host {

class Cameras;

class FrameFlow {
public:
    using Clock = base::Clock;

    struct Settings {
        bool live = false;
        bool has_source = true; // false: the frames are those of `trajectory`
        bool has_tracker = false, has_raytracer = false;
        std::uint64_t max_frames = 0; // 0: no limit; always set without a source
        // Mode live: other frames overtake a frame that has been in a worker for this time.
        std::chrono::milliseconds max_latency{500};
        bool has_timeline = false;
        const camera::Trajectory *trajectory = nullptr;   // cameras to use instead of the tracker's
        const run_config::Recording *recording = nullptr; // the frames of a session, which the source plays
    };

    enum class Readiness {
        ready,
        busy,    // processes other frames, or is being replaced
        down,    // has no worker, but will have one again
        disabled // has no worker any more
    };
    struct Intake {
        Readiness readiness = Readiness::disabled;
        SlotPool *slots = nullptr;   // slots for the results of the component
        SlotPool *anchors = nullptr; // slots for anchors, if a ray tracer's scene has anchors
    };
    struct Intakes {
        Intake source, tracker, raytracer;
        bool outputs_are_full = false; // no memory is free for a composited frame
    };

    struct Read {
        std::uint64_t sequence;
        std::uint32_t slot;
    };
    struct Track {
        Frame &frame;
    };
    struct Render {
        Frame &frame;
    };
    struct Show {
        std::unique_ptr<Frame> frame; // contains the overlay, if there is one; to be passed to on_shown()
    };
    using Action = std::variant<Read, Track, Render, Show>;

    FrameFlow(const Settings &settings, const Clock &clock, Cameras &cameras, Statistics &statistics);

    // Returns the next action, which must be executed before the next call; nullopt if all frames wait for events.
    std::optional<Action> next(const Intakes &intakes);
    // The time until which the next frame waits because the run is paced; nullopt if it does not wait.
    std::optional<Clock::time_point> due() const { return due_; }

    // ---- events ------------------------------------------------------------------------------------
    // The oldest read was answered. Returns its slot.
    Lease take_read();
    // Whether the run still expects the frame `sequence` of the source. False for frames that were requested after
    // one whose read failed.
    bool expects(std::uint64_t sequence) const { return sequence < next_read_; }
    void read_again(std::uint64_t sequence) { next_read_ = sequence; } // and all later frames
    void on_arrived(std::unique_ptr<Frame> frame);
    // `unanswered`: the frames whose reads were not answered.
    void on_source_lost(std::span<const std::uint64_t> unanswered);
    void on_input_ended() { input_ended_ = true; } // the source has no more frames, or the run reads no more

    // A component has answered for the frame `sequence`. Returns the frame; nullptr if it is not needed any more.
    // Must be followed by on_tracked, on_rendered or on_failed for that frame.
    Frame *answered(std::uint64_t sequence);
    void on_tracked(Frame &frame, std::chrono::nanoseconds busy);  // the frame has the targets
    void on_rendered(Frame &frame, std::chrono::nanoseconds busy); // the frame has the overlay
    void on_failed(Frame &frame, const char *stage);               // the frame passes without an overlay
    // The worker has died. `waiting`: the stage of frames that wait for this worker. `unanswered`: the worker's
    // frames, oldest first; it was processing the first one.
    void on_lost(Frame::Stage waiting, std::span<const std::uint64_t> unanswered);
    void on_tracker_replaced() { tracker_pace_ = {}; }
    void on_raytracer_replaced() { raytracer_pace_ = {}; }
    void on_coordinates_changed(); // the coordinates of the cameras have changed, because the scene was replaced

    void on_shown(Frame &frame, Clock::time_point composited);
    void on_interrupted() { interrupted_ = true; } // frames are not delayed any more
    void omit_unfinished();                        // the oldest unfinished frame and all later ones will not be shown

    // ---- state -------------------------------------------------------------------------------------
    void set_rate(double fps) { fps_ = fps; } // frame rate of the source; 0: unknown
    // Mode lockstep: shows recorded video at the rate of its time stamps.
    void set_paced(bool paced) { paced_ = paced; }
    void set_frozen(bool frozen) { frozen_ = frozen; } // no further frames are taken from the source
    bool is_frozen() const { return frozen_; }
    std::uint64_t next_read() const { return next_read_; } // number of the next frame of the source
    bool input_has_ended() const { return input_ended_; }
    bool was_interrupted() const { return interrupted_; }
    bool discards_arrivals() const { return omits_unfinished_ || (settings_.live && input_ended_ && interrupted_); }
    bool expects_more_frames() const { return !no_more_frames() || !reads_.empty(); }
    bool is_empty() const { return frames_.empty(); }
    const Frame *find(std::uint64_t sequence) const; // nullptr if there is no such frame
    bool has_only_overtaken() const;                 // there are frames, but none of them will be shown
    bool repeats_decisions(const Frame &frame) const {
        return frame.recorded && settings_.recording->repeats_decisions;
    }
    const session::RecordedFrame *recorded(std::uint64_t sequence) const {
        return settings_.recording ? &settings_.recording->frames[sequence] : nullptr;
    }
    const std::vector<arhost_target> &last_targets() const { return last_targets_; } // in the last shown frame

private:
    // Measures whether a worker can catch up after a delay.
    class Pace {
    public:
        void add(std::chrono::nanoseconds duration);
        // Whether calls on average take less than three quarters of the time between frames. True before the first
        // result; false if the rate is unknown.
        bool keeps_up(double fps) const { return fps > 0 && mean_s_.value_or(0) < 0.75 / fps; }

    private:
        std::optional<double> mean_s_; // exponential moving average
    };

    using Frames = std::map<std::uint64_t, std::unique_ptr<Frame>>; // by number of the frame in the run

    bool no_more_frames() const {
        return input_ended_ || (settings_.max_frames && next_read_ >= settings_.max_frames);
    }
    std::optional<Action> read(const Intake &source);
    bool read_from_trajectory(const Intake &source);
    std::optional<Action> track(const Intake &tracker);
    std::optional<Action> render(const Intake &raytracer);
    std::optional<Action> show(const Intakes &intakes);

    bool skips(const Intake &intake) const;
    void start(std::unique_ptr<Frame> frame);
    void on_camera_known(Frame &frame);
    void enqueue(Frame &frame, Frame::Stage stage);
    Frame *next_for(Frame::Stage waiting, const Intake &intake);
    bool is_behind() const;
    bool is_early(const Frame &frame);
    void finish(Frame &frame, bool is_shown, Clock::time_point when);
    void drop(Frames::iterator first, Frames::iterator last);

    const Settings settings_;
    const Clock &clock_;
    Cameras &cameras_;
    Statistics &statistics_;

    double fps_ = 0;
    bool paced_ = false, frozen_ = false, input_ended_ = false, interrupted_ = false, omits_unfinished_ = false;
    std::deque<Lease> reads_; // slots of the reads without an answer, oldest first
    std::uint64_t next_read_ = 0;
    Frames frames_;
    Pace tracker_pace_, raytracer_pace_;
    struct Paced {
        std::int64_t media_ns;
        Clock::time_point due;
    };
    std::optional<Paced> last_paced_;
    std::optional<Clock::time_point> due_;
    std::vector<arhost_target> last_targets_;
};

} // namespace arhost::host
