// SPDX-License-Identifier: Apache-2.0
//
// Writes what the sinks read: the record of a frame, the composited image and, if a sink reads them, the video frame
// and the overlay.
#pragma once

#include "compositor/compositor.hpp"
#include "host/frame.hpp"
#include "latency/time_codes.hpp"
#include "supervise/launcher.hpp"

#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace arhost::host {

class Compositing {
public:
    // `draws_time_codes`: for `arhost latency`, images show time codes instead of the video.
    Compositing(const supervise::LogFunction &log, Statistics &statistics, bool draws_time_codes)
        : log_(log), statistics_(statistics), draws_time_codes_(draws_time_codes) {}

    // Writes an output slot (ipc::OutputSlot). `inputs`: ARHOST_CAPABILITY_VIDEO_INPUT, _OVERLAY_INPUT.
    void write(Frame &frame, const arhost_frame_format &format, std::uint32_t inputs, std::span<std::byte> slot);

private:
    void write_record(Frame &frame, std::span<std::byte> slot) const;
    std::pair<ImageView, Region> full_size_overlay(const Frame &frame, const arhost_frame_format &format);
    void exchange_time_code(std::span<const arhost_observation> observations, const arhost_frame_format &format,
                            const OutputView &out);
    void check_buffers_unmodified(const Frame &frame);

    const supervise::LogFunction &log_;
    Statistics &statistics_;
    const bool draws_time_codes_;
    std::optional<latency::TimeCodes> time_codes_;
    std::vector<std::uint8_t> enlarged_; // the overlay of a frame that was rendered smaller
};

} // namespace arhost::host
