// SPDX-License-Identifier: Apache-2.0
//
// A sequence of frames, numbered from 0.
#pragma once

#include <arhost-cpp/plugin.hpp>

#include <cstdint>
#include <optional>

namespace arhost {

class Reader {
public:
    virtual ~Reader() = default;

    virtual arhost_frame_format format() const = 0; // the format of all frames, without the plane layout
    // Returns 0 if the count is unknown. For a video, returns the count in the header until the end has been read,
    // then the true count.
    virtual std::uint64_t frame_count() const = 0;

    // Seeks to frame `index`. Returns ARHOST_STATUS_OK, ARHOST_STATUS_END, ARHOST_STATUS_END_TRUNCATED or
    // ARHOST_STATUS_ERROR_CANCELLED. The bytes of a frame do not depend on the frames read before.
    virtual arhost_status go_to(std::uint64_t index) = 0;

    // media_ns and end_ns return the presentation start and end of the current frame, relative to frame 0. media_ns
    // returns std::nullopt if the file has no time stamps.
    virtual std::optional<std::int64_t> media_ns() const { return std::nullopt; }
    virtual std::int64_t end_ns() const { return 0; }
    virtual void copy_to(const arhost_frame_buffer &buffer) = 0;
};

} // namespace arhost
