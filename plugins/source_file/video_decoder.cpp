// SPDX-License-Identifier: Apache-2.0
#include "video_decoder.hpp"

#include "folder.hpp"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstring>
#include <fstream>
#include <span>
#include <string_view>
#include <thread>

namespace arhost {

namespace {

// Returns `code`. Throws std::bad_alloc if libav ran out of memory, which is the only error that the file does
// not cause.
int checked(int code) {
    if (code == AVERROR(ENOMEM))
        throw std::bad_alloc();
    return code;
}

// Returns whether `file` is shorter than its AVI header declares, or std::nullopt if it is not an AVI file. The frame
// count in the header is not suitable for this check: it counts time slots, some of which may be empty (Microsoft,
// AVI RIFF File Reference).
std::optional<bool> is_short_avi(const std::filesystem::path &file) {
    std::ifstream stream(file, std::ios::binary);
    unsigned char head[12] = {};
    stream.read(reinterpret_cast<char *>(head), sizeof head);
    if (!stream || std::memcmp(head, "RIFF", 4) != 0 || std::memcmp(head + 8, "AVI ", 4) != 0)
        return std::nullopt;
    const std::uint64_t size = head[4] | head[5] << 8 | head[6] << 16 | std::uint64_t{head[7]} << 24;
    std::error_code error;
    return std::filesystem::file_size(file, error) < size + 8 && !error;
}

// Reads an EBML variable-length integer (RFC 8794, section 4) at `at` and moves `at` past it. Returns std::nullopt if
// the size is unknown, as in a live recording, or if the bytes end.
std::optional<std::uint64_t> ebml_size(std::span<const unsigned char> bytes, std::size_t &at) {
    if (at >= bytes.size() || bytes[at] == 0)
        return std::nullopt;
    const auto length = static_cast<std::size_t>(std::countl_zero(bytes[at])) + 1;
    if (length > bytes.size() - at)
        return std::nullopt;
    const std::uint64_t unknown = (std::uint64_t{1} << (7 * length)) - 1;
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < length; ++i)
        value = value << 8 | bytes[at + i];
    at += length;
    value &= unknown; // removes the length marker
    return value == unknown ? std::nullopt : std::optional(value);
}

// Returns whether `file` is shorter than its Matroska segment, or std::nullopt if it is not a Matroska file or does
// not declare the segment's size. libav reports nothing if such a file ends between two frames.
std::optional<bool> is_short_matroska(const std::filesystem::path &file) {
    constexpr std::string_view header_id = "\x1a\x45\xdf\xa3", segment_id = "\x18\x53\x80\x67";
    std::ifstream stream(file, std::ios::binary);
    unsigned char head[4096];
    stream.read(reinterpret_cast<char *>(head), sizeof head);
    const std::span<const unsigned char> bytes(head, static_cast<std::size_t>(stream.gcount()));
    const auto has_id = [&](std::size_t at, std::string_view id) {
        return at <= bytes.size() && bytes.size() - at >= id.size() &&
               std::memcmp(bytes.data() + at, id.data(), id.size()) == 0;
    };
    std::size_t at = header_id.size();
    if (!has_id(0, header_id))
        return std::nullopt;
    const std::optional<std::uint64_t> header_size = ebml_size(bytes, at);
    if (!header_size || *header_size > bytes.size())
        return std::nullopt;
    at += *header_size;
    if (!has_id(at, segment_id))
        return std::nullopt;
    at += segment_id.size();
    const std::optional<std::uint64_t> segment_size = ebml_size(bytes, at);
    std::error_code error;
    const std::uint64_t size = std::filesystem::file_size(file, error);
    if (!segment_size || error)
        return std::nullopt;
    return size < at || size - at < *segment_size;
}

} // namespace

