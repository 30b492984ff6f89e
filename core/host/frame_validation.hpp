// SPDX-License-Identifier: Apache-2.0
//
// Validates what workers report about a frame. Workers are not trusted.
#pragma once

#include "host/frame.hpp"
#include "ipc/protocol.hpp"
#include "model/target.hpp"

#include <span>
#include <vector>

namespace arhost::host {

// Copies a tracker's result into the frame and validates the copy. Returns nullptr if the copy is valid (finite
// numbers, valid poses, indices in range), otherwise a description of the contract violation. Does not set
// `search.unlisted_count`.
const char *accept_tracker_result(std::span<const std::byte> slot, const std::vector<model::Target> &configured,
                                  std::size_t family_count, Frame &frame);

// Copies and validates a source's frame info, which the host received at `now_ns` of CLOCK_MONOTONIC. Returns nullptr
// or the contract violation. Rejects capture times far in the future, because later frames with correct times would
// then seem to run backwards.
const char *accept_frame_info(const arhost_frame_info &info, std::int64_t previous_capture_ns, std::int64_t now_ns,
                              arhost_record &record);

// Returns the reported device time of an image. Returns 0 if none was reported or if it is longer than `busy`, the
// duration of the render call.
std::chrono::nanoseconds device_time(const arhost_render_info &info, std::chrono::nanoseconds busy);

} // namespace arhost::host
