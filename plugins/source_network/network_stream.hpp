// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "jpeg_splitter.hpp"
#include "libav_common/film_clock.hpp"
#include "libav_common/log.hpp"

#include <arhost-cpp/plugin.hpp>

#include <chrono>
#include <cstdint>
#include <optional>
#include <stop_token>
#include <string>

namespace arhost {

struct StreamSettings {
    std::string url;                   // a URL that check_url accepts
    std::string transport;             // transport of RTSP: "tcp" or "udp"
    std::chrono::milliseconds timeout; // maximum time without an intact picture
    bool verifies_tls;
};

// CLOCK_MONOTONIC, in ns.
std::int64_t monotonic_ns();

// One connection to a network camera. Decodes the first video track.
class NetworkStream {
public:
    // Connects. The constructor and next() throw Failure on errors, and if `stop` is requested.
    NetworkStream(const StreamSettings &settings, LibavLog &log, std::stop_token stop);
    NetworkStream(const NetworkStream &) = delete; // libav stores its address
    NetworkStream &operator=(const NetworkStream &) = delete;

    // Decodes the next intact picture. Returns false at the end of a recording; throws Failure if the connection is
    // lost or no intact picture arrives within the timeout.
    bool next();

    const AVFrame &picture() const { return *picture_; }
    std::int64_t arrival_ns() const { return arrival_ns_; } // arrival of the picture's last data, CLOCK_MONOTONIC
    // The picture's time by the sender's clock, with an arbitrary epoch; nullopt if it has no time stamp. It is
    // continuous where the time stamps jump.
    std::optional<std::int64_t> sender_ns() const { return sender_ns_; }
    // The picture's time by the sender's wall clock (UTC), computed from RTCP sender reports; nullopt if no report
    // has arrived.
    std::optional<std::int64_t> sender_utc_ns() const;
    // The number of damaged pictures between the previous picture and this one.
    std::uint32_t damaged() const { return damaged_; }
    // Returns whether data arrives faster than in real time, as in recordings and in HLS, whose segments contain
    // seconds of video. Pictures must then wait until they are due.
    bool is_ahead_of_time() const { return ahead_of_time_; }
    double fps() const; // 0: unknown

private:
    void open(const StreamSettings &settings);
    void open_decoder();
    bool feed(); // returns false at the end of the data
    int read_packet();
    int read_to_boundary(AVPacket &packet);
    std::optional<std::int64_t> stamp_ns() const;
    Failure failure(int code);

    std::string name_; // name for messages, without credentials
    std::chrono::milliseconds timeout_;
    bool verifies_tls_;
    LibavLog &log_;
    std::stop_token stop_;
    std::chrono::steady_clock::time_point deadline_; // for the next picture
    decltype(AVFormatContext::io_open) open_io_ = nullptr;

    libav::InputPointer input_;
    AVStream *track_ = nullptr; // owned by input_
    libav::CodecPointer codec_;
    libav::PacketReader packets_;
    libav::FramePointer picture_;
    bool finds_boundaries_ = false; // of Motion-JPEG, because the lengths that the camera sends are wrong
    JpegSplitter pictures_;
    bool timed_ = false, ahead_of_time_ = false, ends_ = false;
    std::int64_t arrival_ns_ = 0;
    libav::FilmClock clock_;
    std::optional<std::int64_t> sender_ns_;
    std::optional<std::int64_t> utc_offset_ns_; // UTC minus time stamp
    std::uint32_t damaged_ = 0;
};

} // namespace arhost
