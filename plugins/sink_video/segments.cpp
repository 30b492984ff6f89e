// SPDX-License-Identifier: Apache-2.0
#include "segments.hpp"

#include "sink_common/files.hpp"

extern "C" {
#include <libavutil/intreadwrite.h>
}

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <limits>
#include <optional>

namespace arhost::video {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view name_middle = ".from", name_end = ".mkv";

void check_written(int code, const fs::path &path) {
    if (code < 0)
        throw files::io_failure("cannot write", path, AVUNERROR(code));
}

// Returns the path with a prefix that prevents libav from parsing it as a URL.
std::string url(const fs::path &path) {
    return "file:" + path.string();
}

OutputPointer open_output(const fs::path &path, const char *format) {
    AVFormatContext *context = nullptr;
    if (avformat_alloc_output_context2(&context, nullptr, format, url(path).c_str()) < 0)
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED,
                      std::string("libavformat on this machine cannot write ") + format);
    OutputPointer output(context);
    output->flags |= AVFMT_FLAG_BITEXACT; // do not write dates and versions
    check_written(avio_open(&output->pb, url(path).c_str(), AVIO_FLAG_WRITE), path);
    return output;
}

AVStream &add_stream(AVFormatContext &output, AVRational fps) {
    AVStream *stream = avformat_new_stream(&output, nullptr);
    if (!stream)
        throw std::bad_alloc();
    stream->time_base = av_inv_q(fps);
    stream->avg_frame_rate = stream->r_frame_rate = fps;
    return *stream;
}

constexpr AVRational ms = {1, 1000}, ns = {1, 1'000'000'000};
constexpr std::uint64_t block_additional_id = 1; // the only id that libavformat writes

// Attaches the frame's number to its packet.
void set_number(AVPacket &packet, std::int64_t number) {
    constexpr std::size_t size =
        2 * sizeof(std::uint64_t); // the id of the BlockAdditional and the number, big-endian
    std::uint8_t *data = av_packet_new_side_data(&packet, AV_PKT_DATA_MATROSKA_BLOCKADDITIONAL, size);
    if (!data)
        throw std::bad_alloc();
    AV_WB64(data, block_additional_id);
    AV_WB64(data + sizeof(std::uint64_t), static_cast<std::uint64_t>(number));
}

// Returns the number of the packet's frame, or nothing if the packet has none.
std::optional<std::int64_t> number_of(const AVPacket &packet) {
    std::size_t size = 0;
    const std::uint8_t *data = av_packet_get_side_data(&packet, AV_PKT_DATA_MATROSKA_BLOCKADDITIONAL, &size);
    if (!data || size != 2 * sizeof(std::uint64_t))
        return std::nullopt;
    return static_cast<std::int64_t>(AV_RB64(data + sizeof(std::uint64_t)));
}

bool same_codec(const AVCodecParameters &a, const AVCodecParameters &b) {
    return a.codec_id == b.codec_id && a.width == b.width && a.height == b.height &&
           std::ranges::equal(std::span(a.extradata, static_cast<std::size_t>(a.extradata_size)),
                              std::span(b.extradata, static_cast<std::size_t>(b.extradata_size)));
}

// The joined video. The first frame creates its file and writes the header.
class Video {
public:
    Video(const fs::path &path, const char *format, AVRational fps) : path_(path), format_(format), fps_(fps) {}

    std::int64_t frames() const { return frames_; }

    // Appends those frames of a segment whose numbers are below `end`.
    void append(AVFormatContext &segment, const fs::path &segment_path, std::int64_t end,
                const std::function<void(double)> &progress) {
        check_fits(*segment.streams[0]->codecpar, segment_path);
        const AVStream &in = *segment.streams[0];
        const PacketPointer packet = allocated<PacketPointer>(av_packet_alloc());
        for (; av_read_frame(&segment, packet.get()) >= 0; av_packet_unref(packet.get())) {
            const std::optional<std::int64_t> number = number_of(*packet);
            if (packet->flags & AV_PKT_FLAG_CORRUPT || !number || *number >= end)
                return; // the segment was truncated by a kill, or the next segment repeats the frame
            const std::int64_t capture_ms = av_rescale_q(packet->pts, in.time_base, ms);
            if (frames_ == 0)
                begin(*in.codecpar, capture_ms);
            packet->pts = packet->dts = time_of(capture_ms);
            av_packet_free_side_data(packet.get());
            packet->duration = av_rescale_q(1, av_inv_q(fps_), out_->time_base);
            packet->pos = -1;
            packet->stream_index = 0;
            check_written(av_write_frame(output_.get(), packet.get()), path_);
            check_written(output_->pb->error, path_);
            if (++frames_ % 256 == 0)
                progress(static_cast<double>(avio_tell(segment.pb)) / static_cast<double>(avio_size(segment.pb)));
        }
        if (segment.pb->error < 0) // set by I/O errors, but not by a truncated segment
            throw files::io_failure("cannot read", segment_path, AVUNERROR(segment.pb->error));
    }

    void finish() {
        check_written(av_write_trailer(output_.get()), path_);
        check_written(output_->pb->error, path_);
        check_written(avio_closep(&output_->pb), path_);
    }

private:
    void check_fits(const AVCodecParameters &segment, const fs::path &segment_path) const {
        if (out_ && !same_codec(*out_->codecpar, segment))
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          "'" + segment_path.string() +
                              "' was encoded with different options than the previous segment");
    }

    // Returns the time of the next frame in the joined video, in the time base of the stream.
    std::int64_t time_of(std::int64_t capture_ms) {
        const std::int64_t since_first_ms = capture_ms - first_ms_;
        const std::int64_t periods = av_rescale_q(since_first_ms, ms, av_inv_q(fps_)); // rounded to the nearest
        const bool is_nominal = std::abs(av_rescale_q(periods, av_inv_q(fps_), ms) - since_first_ms) <= 1;
        const std::int64_t time = is_nominal ? av_rescale_q(periods, av_inv_q(fps_), out_->time_base)
                                             : av_rescale_q(since_first_ms, ms, out_->time_base);
        return last_time_ = std::max(time, last_time_ + 1);
    }

    void begin(const AVCodecParameters &codec, std::int64_t first_ms) {
        first_ms_ = first_ms;
        output_ = open_output(path_, format_);
        out_ = &add_stream(*output_, fps_);
        if (avcodec_parameters_copy(out_->codecpar, &codec) < 0)
            throw std::bad_alloc();
        out_->codecpar->codec_tag = 0; // let the container choose it
        out_->sample_aspect_ratio = codec.sample_aspect_ratio;
        // Write the index of an MP4 file first, so playback can start during a download. Matroska ignores this
        // option.
        av_opt_set(output_->priv_data, "movflags", "faststart", 0);
        check_written(avformat_write_header(output_.get(), nullptr), path_);
    }

    fs::path path_;
    const char *format_;
    AVRational fps_;
    OutputPointer output_;
    AVStream *out_ = nullptr;   // owned by output_
    std::int64_t first_ms_ = 0; // capture time of the first frame
    std::int64_t last_time_ = -1, frames_ = 0;
};

} // namespace

