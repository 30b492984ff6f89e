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

    virtual arhost_frame_format format() const = 0; // of every frame; without plane layout
    // 0: unknown. For a video, the header's count until the end has been read.
    virtual std::uint64_t frame_count() const = 0;

    // Seeks to frame `index`: ARHOST_STATUS_OK, ARHOST_STATUS_END, ARHOST_STATUS_END_TRUNCATED or
    // ARHOST_STATUS_ERROR_CANCELLED. The bytes of a frame do not depend on what was read before.
    virtual arhost_status go_to(std::uint64_t index) = 0;

    // Presentation start and end of the current frame, relative to frame 0; nullopt if the medium has no time stamps.
    virtual std::optional<std::int64_t> media_ns() const { return std::nullopt; }
    virtual std::int64_t end_ns() const { return 0; }
    virtual void copy_to(const arhost_frame_buffer &buffer) = 0;
};

} // namespace arhost
