// SPDX-License-Identifier: Apache-2.0
// Runs a tracker on frames of printed markers.
#pragma once

#include "conformance/guarded_memory.hpp"
#include "conformance/plugin_library.hpp"
#include "conformance/prints.hpp"
#include "conformance/scenes.hpp"
#include "conformance/test.hpp"

#include <cstring>
#include <deque>
#include <memory>
#include <optional>
#include <span>

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

using Corners = std::array<glm::dvec2, 4>;

struct Listed { // a target that consists of one marker
    int id;
    double side_mm;
    std::uint32_t family = 0; // index in TrackerSetup's families
};

// An array of structs whose elements end with `extra` bytes that the plugin does not know.
template <class T> class Elements {
public:
    explicit Elements(std::size_t extra) : stride_(sizeof(T) + extra) {}
    void add(T element) {
        element.struct_size = static_cast<std::uint32_t>(stride_);
        bytes_.resize(bytes_.size() + stride_, std::byte{0xa5});
        std::memcpy(bytes_.data() + bytes_.size() - stride_, &element, sizeof element);
    }
    const T *first() const { return reinterpret_cast<const T *>(bytes_.data()); }
    std::uint32_t count() const { return static_cast<std::uint32_t>(bytes_.size() / stride_); }

private:
    std::size_t stride_;
    std::vector<std::byte> bytes_;
};

// An arhost_tracker_setup with its arrays.
class TrackerSetup {
public:
    // `context` must live as long as this object.
    TrackerSetup(const Context &context, const arhost_intrinsics &camera, std::vector<std::string> families,
                 arhost_pixel_format format = ARHOST_PIXEL_FORMAT_GREY8, std::size_t extra = 0);
    void add(const Listed &marker);
    void add_map(std::span<const Placed> markers, const Pose &camera_from_map); // of the first family
    void add_body(const std::string &body);
    arhost_tracker_setup setup() const; // valid as long as this object

private:
    std::uint32_t add_target(const std::string &name, const char *body = nullptr);
    void add_marker(int id, std::uint32_t family, std::uint32_t target, const std::array<glm::dvec3, 4> &corners);

    const Context &context_;
    arhost_intrinsics camera_;
    arhost_frame_format format_;
    std::vector<std::string> families_;
    std::vector<const char *> family_names_;
    std::deque<std::string> names_;
    Elements<arhost_target_config> targets_;
    Elements<arhost_marker_config> markers_;
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
    // `extra`: bytes that the plugin does not know after each element of the result.
    arhost_status start_with(const TrackerSetup &setup, std::size_t extra = 0);
    void stop();

    arhost_status try_track(const SealedFrame &frame, std::uint64_t sequence, std::int64_t capture_ns);
    // Of the last call of track. Throw Failure if there are more than the ABI allows.
    std::vector<arhost_observation> observations() const;
    std::vector<arhost_body_pose> poses() const;
    // The state_after of the last successful call of track. The next call gets `state` as its state_before, or NULL
    // if it is empty; before the call, state_after is filled with `filler`.
    std::vector<std::byte> state() const;
    void set_state(const std::vector<std::byte> &state, std::byte filler = std::byte{0xa5});
    bool has_state() const { return state_size_ > 0; }
    // The next calls of track expect these markers and need not search elsewhere.
    struct Expected {
        std::uint32_t marker; // index in the setup
        Corners corners_px;
        double margin_px;
    };
    void expect(const std::vector<Expected> &markers);
    void search_everywhere() { expected_memory_.reset(); }

    // Observations in the next frame, at 30 frames/s. Throws Failure unless it succeeds.
    std::vector<arhost_observation> track(const SealedFrame &frame);
    std::vector<arhost_observation> track(const Grey &image) {
        return track(SealedFrame(image, ARHOST_PIXEL_FORMAT_GREY8));
    }
    // Restarts the tracker and tracks one frame, so there are no earlier frames.
    std::vector<arhost_observation> track_first(const SealedFrame &frame);
    std::vector<arhost_observation> track_first(const Grey &image) {
        return track_first(SealedFrame(image, ARHOST_PIXEL_FORMAT_GREY8));
    }

