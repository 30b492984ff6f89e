// SPDX-License-Identifier: Apache-2.0
//
// The video probe and commit controls. Host and camera use them to agree on a format ("USB Device Class Definition
// for Video Devices" 1.5, section 4.3.1.1).
#pragma once

#include "descriptors.hpp"

#include <optional>

namespace arhost::uvc {

// The fields that this plugin uses. It returns all other fields to the camera unchanged.
struct ProbeControl {
    std::uint8_t format = 0, frame = 0;
    std::uint32_t interval = 0;
    std::uint32_t max_frame_bytes = 0, max_payload_bytes = 0;
    std::uint32_t clock_hz = 0; // 0: not stated
};

// Returns the size of the control in a version of the class: 26, 34 or 48 bytes.
std::size_t probe_size(std::uint16_t version);

// Returns a request for a format with this frame interval.
std::vector<std::uint8_t> encode_probe(const ProbeControl &wanted, std::size_t size);
// Returns std::nullopt if there are fewer than 26 bytes.
std::optional<ProbeControl> decode_probe(Bytes bytes);

// Returns the number of bytes of an uncompressed frame; 0 for MJPEG.
std::size_t exact_frame_bytes(Encoding encoding, std::uint32_t width, std::uint32_t height);
// Returns the maximum number of bytes of a frame: the number that the camera states, limited to plausible values for
// the frame size.
std::size_t max_frame_bytes(const Format &format, const FrameSize &frame, std::uint32_t stated);

// Returns the alternate setting with the least bandwidth that suffices for payloads of this size, or nullptr if none
// suffices. A bulk endpoint suffices for any size.
const AlternateSetting *choose_alternate(const StreamingInterface &stream, std::uint32_t payload_bytes);

} // namespace arhost::uvc
