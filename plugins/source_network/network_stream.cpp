// SPDX-License-Identifier: Apache-2.0
#include "network_stream.hpp"

#include "stream_url.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string_view>
#include <utility>

namespace arhost {

namespace {

using Clock = std::chrono::steady_clock;
constexpr AVRational nanoseconds = {1, 1'000'000'000};

// Returns `code`. Throws std::bad_alloc if libav ran out of memory.
int checked(int code) {
    if (code == AVERROR(ENOMEM))
        throw std::bad_alloc();
    return code;
}

// Returns the protocols that libav may use for this URL and for all URLs that the server names (redirects,
// playlists). Local files and other protocols are excluded.
const char *protocols_for(const std::string &url) {
    return url.starts_with("rtsp:") ? "rtsp,rtp,udp,tcp" : "http,https,tls,tcp";
}

// The containers that cameras and streaming servers send. Other containers, such as lists of files, would let the
// server choose which files libav opens.
constexpr const char *containers = "rtsp,mpjpeg,hls,mpegts,mov,flv,matroska";

class Dictionary {
public:
    ~Dictionary() { av_dict_free(&entries_); }
    Dictionary() = default;
    Dictionary(const Dictionary &) = delete;
    Dictionary &operator=(const Dictionary &) = delete;
    void set(const char *key, const std::string &value) { av_dict_set(&entries_, key, value.c_str(), 0); }
    AVDictionary **get() { return &entries_; }

private:
    AVDictionary *entries_ = nullptr;
};

} // namespace

std::int64_t monotonic_ns() {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now().time_since_epoch()).count();
}

NetworkStream::NetworkStream(const StreamSettings &settings, LibavLog &log, std::stop_token stop)
    : name_("the stream '" + without_credentials(settings.url) + "'"), timeout_(settings.timeout),
      verifies_tls_(settings.verifies_tls), log_(log), stop_(std::move(stop)), deadline_(Clock::now() + timeout_),
      picture_(libav::allocated<libav::FramePointer>(av_frame_alloc())) {
    log_.take_reason();
    open(settings);
    open_decoder();
}

void NetworkStream::open(const StreamSettings &settings) {
    AVFormatContext *context = avformat_alloc_context();
    if (!context)
        throw std::bad_alloc();
    context->interrupt_callback = {[](void *opaque) -> int {
                                       const auto &self = *static_cast<NetworkStream *>(opaque);
                                       return self.stop_.stop_requested() || Clock::now() > self.deadline_;
                                   },
                                   this};
    // The HLS demuxer does not pass tls_verify on to the segments of a playlist.
    context->opaque = this;
    open_io_ = context->io_open;
    context->io_open = [](AVFormatContext *opener, AVIOContext **io, const char *url, int flags,
                          AVDictionary **options) {
        const auto &self = *static_cast<NetworkStream *>(opener->opaque);
        av_dict_set(options, "tls_verify", self.verifies_tls_ ? "1" : "0", 0);
        return self.open_io_(opener, io, url, flags, options);
    };
    libav::PacketReader::keep_time_stamps(*context);
    Dictionary options;
    options.set("protocol_whitelist", protocols_for(settings.url));
    options.set("format_whitelist", containers);
    // Limits the amount of data that libav reads to recognise the container and its tracks.
    options.set("probesize", "100000");
    options.set("analyzeduration", "500000"); // µs
    if (settings.url.starts_with("rtsp:")) {
        options.set("rtsp_transport", settings.transport);
        options.set("allowed_media_types", "video"); // requests no other tracks
    } else {
        options.set("live_start_index", "-1"); // start with the newest segment of a playlist
    }
    // avformat_open_input frees the context if it fails.
    const int opened = checked(avformat_open_input(&context, settings.url.c_str(), nullptr, options.get()));
    if (opened < 0)
        throw failure(opened);
    input_.reset(context);

    const auto find_video = [&] { return av_find_best_stream(context, AVMEDIA_TYPE_VIDEO, -1, -1, nullptr, 0); };
    int index = find_video();
    // Usually the first data describes the tracks. Further analysis would only delay the first picture.
    if (index < 0 || context->streams[index]->codecpar->codec_id == AV_CODEC_ID_NONE) {
        if (const int found = checked(avformat_find_stream_info(context, nullptr)); found < 0)
            throw failure(found);
        index = find_video();
    }
    if (index < 0)
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, name_ + " has no video");
    track_ = context->streams[index];
    for (unsigned i = 0; i < context->nb_streams; ++i)
        if (context->streams[i] != track_)
            context->streams[i]->discard = AVDISCARD_ALL;
    packets_.attach(*context, *track_);