    Instance &instance() { return *instance_; }
    std::uint32_t observation_size() const { return static_cast<std::uint32_t>(sizeof(arhost_observation) + extra_); }
    std::uint32_t pose_size() const { return static_cast<std::uint32_t>(sizeof(arhost_body_pose) + extra_); }

private:
    void create();
    arhost_tracker_result prepare_result();
    std::uint64_t aligned_state_size() const { return (state_size_ + 63) / 64 * 64; }

    const Context &context_;
    PluginLibrary &library_;
    Settings overrides_;
    std::optional<Instance> instance_;
    const arhost_tracker &functions_;
    std::size_t extra_ = 0;
    std::uint32_t target_count_ = 0;
    std::unique_ptr<GuardedMemory> observation_memory_, pose_memory_;
    GuardedMemory result_memory_;
    std::uint64_t state_size_ = 0;
    std::byte state_filler_{0xa5};
    std::unique_ptr<GuardedMemory> state_before_;    // null: none
    std::unique_ptr<GuardedMemory> expected_memory_; // null: search everywhere
    std::uint32_t expected_count_ = 0;
    bool fresh_ = true, started_ = false;
    arhost_intrinsics camera_{}; // of the last start
    std::vector<Listed> listed_;
    arhost_pixel_format format_ = ARHOST_PIXEL_FORMAT_GREY8;
    std::uint64_t sequence_ = 0; // of the next frame
};

inline constexpr std::int64_t frame_ns = 33'333'333;

// A camera of the tests. If the prints are pictures, it has four times as many pixels along each side, because a
// tracker needs more pixels to recognise a picture than to read a marker.
arhost_intrinsics camera_for(const Context &context, std::uint32_t width, std::uint32_t height, double focal);

// A wide-angle camera. Its frames with one byte per pixel fill whole memory pages.
inline arhost_intrinsics wide_camera(const Context &context) {
    return camera_for(context, 320, 256, 300);
}

Grey empty_image(const arhost_intrinsics &camera);

// The markers to draw for the tracker. Throws Skip if it detects no markers.
std::vector<Print> prints_of(const Context &context);

// ---- Expectations ----------------------------------------------------------------------------------

struct Bounds {
    double degrees; // of the rotation
    double share;   // of the translation, relative to the distance
};
inline constexpr Bounds roughly{3, 0.02};

Corners corners_of(const arhost_observation &observation);
inline constexpr std::array corner_names = {"top left", "top right", "bottom right", "bottom left"};

// Returns the pose of a rigid set of markers, from their observed corners. Throws Failure if there is none.
struct Observed {
    arhost_observation observation;
    Placed marker;
};
Pose solve(const arhost_intrinsics &camera, std::span<const Observed> markers, const Pose &camera_from_target,
           const std::string &where, const Grey &image);

// Returns the only element of `found`; throws Failure if there is not exactly one, with this id.
arhost_observation expect_one(const std::vector<arhost_observation> &found, int id, const std::string &where,
                              const Grey &image);
void expect_pose(const Pose &actual, const Pose &expected, const Bounds &bounds, const std::string &what,
                 const Grey &image);
// The pose that follows from the corners must be that of the marker.
void expect_corners(const arhost_observation &observation, const arhost_intrinsics &camera, const Placed &marker,
                    const Bounds &bounds, const std::string &where, const Grey &image);
void expect_none(const std::vector<arhost_observation> &found, const std::string &where, const Grey &image);
// `tracker` must have been started with this marker.
void expect_found(Tracker &tracker, const arhost_intrinsics &camera, const Placed &marker, const Grey &image,
                  const Bounds &bounds, const std::string &where);

struct InFamily {
    Placed marker;
    std::uint32_t family = 0; // index in the setup
};
// Each marker must be observed once at its place, and nothing else.
void expect_all(const std::vector<arhost_observation> &found, const arhost_intrinsics &camera,
                std::span<const InFamily> markers, const std::string &where, const Grey &image);

// Describes how two results for the same frame differ, as the end of a sentence; empty if they have the same bytes.
std::string difference(std::span<const arhost_observation> actual, std::span<const arhost_observation> expected);

} // namespace arhost::conformance
