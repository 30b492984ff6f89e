// SPDX-License-Identifier: Apache-2.0
//
// A film is written in segments, one per start of the sink, which are joined at the end. A segment is a Matroska file
// with one cluster per frame: all complete clusters of a truncated file can be read. (A fragmented MP4 would do too,
// but libav loses the gaps between frames there.)
#pragma once

#include "libav.hpp"

#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

namespace arhost::video {

struct Segment {
    std::filesystem::path path; // ".demo.mp4.from120.mkv" next to "demo.mp4"
    std::int64_t first;         // its lowest frame number
};

Segment segment_of(const std::filesystem::path &film, std::int64_t first);
std::vector<Segment> find_segments(const std::filesystem::path &film); // ascending

class SegmentWriter {
public:
    SegmentWriter(const std::filesystem::path &path, const AVCodecContext &encoder);
    void append(AVPacket &packet); // with times in the encoder's time base; modifies them

private:
    void flush(int code);

    std::filesystem::path path_;
    AVRational time_base_;
    OutputPointer output_;
};

// Copies the packets of all segments to a film of libav's format `format` ("mp4"). A frame that is in two segments is
// taken from the later one. Returns the number of frames; if 0, `film` is unusable. Calls `progress` regularly with 0
// to 1, and `warn` with messages for the user.
std::int64_t join(const std::vector<Segment> &segments, const std::filesystem::path &film, const char *format,
                  AVRational fps, const std::function<void(double)> &progress,
                  const std::function<void(const std::string &)> &warn);

} // namespace arhost::video
