// SPDX-License-Identifier: Apache-2.0
//
// The video of a session: a Matroska file of unknown length with one cluster per frame. Each frame is written
// immediately, and a file that ends after any cluster is valid. A killed process therefore loses no frame, and a
// restarted process appends clusters to the same file.
#pragma once

#include "libav_common/libav_pointers.hpp"
#include "sink_common/files.hpp"

#include <arhost/arhost.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace arhost::session {

struct VideoSettings {
    arhost_frame_format format;
    double fps;        // 0: unknown
    std::string codec; // "ffv1" or "h264"
    int crf;           // rate factor of h264
    int threads;
};

class VideoFile {
public:
    // Opens the encoder, but no file. Throws Failure if the frames cannot be encoded.
    VideoFile(std::filesystem::path path, const VideoSettings &settings);
    VideoFile(const VideoFile &) = delete; // libav stores its address
    VideoFile &operator=(const VideoFile &) = delete;

    void create();                    // replaces an existing file
    void resume(std::uint64_t bytes); // truncates the existing file after this number of bytes
    bool is_open() const { return file_.has_value(); }
    std::uint64_t end() const { return end_; } // size of the file

    // Appends a frame. If it throws, the file does not contain any part of the frame. `time_ms` must increase.
    void append(const std::uint8_t *const (&planes)[ARHOST_MAX_PLANES], std::int64_t time_ms);
    void truncate(std::uint64_t bytes); // removes the last frames

private:
    struct FreeMuxer {
        void operator()(AVFormatContext *p) const;
    };
    void open_encoder();
    void begin_stream();
    void fill(const std::uint8_t *const (&planes)[ARHOST_MAX_PLANES]);
    void write_pending();

    std::filesystem::path path_;
    VideoSettings settings_;
    std::optional<files::File> file_;
    std::uint64_t end_ = 0;
    std::int64_t count_ = 0;            // frames encoded by this process
    std::vector<std::uint8_t> pending_; // written by the muxer, but not to the file yet
    libav::CodecPointer encoder_;
    libav::FramePointer frame_;
    libav::PacketPointer packet_;
    std::unique_ptr<AVFormatContext, FreeMuxer> muxer_;
};

} // namespace arhost::session
