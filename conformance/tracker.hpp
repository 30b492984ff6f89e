// SPDX-License-Identifier: Apache-2.0
// Runs a tracker on frames of printed markers.
#pragma once

#include "conformance/guarded_memory.hpp"
#include "conformance/plugin_library.hpp"
#include "conformance/prints.hpp"
#include "conformance/scenes.hpp"
#include "conformance/test.hpp"

#include <memory>
#include <optional>

namespace arhost::conformance {

// A frame in read-only memory. Bytes outside the pixels are noise with the seed `filler`.
class SealedFrame {
public:
    SealedFrame(const Grey &image, arhost_pixel_format format, std::uint64_t filler = 1);
    arhost_frame frame(std::uint64_t sequence, std::int64_t capture_ns) const;

private:
    arhost_frame_format format_;
    GuardedMemory memory_;
};

arhost_frame_format format_of(std::uint32_t width, std::uint32_t height, arhost_pixel_format format);

struct Listed { // a marker of the configuration
    int id;
    double side_mm;
};

// An instance is started once; a further start creates a new instance.
class Tracker {
public:
    explicit Tracker(Context &context, Settings overrides = {});
    ~Tracker() { stop(); }
    Tracker(const Tracker &) = delete;
    Tracker &operator=(const Tracker &) = delete;

    arhost_status try_start(const arhost_intrinsics &camera, const std::vector<Listed> &listed,
                            arhost_pixel_format format = ARHOST_PIXEL_FORMAT_GREY8);
    // Throws Failure unless it succeeds.
    void start(const arhost_intrinsics &camera, const std::vector<Listed> &listed,
               arhost_pixel_format format = ARHOST_PIXEL_FORMAT_GREY8);
    arhost_status start_with(const arhost_tracker_setup &setup);
    void stop();

    arhost_status try_track(const SealedFrame &frame, std::uint64_t sequence, std::int64_t capture_ns);
    std::vector<arhost_marker> records() const; // of the last call of track
    // The state_after of the last successful call of track. The next call gets `state` as its state_before, or NULL
    // if it is empty; before the call, state_after is filled with `filler`.
    std::vector<std::byte> state() const;
    void set_state(const std::vector<std::byte> &state, std::byte filler);
    std::vector<arhost_marker> seen() const; // records of markers in the frame, with measured or smoothed pose

    // seen() in the next frame, at 30 frames/s. Throws Failure unless it succeeds.
    std::vector<arhost_marker> track(const SealedFrame &frame);
    std::vector<arhost_marker> track(const Grey &image) {
        return track(SealedFrame(image, ARHOST_PIXEL_FORMAT_GREY8));
    }
    // Restarts the tracker and tracks one frame, so there is no history to smooth with.
    std::vector<arhost_marker> track_first(const SealedFrame &frame);
    std::vector<arhost_marker> track_first(const Grey &image) {
        return track_first(SealedFrame(image, ARHOST_PIXEL_FORMAT_GREY8));
    }

    Instance &instance() { return *instance_; }

private:
    void create();
    std::uint64_t aligned_state_size() const { return (state_size_ + 63) / 64 * 64; }

    PluginLibrary &library_;
    Settings overrides_;
    std::optional<Instance> instance_;
    const arhost_tracker &functions_;
    GuardedMemory result_memory_;
    std::uint64_t state_size_ = 0;
    std::byte state_filler_{0xa5};
    std::unique_ptr<GuardedMemory> state_before_; // null: none
    bool fresh_ = true, started_ = false;
    arhost_intrinsics camera_{}; // of the last start
    std::vector<Listed> listed_;
    arhost_pixel_format format_ = ARHOST_PIXEL_FORMAT_GREY8;
    std::uint64_t sequence_ = 0; // of the next frame
};

inline constexpr std::int64_t frame_ns = 33'333'333;

// A wide-angle camera. Its frames with one byte per pixel fill whole memory pages.
inline arhost_intrinsics wide_camera() {
    return pinhole(320, 256, 300);
}

// ---- Expectations ----------------------------------------------------------------------------------

struct Bounds {
    double degrees; // of the rotation
    double share;   // of the translation, relative to the distance
};
inline constexpr Bounds roughly{3, 0.02};

double angle_degrees(const Pose &a, const Pose &b);
Pose pose_of(const arhost_marker &marker);

// Returns the only marker in `found`; throws Failure if there is not exactly one, with this id.
arhost_marker expect_one(const std::vector<arhost_marker> &found, int id, const std::string &where,
                         const Grey &image);
void expect_pose(const arhost_marker &marker, const Pose &expected, const Bounds &bounds, const std::string &where,
                 const Grey &image);
void expect_none(const std::vector<arhost_marker> &found, const std::string &where, const Grey &image);
// `tracker` must have been started with this marker.
void expect_found(Tracker &tracker, const Placed &marker, const Grey &image, const Bounds &bounds,
                  const std::string &where);

} // namespace arhost::conformance