Decoder::Decoder(const std::filesystem::path &file, const Host &host, LibavLog &log)
    : name_("the video " + quoted(file)), host_(host), log_(log),
      frame_(libav::allocated<libav::FramePointer>(av_frame_alloc())) {
    const auto rejection = [&](const std::string &why) {
        if (host_.cancelled())
            return Failure(ARHOST_STATUS_ERROR_CANCELLED, "opening " + name_ + " was cancelled");
        return Failure(ARHOST_STATUS_ERROR_CONFIGURATION, name_ + " cannot be read: " + why + log_.take_reason());
    };
    log_.take_reason();
    is_short_ = is_short_avi(file);
    if (!is_short_)
        is_short_ = is_short_matroska(file);

    AVFormatContext *context = avformat_alloc_context();
    if (!context)
        throw std::bad_alloc();
    context->interrupt_callback = {[](void *self) -> int { return static_cast<Decoder *>(self)->host_.cancelled(); },
                                   this};
    libav::PacketReader::keep_time_stamps(*context);
    AVDictionary *options = nullptr; // restricts playlists to local files
    av_dict_set(&options, "protocol_whitelist", "file", 0);
    // "file:" prevents libav from parsing the path as a URL. avformat_open_input frees the context if it fails.
    const int opened = checked(avformat_open_input(&context, ("file:" + file.string()).c_str(), nullptr, &options));
    av_dict_free(&options);
    if (opened < 0)
        throw rejection(libav::error_text(opened));
    file_.reset(context);
    if (const int found = checked(avformat_find_stream_info(context, nullptr)); found < 0)
        throw rejection(libav::error_text(found));

    const int index = av_find_best_stream(context, AVMEDIA_TYPE_VIDEO, -1, -1, nullptr, 0);
    if (index < 0 || context->streams[index]->disposition & AV_DISPOSITION_ATTACHED_PIC)
        throw rejection("it has no video stream");
    stream_ = context->streams[index];
    for (unsigned i = 0; i < context->nb_streams; ++i)
        if (context->streams[i] != stream_)
            context->streams[i]->discard = AVDISCARD_ALL;
    packets_.attach(*context, *stream_);

    const AVCodec *decoder = avcodec_find_decoder(stream_->codecpar->codec_id);
    if (!decoder)
        throw rejection(std::string("libavcodec on this machine has no decoder for '") +
                        avcodec_get_name(stream_->codecpar->codec_id) + "'; convert it: ffmpeg -i … -c:v libx264 …");
    codec_ = libav::allocated<libav::CodecPointer>(avcodec_alloc_context3(decoder));
    checked(avcodec_parameters_to_context(codec_.get(), stream_->codecpar));
    codec_->pkt_timebase = stream_->time_base;
    // Threads share the slices of one picture, but do not decode several pictures at once. Otherwise, damaged data
    // might decode to different pictures each time.
    codec_->thread_type = FF_THREAD_SLICE;
    codec_->thread_count = static_cast<int>(std::clamp(std::thread::hardware_concurrency(), 1U, 4U));
    if (const int ready = checked(avcodec_open2(codec_.get(), decoder, nullptr)); ready < 0)
        throw rejection(std::string("the decoder '") + decoder->name + "' cannot start: " + libav::error_text(ready));

    const AVRational rate = av_guess_frame_rate(context, stream_, nullptr);
    fps_ = rate.num > 0 && rate.den > 0 ? av_q2d(rate) : 30.0;
    period_ns_ = std::llround(1e9 / fps_);
    clock_ = libav::FilmClock(period_ns_);

    const arhost_status first = next();
    if (first == ARHOST_STATUS_ERROR_CANCELLED)
        throw Failure(ARHOST_STATUS_ERROR_CANCELLED, "opening " + name_ + " was cancelled");
    if (first >= ARHOST_STATUS_END)
        throw rejection("none of its pictures can be decoded" + (end_fault_.empty() ? decoder_fault_ : end_fault_));
}

