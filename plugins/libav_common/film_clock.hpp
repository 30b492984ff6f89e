// SPDX-License-Identifier: Apache-2.0
//
// Continuous time, and complete pictures, where the time stamps of a stream jump. In MPEG-TS, they do so where two
// videos are joined, and where a camera starts again.
#pragma once

#include "libav_common/libav_pointers.hpp"

#include <cstdint>
#include <deque>
#include <optional>

namespace arhost::libav {

// Maps the time stamps of pictures, in display order, to times that never decrease.
class FilmClock {
public:
    // `period_ns`: the time from one picture to the next; used where the time stamps do not tell it.
    explicit FilmClock(std::int64_t period_ns = 0) : period_ns_(period_ns) {}

    // `has_jumps`: whether the container allows jumps (AVFMT_TS_DISCONT). Otherwise, a step back is a wrong time
    // stamp, and a long step forwards is a long picture.
    std::int64_t next_ns(std::optional<std::int64_t> stamp_ns, bool has_jumps);
    std::int64_t time_ns() const { return time_ns_; } // of the last picture; the first one's is its time stamp, or 0

private:
    std::int64_t period_ns_, time_ns_ = 0;
    std::optional<std::int64_t> offset_ns_;             // time minus time stamp; nullopt before the first time stamp
    std::optional<std::int64_t> offset_before_jump_ns_; // if the last time stamp jumped, which may have been an error
    bool is_first_ = true;
};

// Reads the packets of one stream.
class PacketReader {
public:
    PacketReader();
    // Must be called before `input` is opened: libav would take a jump backwards for an overflow of the time stamps,
    // which adds 26.5 hours.
    static void keep_time_stamps(AVFormatContext &input) { input.correct_ts_overflow = 0; }

    void attach(AVFormatContext &input, const AVStream &stream) { input_ = &input, stream_ = &stream; }
    // Returns 0, or libav's error code. A packet of an MPEG-TS stream is marked as damaged if the counter of the data
    // after it does not continue, as it is where another video begins. This function removes the mark there.
    int read();
    AVPacket &packet() { return *packet_; }

private:
    void read_ahead();
    int read_one(AVPacket &packet);

    AVFormatContext *input_ = nullptr;
    const AVStream *stream_ = nullptr;
    PacketPointer packet_;
    std::deque<PacketPointer> ahead_; // packets after packet_ that have been read
    std::optional<int> end_;          // the error code of reading after them; nullopt: none yet
};

} // namespace arhost::libav