    const std::string_view container = context->iformat->name;
    const bool is_hls = container == "hls", is_file = context->pb && avio_size(context->pb) > 0;
    timed_ = container != "mpjpeg"; // Motion-JPEG over HTTP has no time stamps
    ahead_of_time_ = timed_ && (is_hls || is_file);
    ends_ = is_hls ? context->duration > 0 : is_file;
}

void NetworkStream::open_decoder() {
    const AVCodec *decoder = avcodec_find_decoder(track_->codecpar->codec_id);
    if (!decoder)
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      name_ + " cannot be decoded: libavcodec on this machine has no decoder for '" +
                          avcodec_get_name(track_->codecpar->codec_id) + "'; set the camera to H.264 or Motion-JPEG");
    codec_ = libav::allocated<libav::CodecPointer>(avcodec_alloc_context3(decoder));
    checked(avcodec_parameters_to_context(codec_.get(), track_->codecpar));
    codec_->pkt_timebase = track_->time_base;
    codec_->flags |= AV_CODEC_FLAG_LOW_DELAY;
    // A truncated JPEG picture would be partly grey.
    codec_->err_recognition |= AV_EF_EXPLODE;
    // Decoding several pictures at once would delay each of them.
    codec_->thread_type = FF_THREAD_SLICE;
    codec_->thread_count = static_cast<int>(std::clamp(std::thread::hardware_concurrency(), 1U, 4U));
    if (const int ready = checked(avcodec_open2(codec_.get(), decoder, nullptr)); ready < 0)
        throw failure(ready);
    clock_ = libav::FilmClock(std::llround(1e9 / (fps() > 0 ? fps() : 30)));
}

bool NetworkStream::next() {
    deadline_ = Clock::now() + timeout_;
    damaged_ = 0;
    for (;;) {
        const int received = checked(avcodec_receive_frame(codec_.get(), picture_.get()));
        if (received == 0) {
            sender_ns_ = stamp_ns();
            if (sender_ns_ && input_->iformat->flags & AVFMT_TS_DISCONT)
                sender_ns_ = clock_.next_ns(sender_ns_, true);
            if (!(picture_->flags & AV_FRAME_FLAG_CORRUPT) && !picture_->decode_error_flags)
                return true;
            ++damaged_;
        } else if (received == AVERROR_EOF) {
            return false;
        } else if (received != AVERROR(EAGAIN)) {
            ++damaged_;
        } else if (!feed()) {
            if (!ends_)
                throw failure(AVERROR_EOF);
            checked(avcodec_send_packet(codec_.get(), nullptr)); // the decoder then returns the remaining pictures
        }
    }
}

int NetworkStream::read_packet() {
    if (!finds_boundaries_) {
        const int read = packets_.read();
        if (read != AVERROR_INVALIDDATA || input_->iformat->name != std::string_view("mpjpeg"))
            return read;
        finds_boundaries_ = true; // libav finds no boundary where a picture should end by its Content-Length
    }
    return read_to_boundary(packets_.packet());
}

int NetworkStream::read_to_boundary(AVPacket &packet) {
    constexpr std::size_t max_picture_bytes = 64 << 20;
    for (;;) {
        if (const auto picture = pictures_.next()) {
            av_packet_unref(&packet);
            if (const int made = av_new_packet(&packet, static_cast<int>(picture->size())); made < 0)
                return made;
            packet.stream_index = track_->index;
            packet.flags |= AV_PKT_FLAG_KEY;
            std::memcpy(packet.data, picture->data(), picture->size());
            return 0;
        }
        char bytes[16384];
        const int count = avio_read_partial(input_->pb, reinterpret_cast<unsigned char *>(bytes), sizeof bytes);
        if (count <= 0)
            return count < 0 ? count : AVERROR_EOF;
        pictures_.append({bytes, static_cast<std::size_t>(count)});
        if (pictures_.size() > max_picture_bytes)
            return AVERROR_INVALIDDATA;
    }
}

