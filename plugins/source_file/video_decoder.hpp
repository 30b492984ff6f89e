// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "libav_common/film_clock.hpp"
#include "libav_common/log.hpp"
#include "libav_common/picture_converter.hpp"
#include "reader.hpp"

#include <filesystem>
#include <optional>
#include <string>

namespace arhost {

// Decodes the first video stream of a file in display order.
class Decoder {
public:
    Decoder(const std::filesystem::path &file, const Host &host, LibavLog &log);
    Decoder(const Decoder &) = delete; // libav stores its address
    Decoder &operator=(const Decoder &) = delete;

    // Decodes the next picture. Returns ARHOST_STATUS_OK, ARHOST_STATUS_END, ARHOST_STATUS_END_TRUNCATED or
    // ARHOST_STATUS_ERROR_CANCELLED.
    arhost_status next();

    const AVFrame &picture() const { return *frame_; }
    std::uint64_t index() const { return count_ - 1; } // index of the current picture, from 0
    std::uint64_t count() const { return count_; }     // number of pictures decoded so far
    std::int64_t media_ns() const { return clock_.time_ns(); }
    std::int64_t end_ns() const { return media_ns() + period_ns_; }
    bool ended() const { return ended_; }

    double fps() const { return fps_; }
    std::uint64_t declared_count() const; // the frame count in the header; 0: unknown
    int quarter_turns() const;            // clockwise rotation to apply

    // Messages about damaged data found so far, and about truncation. Each is "" if there is no such fault.
    const std::string &damage() const { return damage_; }
    const std::string &truncation() const { return truncation_; }

private:
    arhost_status feed();
    void take_time();
    void finish();

    std::string name_;
    Host host_;
    LibavLog &log_;
    libav::InputPointer file_;
    AVStream *stream_ = nullptr; // owned by file_
    libav::CodecPointer codec_;
    libav::PacketReader packets_;
    libav::FramePointer frame_;
    double fps_ = 0;
    std::int64_t period_ns_ = 0;
    std::uint64_t count_ = 0, packet_count_ = 0;
    std::int64_t first_pts_ = AV_NOPTS_VALUE;
    libav::FilmClock clock_;
    bool lost_data_ = false; // data was lost or damaged since the previous picture
    bool ended_ = false;
    // Whether the file is shorter than its header declares; nullopt for a container that does not declare its size.
    std::optional<bool> is_short_;
    int read_error_ = 0;                    // the error that ended reading; 0: the end of the file
    std::string decoder_fault_, end_fault_; // libav's last error while decoding, and at the end
    std::string damage_, truncation_;
};

class Video final : public Reader {
public:
    Video(std::filesystem::path file, const Host &host);

    arhost_frame_format format() const override;
    std::uint64_t frame_count() const override;
    arhost_status go_to(std::uint64_t index) override;
    std::optional<std::int64_t> media_ns() const override { return decoder_->media_ns(); }
    std::int64_t end_ns() const override { return decoder_->end_ns(); }
    void copy_to(const arhost_frame_buffer &buffer) override;

private:
    void open(); // positions at frame 0
    void check_size() const;
    void warn_once(const std::string &fault, bool &warned) const;

    std::filesystem::path file_;
    Host host_;
    LibavLog log_;
    std::optional<Decoder> decoder_;
    std::optional<PictureConverter> converter_;
    int width_ = 0, height_ = 0; // size of all pictures, before rotation
    bool damage_reported_ = false, truncation_reported_ = false;
};

} // namespace arhost