arhost_status Decoder::next() {
    while (!ended_) {
        const int received = checked(avcodec_receive_frame(codec_.get(), frame_.get()));
        if (received == 0) {
            if (damage_.empty() &&
                (lost_data_ || frame_->flags & AV_FRAME_FLAG_CORRUPT || frame_->decode_error_flags))
                damage_ = name_ + " is damaged near frame " + std::to_string(count_) + decoder_fault_ +
                          "; the frames from there on may look wrong";
            lost_data_ = false;
            ++count_;
            take_time();
            return ARHOST_STATUS_OK;
        }
        if (received == AVERROR_EOF) {
            finish();
            break;
        }
        if (received != AVERROR(EAGAIN))
            lost_data_ = true;
        else if (const arhost_status fed = feed(); fed != ARHOST_STATUS_OK)
            return fed;
    }
    return truncation_.empty() ? ARHOST_STATUS_END : ARHOST_STATUS_END_TRUNCATED;
}

// Sends the next packet to the decoder, or signals the end of the stream.
arhost_status Decoder::feed() {
    if (host_.cancelled())
        return ARHOST_STATUS_ERROR_CANCELLED;
    if (const std::string fault = log_.take_reason(); !fault.empty())
        decoder_fault_ = fault;
    const int read = checked(packets_.read());
    if (read == AVERROR_EXIT && host_.cancelled())
        return ARHOST_STATUS_ERROR_CANCELLED;
    if (read < 0) {
        read_error_ = read == AVERROR_EOF ? (file_->pb ? file_->pb->error : 0) : read;
        // For Matroska, libav logs "File ended prematurely" but returns no error code.
        end_fault_ = log_.take_reason();
        checked(avcodec_send_packet(codec_.get(), nullptr));
        return ARHOST_STATUS_OK;
    }
    // Drops a truncated packet. Its picture would be partly grey, but not marked as damaged.
    if (packets_.packet().flags & AV_PKT_FLAG_CORRUPT) {
        lost_data_ = true;
        return ARHOST_STATUS_OK;
    }
    ++packet_count_;
    if (checked(avcodec_send_packet(codec_.get(), &packets_.packet())) < 0)
        lost_data_ = true;
    return ARHOST_STATUS_OK;
}