bool NetworkStream::feed() {
    if (stop_.stop_requested() || Clock::now() > deadline_)
        throw failure(AVERROR_EXIT);
    const int read = checked(read_packet());
    if (read == AVERROR_EOF && (!input_->pb || !input_->pb->error))
        return false;
    if (read < 0)
        throw failure(read == AVERROR_EOF ? input_->pb->error : read);
    AVPacket &packet = packets_.packet();
    arrival_ns_ = monotonic_ns();
    std::size_t size = 0;
    const auto *data = av_packet_get_side_data(&packet, AV_PKT_DATA_PRFT, &size);
    if (data && size >= sizeof(AVProducerReferenceTime) && packet.pts != AV_NOPTS_VALUE)
        utc_offset_ns_ = reinterpret_cast<const AVProducerReferenceTime *>(data)->wallclock * 1000 -
                         av_rescale_q(packet.pts, track_->time_base, nanoseconds);
    const int sent = packet.flags & AV_PKT_FLAG_CORRUPT ? AVERROR_INVALIDDATA
                                                        : checked(avcodec_send_packet(codec_.get(), &packet));
    damaged_ += sent < 0;
    return true;
}

std::optional<std::int64_t> NetworkStream::stamp_ns() const {
    if (!timed_ || picture_->best_effort_timestamp == AV_NOPTS_VALUE)
        return std::nullopt;
    return av_rescale_q(picture_->best_effort_timestamp, track_->time_base, nanoseconds);
}

std::optional<std::int64_t> NetworkStream::sender_utc_ns() const {
    const auto time_ns = stamp_ns();
    return time_ns && utc_offset_ns_ ? std::optional(*time_ns + *utc_offset_ns_) : std::nullopt;
}

double NetworkStream::fps() const {
    const AVRational rate = av_guess_frame_rate(input_.get(), track_, nullptr);
    if (rate.num > 0 && rate.den > 0)
        return av_q2d(rate);
    return codec_->framerate.num > 0 && codec_->framerate.den > 0 ? av_q2d(codec_->framerate) : 0;
}

// Describes why the connection ended.
Failure NetworkStream::failure(int code) {
    if (stop_.stop_requested())
        return {ARHOST_STATUS_ERROR_CANCELLED, "receiving " + name_ + " was cancelled"};
    const std::string limit = std::to_string(timeout_.count()) + " ms (timeout_ms)", reason = log_.take_reason();
    std::string why = libav::error_text(code) + reason;
    if (code == AVERROR_EXIT)
        why = (codec_ ? "no intact picture has arrived for " + limit +
                            (damaged_ ? "; " + std::to_string(damaged_) + " damaged ones have" : "")
                      : "the server has not answered within " + limit) +
              reason;
    else if (code == AVERROR_EOF)
        why = "the server has closed the connection" + reason;
    else if (code == AVERROR_HTTP_UNAUTHORIZED)
        why += "; correct the user name and password: protocol://USER:PASSWORD@HOST…";
    else if (reason.find("certificate") != std::string::npos)
        why += "; if you trust this server, set 'tls_verify: false'";
    else if (code == AVERROR_HTTP_OTHER_4XX)
        why += "; it may have no video";
    else if (code == AVERROR_INVALIDDATA || code == AVERROR(EINVAL))
        why += "; it is no video that arhost plays (RTSP, Motion-JPEG, HLS, MPEG-TS, MP4, Matroska, FLV), but "
               "perhaps a web page or a single "
               "picture; use the address of the stream";
    return {ARHOST_STATUS_ERROR_CONFIGURATION, name_ + " cannot be received: " + why};
}

} // namespace arhost
