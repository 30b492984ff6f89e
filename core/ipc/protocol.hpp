// SPDX-License-Identifier: Apache-2.0
//
// The shared memory pages of host and worker, and the entries of the rings in them. See messages.hpp for the control
// messages.
#pragma once

#include "ipc/ring.hpp"
#include "ipc/wake.hpp"

#include <arhost/arhost.h>

#include <cstdint>
#include <string>
#include <string_view>

namespace arhost::ipc {

enum class CommandKind : std::uint32_t {
    control = 1, // receive one message from the control channel
    read = 2,    // source: read a frame into output slot `slot`
    track = 3,   // tracker: process slot `input_slot` of input memory `input_generation`, with the state in slot
                 // `state_slot` of input memory `state_generation`; write result and new state to output slot `slot`
    render = 4,  // ray tracer: render the view of `camera`, with the state in slot `state_slot` of input memory
                 // `state_generation`; write image and new state to output slot `slot`. The anchors of the scene, if
                 // it has any, are in slot `input_slot` of input memory `input_generation`, and the frame under the
                 // overlay, if the setup has a format for it, in slot `video_slot` of `video_generation`
    write = 5    // sink: write the frame in slot `input_slot` of input memory `input_generation`
};

struct Command {
    CommandKind kind;
    std::uint32_t slot;
    std::uint32_t input_generation;
    std::uint32_t input_slot;
    std::uint32_t state_generation; // 0: no state
    std::uint32_t state_slot;
    std::uint64_t ticket; // number of the command, increasing; the result contains the same number
    std::uint64_t sequence;
    std::int64_t capture_ns;
    arhost_clock clock;
    std::uint32_t state_is_of_solver_only; // non-zero: another plugin wrote the plugin's part of the state
    double time_s;
    std::uint32_t max_samples; // render: as in arhost_render_request
    std::uint32_t shading_px;  // likewise
    std::uint32_t video_generation;
    std::uint32_t video_slot;
    arhost_camera camera;
};

struct Result {
    std::uint64_t ticket;
    arhost_status status;
    std::uint32_t reserved;
    std::int64_t busy_ns;      // time spent in the plugin function
    std::int64_t ended_ns;     // when the plugin function returned, CLOCK_MONOTONIC
    arhost_frame_info frame;   // set only by CommandKind::read
    arhost_render_info render; // set only by CommandKind::render
};

// The plugin function that a worker is executing, for crash reports.
enum class Call : std::uint32_t {
    none,
    load,
    negotiate,
    create,
    start,
    per_frame,
    idle,
    stop,
    destroy,
    devices,
    set_option,
    counters
};

// Returns, for example, "in create" or "while its library was loaded". `per_frame`: name of the per-frame function of
// the plugin's kind.
std::string to_text(Call call, std::string_view per_frame = "its per-frame call");

constexpr std::uint32_t ring_capacity = 16;

// Written by the host, read-only to the worker.
struct HostPage {
    WakeWord wake;
    alignas(64) std::atomic<std::uint32_t> cancelled; // non-zero: the running call must return soon
    ProducerSide<Command, ring_capacity> commands;
    ConsumerSide results;
};

// Written by the worker, read-only to the host.
struct WorkerPage {
    alignas(64) std::atomic<std::uint32_t> call;
    ProducerSide<Result, ring_capacity> results;
    ConsumerSide commands;
};

using CommandProducer = Producer<Command, ring_capacity>;
using CommandConsumer = Consumer<Command, ring_capacity>;
using ResultProducer = Producer<Result, ring_capacity>;
using ResultConsumer = Consumer<Result, ring_capacity>;

// Bytes from one row of the image in a ray tracer's slot to the next.
inline std::uint32_t overlay_stride(std::uint32_t width, arhost_image_form form = ARHOST_IMAGE_FORM_STRAIGHT) {
    return (width * (form == ARHOST_IMAGE_FORM_LINEAR ? 16 : 4) + 63) / 64 * 64;
}

// Bytes; far beyond any memory, so that the sizes of slots and regions do not overflow.
inline constexpr std::uint64_t max_raytracer_state = std::uint64_t{1} << 40;

// Layout of a slot that a ray tracer's worker writes: the image, then the plugin's state, which only the worker can
// read.
class RaytracerSlot {
public:
    RaytracerSlot(std::uint32_t width, std::uint32_t height, arhost_image_form form)
        : image_size(std::uint64_t{overlay_stride(width, form)} * height),
          state_offset((image_size + 4095) / 4096 * 4096) {}
    const std::uint64_t image_size, state_offset;
    std::uint64_t byte_size(std::uint64_t state_size) const {
        return state_size > 0 ? state_offset + state_size : image_size;
    }
};

// A slot that a ray tracer's worker reads contains one AnchorPose for each anchor of the scene.
struct AnchorPose {
    std::uint32_t is_visible;
    std::uint32_t reserved;
    double world_from_anchor[16]; // column-major
};

// Layout of a slot that a tracker's worker writes: a header, an arhost_target for each configured target, the
// observations, the expected markers, then the states of the worker and of the plugin. Only the worker can read these
// states.
class TrackerSlot {
public:
    struct Header {
        std::uint32_t observation_count, expected_count;
        std::uint32_t missed_count; // number of expected markers that were missed
        std::int32_t searched_everywhere, candidate_count;
    };
    static constexpr std::uint64_t targets_offset = 64;

    explicit TrackerSlot(std::size_t target_count)
        : observations_offset(aligned(targets_offset + target_count * sizeof(arhost_target))),
          expected_offset(aligned(observations_offset + ARHOST_MAX_OBSERVATIONS * sizeof(arhost_observation))),
          state_offset(aligned(expected_offset + ARHOST_MAX_MARKERS * sizeof(arhost_expected_marker))) {}
    const std::uint64_t observations_offset, expected_offset, state_offset;
    std::uint64_t byte_size(std::uint64_t state_size) const { return state_offset + state_size; }

private:
    static std::uint64_t aligned(std::uint64_t offset) { return (offset + 63) / 64 * 64; }
};

// Layout of a slot that sinks read: the record, its targets, observations and expected markers, the composited image,
// the video frame and the overlay. The pointers in the record are not set. The host fills the video frame and the
// overlay only if a sink reads them; unused pages take no memory.
class OutputSlot {
public:
    static constexpr std::uint64_t targets_offset = (sizeof(arhost_record) + 63) / 64 * 64;
    static constexpr std::uint64_t observations_offset = targets_offset + ARHOST_MAX_TARGETS * sizeof(arhost_target);
    static constexpr std::uint64_t expected_offset =
        observations_offset + ARHOST_MAX_OBSERVATIONS * sizeof(arhost_observation);
    static constexpr std::uint64_t image_offset =
        (expected_offset + ARHOST_MAX_MARKERS * sizeof(arhost_expected_marker) + 4095) / 4096 * 4096;
    static std::uint32_t stride(std::uint32_t width) { return (width * 3 + 63) / 64 * 64; }

    explicit OutputSlot(const arhost_frame_format &video)
        : video_offset(aligned(image_offset + std::uint64_t(stride(video.width)) * video.height)),
          overlay_offset(aligned(video_offset + video.byte_size)),
          byte_size(overlay_offset + std::uint64_t(overlay_stride(video.width)) * video.height) {}
    const std::uint64_t video_offset, overlay_offset, byte_size;

private:
    static std::uint64_t aligned(std::uint64_t offset) { return (offset + 4095) / 4096 * 4096; }
};

} // namespace arhost::ipc
