// SPDX-License-Identifier: Apache-2.0
//
// Payloads of a USB camera ("USB Device Class Definition for Video Devices" 1.5, section 2.4.3.3) and the frames that
// they form. The bytes come from the device and are not trusted.
#pragma once

#include "descriptors.hpp"

#include <functional>
#include <optional>
#include <string>

namespace arhost::uvc {

struct PayloadHeader {
    std::size_t size = 0;
    bool frame_id = false; // changes with each frame
    bool ends_frame = false;
    bool has_error = false;
    bool is_still = false;
    std::optional<std::uint32_t>
        presentation_ticks; // PTS: when the frame was captured, in ticks of the camera's clock
    std::optional<std::uint32_t>
        clock_ticks; // SCR: when the payload was sent. The other half of the SCR, the bus frame number, is not used
};

// Returns std::nullopt if the payload has no valid header.
std::optional<PayloadHeader> parse_payload_header(Bytes payload);

enum class Damage { none, marked, lost_packet, malformed, truncated, oversized };

// Numbers of frames that were not delivered, by cause.
struct Losses {
    std::uint64_t marked = 0;      // marked as damaged by the camera
    std::uint64_t lost_packet = 0; // a packet was lost on the bus
    std::uint64_t malformed = 0;   // a payload had no valid header
    std::uint64_t truncated = 0, oversized = 0;
    std::uint64_t superseded = 0; // replaced by a newer frame, or not read in time

    void count(Damage damage);
    bool operator==(const Losses &) const = default;
};

struct AssembledFrame {
    std::vector<std::uint8_t> bytes;
    std::int64_t arrival_ns = 0; // arrival of the frame's first payload
    std::optional<std::uint32_t> presentation_ticks;
    // From the first payload that contains it; that payload arrived at clock_arrival_ns.
    std::optional<std::uint32_t> clock_ticks;
    std::int64_t clock_arrival_ns = 0;
    Damage damage = Damage::none; // the first cause of damage
};

// Assembles frames from payloads. Passes each frame with any data, even if damaged, to `take`.
class FrameAssembler {
public:
    using Take = std::function<void(AssembledFrame &frame)>; // may move the bytes out of the frame

    // `max_bytes`: maximum size of a frame. `exact_bytes`: size of an intact frame; 0: any size.
    FrameAssembler(std::size_t max_bytes, std::size_t exact_bytes, Take take);

    // Adds a whole payload.
    void add_payload(Bytes payload, std::int64_t arrival_ns);
    // Adds bytes from a bulk endpoint, where a payload may span several transfers. `ends_payload`: whether these
    // bytes end the payload.
    void add_bulk(Bytes bytes, bool ends_payload, std::int64_t arrival_ns);
    // Records that a packet was lost on the bus.
    void lose_packet();

private:
    void begin(Bytes payload, std::int64_t arrival_ns);
    void append(Bytes data);
    void end();
    void finish();
    void damage(Damage cause);

    std::size_t max_bytes_, exact_bytes_;
    Take take_;
    AssembledFrame frame_;
    bool in_frame_ = false;
    bool frame_id_ = false;
    bool in_payload_ = false, ends_frame_ = false, skips_payload_ = false; // state of the current payload
};

} // namespace arhost::uvc
