// SPDX-License-Identifier: Apache-2.0
//
// What a path stands for: a run of frames, numbered from 0.
#pragma once

#include <arhost-cpp/plugin.hpp>

#include <cstdint>
#include <optional>

namespace arhost {

class Reader {
public:
    virtual ~Reader() = default;

    virtual arhost_frame_format format() const = 0; // of every frame; not yet laid out
    // What is known of it: a video's is what its header says, until its end has been read. 0: unknown.
    virtual std::uint64_t frame_count() const = 0;

    // Makes frame `index` the current one: ARHOST_STATUS_OK, ARHOST_STATUS_END, ARHOST_STATUS_END_TRUNCATED or
    // ARHOST_STATUS_ERROR_CANCELLED. The same index gives the same bytes, whatever was read before.
    virtual arhost_status go_to(std::uint64_t index) = 0;

    // Of the current frame: when it is shown, with frame 0 at 0, and until when. None where the medium
    // has no times of its own.
    virtual std::optional<std::int64_t> media_ns() const { return std::nullopt; }
    virtual std::int64_t end_ns() const { return 0; }
    virtual void copy_to(const arhost_frame_buffer &buffer) = 0;
};

} // namespace arhost
