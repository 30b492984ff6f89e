// SPDX-License-Identifier: Apache-2.0
//
// Writes what the sinks read: the record of a frame, the composited image and, if a sink reads them, the video frame
// and the overlay.
#pragma once

#include "compositor/compositor.hpp"
#include "host/run_parts.hpp"
#include "latency/time_codes.hpp"

#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace arhost::host {

class Compositing {
public:
    explicit Compositing(RunParts &parts) : parts_(parts) {}

    // Writes an output slot (ipc::OutputSlot). `inputs`: ARHOST_SINK_CAPABILITY_VIDEO_INPUT, _OVERLAY_INPUT.
    void write(Frame &frame, std::uint64_t inputs, std::span<std::byte> slot);

private:
    void write_record(Frame &frame, std::span<std::byte> slot) const;
    std::pair<ImageView, Region> full_size_overlay(const Frame &frame);
    void exchange_time_code(std::span<const arhost_observation> observations, const OutputView &out);
    void check_buffers_unmodified(const Frame &frame);

    RunParts &parts_;
    std::optional<latency::TimeCodes> time_codes_; // for `arhost latency`, shown instead of the video
    std::vector<std::uint8_t> enlarged_;           // the overlay of a frame that was rendered smaller
};

} // namespace arhost::host