Segment segment_of(const fs::path &video, std::int64_t first) {
    return {files::hidden_sibling(video, std::string(name_middle) + std::to_string(first) + std::string(name_end)),
            first};
}

std::vector<Segment> find_segments(const fs::path &video) {
    const std::string start = files::hidden_sibling(video, name_middle).filename().string();
    std::vector<Segment> found;
    for (const fs::directory_entry &entry :
         fs::directory_iterator(video.has_parent_path() ? video.parent_path() : fs::path("."))) {
        const std::string name = entry.path().filename().string();
        if (!name.starts_with(start) || !name.ends_with(name_end) || name.size() <= start.size() + name_end.size())
            continue;
        std::int64_t first = -1;
        const char *end = name.data() + name.size() - name_end.size();
        if (std::from_chars(name.data() + start.size(), end, first).ptr == end && first >= 0)
            found.push_back({entry.path(), first});
    }
    std::ranges::sort(found, {}, &Segment::first);
    return found;
}

SegmentWriter::SegmentWriter(const fs::path &path, const AVCodecContext &encoder)
    : path_(path), output_(open_output(path, "matroska")), last_time_(std::numeric_limits<std::int64_t>::min()) {
    AVStream &stream = add_stream(*output_, encoder.framerate);
    if (avcodec_parameters_from_context(stream.codecpar, &encoder) < 0)
        throw std::bad_alloc();
    stream.sample_aspect_ratio = encoder.sample_aspect_ratio;
    flush(avformat_write_header(output_.get(), nullptr));
}

void SegmentWriter::append(AVPacket &packet, std::int64_t number, std::int64_t capture_ns) {
    const AVStream &stream = *output_->streams[0];
    const std::int64_t time = av_rescale_q(capture_ns, ns, stream.time_base);
    packet.pts = packet.dts = last_time_ = std::max(time, last_time_ + 1); // libavformat requires ascending times
    packet.duration = av_rescale_q(1, av_inv_q(stream.avg_frame_rate), stream.time_base);
    set_number(packet, number);
    packet.stream_index = 0;
    const int code = av_write_frame(output_.get(), &packet);
    flush(code < 0 ? code : av_write_frame(output_.get(), nullptr)); // ends the Matroska cluster
}

void SegmentWriter::flush(int code) {
    avio_flush(output_->pb);
    check_written(code, path_);
    check_written(output_->pb->error, path_);
}

std::int64_t join(const std::vector<Segment> &segments, const fs::path &video, const char *format, AVRational fps,
                  const std::function<void(double)> &progress, const std::function<void(const std::string &)> &warn) {
    Video joined(video, format, fps);
    for (std::size_t i = 0; i < segments.size(); ++i) {
        const fs::path &path = segments[i].path;
        AVFormatContext *context = nullptr;
        if (const int code =
                avformat_open_input(&context, url(path).c_str(), av_find_input_format("matroska"), nullptr);
            code < 0) {
            if (code != AVERROR_EOF) // AVERROR_EOF: the segment has no frames, because none arrived after a restart
                warn(libav_failure(ARHOST_STATUS_ERROR_IO, "cannot read a frame from '" + path.string() + "'", code)
                         .what());
            continue;
        }
        const InputPointer segment(context);
        if (segment->nb_streams != 1)
            throw Failure(ARHOST_STATUS_ERROR_IO,
                          "'" + path.string() + "' cannot be read as a segment of the video; delete it");
        joined.append(*segment, path,
                      i + 1 < segments.size() ? segments[i + 1].first : std::numeric_limits<std::int64_t>::max(),
                      progress);
    }
    if (joined.frames() > 0)
        joined.finish();
    return joined.frames();
}

} // namespace arhost::video