void Decoder::take_time() {
    const std::int64_t pts = frame_->best_effort_timestamp;
    if (count_ == 1)
        first_pts_ = pts;
    const bool has_stamp = pts != AV_NOPTS_VALUE && first_pts_ != AV_NOPTS_VALUE;
    clock_.next_ns(has_stamp ? std::optional(av_rescale_q(pts - first_pts_, stream_->time_base, {1, 1'000'000'000}))
                             : std::nullopt,
                   (file_->iformat->flags & AVFMT_TS_DISCONT) != 0);
}

void Decoder::finish() {
    ended_ = true;
    const std::uint64_t declared = declared_count();
    const bool has_all = is_short_ ? !*is_short_ : packet_count_ >= declared;
    if (!lost_data_ && read_error_ == 0 && end_fault_.empty() && has_all)
        return;
    truncation_ = name_ + " is truncated: it ends after frame " + std::to_string(count_ - 1);
    if (declared > count_ && !is_short_)
        truncation_ += " of " + std::to_string(declared);
    truncation_ += end_fault_.empty() ? decoder_fault_ : end_fault_;
}

std::uint64_t Decoder::declared_count() const {
    return stream_->nb_frames > 0 ? static_cast<std::uint64_t>(stream_->nb_frames) : 0;
}

int Decoder::quarter_turns() const {
    std::size_t size = 0;
#if LIBAVCODEC_VERSION_MAJOR >= 61
    const AVPacketSideData *side = av_packet_side_data_get(
        stream_->codecpar->coded_side_data, stream_->codecpar->nb_coded_side_data, AV_PKT_DATA_DISPLAYMATRIX);
    const std::uint8_t *data = side ? side->data : nullptr;
    size = side ? side->size : 0;
#else
    const std::uint8_t *data = av_stream_get_side_data(stream_, AV_PKT_DATA_DISPLAYMATRIX, &size);
#endif
    if (!data || size < 9 * sizeof(std::int32_t))
        return 0;
    const auto *matrix = reinterpret_cast<const std::int32_t *>(data);
    const double clockwise = -av_display_rotation_get(matrix);
    const double quarters = std::round(clockwise / 90);
    const bool mirrored = static_cast<double>(matrix[0]) * matrix[4] < static_cast<double>(matrix[1]) * matrix[3];
    if (mirrored || !(std::abs(clockwise - 90 * quarters) < 0.5))
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      name_ + " is marked as " +
                          (mirrored ? "mirrored" : "rotated by an angle that is no multiple of 90°") +
                          ", which is unsupported; convert it with ffmpeg -i … -c:v libx264 …");
    return (static_cast<int>(quarters) + 4) % 4;
}

Video::Video(std::filesystem::path file, const Host &host) : file_(std::move(file)), host_(host), log_(host) {
    open();
    const AVFrame &first = decoder_->picture();
    width_ = first.width;
    height_ = first.height;
    if (width_ > ARHOST_MAX_IMAGE_SIDE || height_ > ARHOST_MAX_IMAGE_SIDE)
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      "the video " + quoted(file_) + " is " + std::to_string(width_) + "×" + std::to_string(height_) +
                          " px; the limit per side is " + std::to_string(ARHOST_MAX_IMAGE_SIDE));
    converter_.emplace(first, decoder_->quarter_turns());
    const AVRational aspect = first.sample_aspect_ratio;
    if (aspect.num > 0 && aspect.num != aspect.den)
        host_.info("the video's pixels are not square (" + std::to_string(aspect.num) + ":" +
                   std::to_string(aspect.den) + "); frames are delivered as stored, " + std::to_string(width_) + "×" +
                   std::to_string(height_));
}

void Video::open() {
    decoder_.emplace(file_, host_, log_);
}

arhost_frame_format Video::format() const {
    arhost_frame_format format = converter_->format();
    format.fps = decoder_->fps();
    return format;
}

std::uint64_t Video::frame_count() const {
    return decoder_->ended() ? decoder_->count() : decoder_->declared_count();
}

arhost_status Video::go_to(std::uint64_t index) {
    // To seek back, reopens the file. Every picture is then decoded from the same data in the same order, which
    // seeking to a keyframe does not guarantee. After the end, the decoder has no current picture.
    if (index < (decoder_->ended() ? decoder_->count() : decoder_->index()))
        open();
    const std::uint64_t from = decoder_->index();
    auto reported = std::chrono::steady_clock::now();
    while (decoder_->index() < index || decoder_->ended()) {
        const arhost_status status = decoder_->next();
        warn_once(decoder_->damage(), damage_reported_);
        warn_once(decoder_->truncation(), truncation_reported_);
        if (status != ARHOST_STATUS_OK)
            return status;
        check_size();
        if (const auto now = std::chrono::steady_clock::now(); now - reported > std::chrono::milliseconds(500)) {
            reported = now;
            host_.progress(static_cast<double>(decoder_->index() - from) / static_cast<double>(index - from),
                           ("decoding up to frame " + std::to_string(index)).c_str());
        }
    }
    return ARHOST_STATUS_OK;
}

void Video::check_size() const {
    const AVFrame &picture = decoder_->picture();
    if (picture.width != width_ || picture.height != height_)
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      "the frame size changes within the video " + quoted(file_) + ": frame " +
                          std::to_string(decoder_->index()) + " is " + std::to_string(picture.width) + "×" +
                          std::to_string(picture.height) + ", but earlier frames are " + std::to_string(width_) +
                          "×" + std::to_string(height_));
}

// Warns only once per fault: a video that is played in a loop has the same fault in each pass.
void Video::warn_once(const std::string &fault, bool &warned) const {
    if (fault.empty() || warned)
        return;
    host_.warn(fault);
    warned = true;
}

void Video::copy_to(const arhost_frame_buffer &buffer) {
    converter_->convert(decoder_->picture(), buffer);
}

} // namespace arhost
