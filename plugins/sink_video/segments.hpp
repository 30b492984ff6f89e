// SPDX-License-Identifier: Apache-2.0
//
// A film is written in segments, a new one after each restart, which are joined at its end. A segment
// is a Matroska file, one cluster a frame: whatever is in the file can be read, however it ended. (Of the
// containers that players know, a fragmented MP4 would do too, but libav loses the gaps between frames.)
#pragma once

#include "libav.hpp"

#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

namespace arhost::video {

struct Segment {
    std::filesystem::path path; // ".demo.mp4.from120.mkv" beside "demo.mp4"
    std::int64_t first;         // its frames bear this number or a higher one
};

Segment segment_of(const std::filesystem::path &film, std::int64_t first);
std::vector<Segment> find_segments(const std::filesystem::path &film); // ascending

class SegmentWriter {
public:
    SegmentWriter(const std::filesystem::path &path, const AVCodecContext &encoder);
    void append(AVPacket &packet); // its times in the encoder's time base; changes them

private:
    void flush(int code);

    std::filesystem::path path_;
    AVRational time_base_;
    OutputPointer output_;
};

// Writes the segments' packets, as they are, to a film of libav's format `format` ("mp4"). Of each
// segment, frames from the next segment's first on are left out. Returns the number of frames; 0: there
// were none, and `film` is not to be used. `progress` is called now and then with 0 to 1, `warn` with
// what the user should know.
std::int64_t join(const std::vector<Segment> &segments, const std::filesystem::path &film, const char *format,
                  AVRational fps, const std::function<void(double)> &progress,
                  const std::function<void(const std::string &)> &warn);

} // namespace arhost::video
