// SPDX-License-Identifier: Apache-2.0
//
// The contents of a session's log (docs/sessions.md), and their packed form. A sandboxed worker reads the log,
// because it may come from a stranger, and passes the packed form to the host, which does not trust the worker.
#pragma once

#include "camera/trajectory.hpp"

#include <arhost/sink.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace arhost::session {

// The record of a frame: data that the video does not contain, and the decisions of the recorded run.
struct RecordedFrame {
    std::uint64_t number; // number in the recorded run; frames that the recorded run dropped are missing
    std::int64_t capture_ns;
    arhost_clock clock;
    arhost_overlay overlay;
    double scale;             // quality of the overlay, as in host::Quality
    std::uint32_t samples;    // samples per pixel, as in host::Quality
    std::uint32_t shading_px; // likewise
    std::vector<arhost_target> targets;
    std::vector<arhost_observation> observations; // observations of markers that belong to targets
    arhost_search search{};
    std::optional<camera::View> view;
    std::optional<std::pair<std::string, std::array<double, 16>>> truth; // truth_target and true_mt of arhost_record
};

struct Log {
    std::vector<RecordedFrame> frames; // those that the video contains completely; at least one
    std::uint64_t lacking = 0;         // later frames, which the video lacks
    bool is_complete = false;          // the log has the line that ends a recording
};

// Returns what a run could not replay: a value that is out of range, or that contradicts the frame before, which is
// null for the first frame. Returns "" if there is nothing.
std::string problem_with(const RecordedFrame &frame, const RecordedFrame *before);

// The packed form has at most this multiple of the bytes of the log. 82 bytes of a log may become a target of 640.
constexpr std::size_t max_expansion = 8;
std::size_t packed_size(const Log &log);
// `memory` has packed_size(log) bytes.
void pack(const Log &log, std::span<std::byte> memory);
// Reads a packed log from memory that does not change. Throws std::runtime_error if it is not the packed form of a
// log without problems, or has more than `max_frames`.
Log unpack(std::span<const std::byte> memory, std::uint64_t max_frames = std::numeric_limits<std::uint64_t>::max());
// The record of a frame has more bytes in the log.
constexpr std::size_t min_line_bytes = 80;

} // namespace arhost::session
