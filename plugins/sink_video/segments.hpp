// SPDX-License-Identifier: Apache-2.0
//
// A video is written in segments, which are joined at the end. Each start of the sink begins a new segment. A segment
// is a Matroska file with one cluster per frame. This format is used because all complete clusters of a truncated
// file can be read. (Fragmented MP4 has the same property, but libav loses the gaps between its frames.) The time
// stamps in a segment are capture times in ms. A BlockAdditional stores the number of each frame.
#pragma once

#include "libav.hpp"

#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

namespace arhost::video {

struct Segment {
    std::filesystem::path path; // ".demo.mp4.from120.mkv" next to "demo.mp4"
    std::int64_t first;         // number of its first frame
};

Segment segment_of(const std::filesystem::path &video, std::int64_t first);
std::vector<Segment> find_segments(const std::filesystem::path &video); // sorted by `first`

class SegmentWriter {
public:
    SegmentWriter(const std::filesystem::path &path, const AVCodecContext &encoder);
    // Modifies the packet's times. Capture times must not decrease.
    void append(AVPacket &packet, std::int64_t number, std::int64_t capture_ns);

private:
    void flush(int code);

    std::filesystem::path path_;
    OutputPointer output_;
    std::int64_t last_time_; // in the time base of the stream
};

// Copies the packets of all segments to `video`. `format` is libav's name of the file format ("mp4"). If two segments
// contain the same frame, takes it from the later segment. The video begins at time 0. Capture times within 1 ms of a
// multiple of 1/fps are rounded to this multiple, so that a constant frame rate remains constant. Returns the number
// of frames; if it is 0, `video` is unusable. Calls `progress` regularly with a fraction from 0 to 1, and `warn` with
// messages for the user.
std::int64_t join(const std::vector<Segment> &segments, const std::filesystem::path &video, const char *format,
                  AVRational fps, const std::function<void(double)> &progress,
                  const std::function<void(const std::string &)> &warn);

} // namespace arhost::video
