// SPDX-License-Identifier: Apache-2.0
//
// source_network: plays network cameras (RTSP, Motion-JPEG over HTTP) and HLS.
#include "receiver.hpp"
#include "stream_url.hpp"

#include "libav_common/picture_converter.hpp"

#include <iterator>
#include <optional>
#include <string>
#include <utility>

namespace {

using arhost::Failure;
using arhost::Received;
using std::chrono::milliseconds;

constexpr milliseconds poll_interval(20);
constexpr std::size_t lockstep_capacity = 8;

class NetworkSource {
public:
    NetworkSource(const arhost::Host &host, const arhost::Options &options)
        : host_(host), url_(options.text("url")), transport_(options.text("transport")),
          timeout_(options.integer("timeout_ms")), uses_sender_clock_(options.boolean("sender_clock")),
          verifies_tls_(options.boolean("tls_verify")) {
        arhost::check_url(url_);
        name_ = "the stream '" + arhost::without_credentials(url_) + "'";
    }

    void start(const arhost_source_setup &setup, arhost_source_properties &properties) {
        receiver_.emplace(host_,
                          arhost::ReceiverSettings{{url_, transport_, timeout_, verifies_tls_},
                                                   uses_sender_clock_,
                                                   setup.paced ? 1 : lockstep_capacity,
                                                   setup.first_sequence > 0}); // a restart: the URL has worked before
        if (!wait_for_picture("connecting to the camera"))
            throw receiver_->ended()
                ? Failure(ARHOST_STATUS_ERROR_CONFIGURATION, name_ + " has no picture that can be decoded")
                : Failure(ARHOST_STATUS_ERROR_CANCELLED, "connecting to " + name_ + " was cancelled");
        const AVFrame &first = *next_->picture;
        if (first.width > ARHOST_MAX_IMAGE_SIDE || first.height > ARHOST_MAX_IMAGE_SIDE)
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, name_ + " is " + size_of(first) +
                                                                 " px; the limit per side is " +
                                                                 std::to_string(ARHOST_MAX_IMAGE_SIDE));
        if (const arhost_intrinsics *camera = setup.intrinsics;
            camera && (camera->width != static_cast<std::uint32_t>(first.width) ||
                       camera->height != static_cast<std::uint32_t>(first.height)))
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          name_ + " has frames of " + size_of(first) + " px, but the camera calibration is for " +
                              std::to_string(camera->width) + "×" + std::to_string(camera->height));
        converter_.emplace(first, 0);
        size_ = size_of(first);
        arhost_frame_format format = converter_->format();
        format.struct_size = properties.format.struct_size;
        format.fps = receiver_->fps() > 0 ? receiver_->fps() : setup.fps;
        arhost_frame_layout(&format);
        properties.format = format;
        host_.info(name_ + ": " + size_ + " px");
    }

    arhost_status read(const arhost_frame_buffer &buffer, arhost_frame_info &info) {
        if (!next_ && !wait_for_picture("waiting for the camera"))
            return receiver_->ended() ? ARHOST_STATUS_END : ARHOST_STATUS_ERROR_CANCELLED;
        const Received received = *std::exchange(next_, std::nullopt);
        if (size_of(*received.picture) != size_)
            throw Failure(ARHOST_STATUS_ERROR_DEVICE_LOST, "the frame size of " + name_ + " has changed from " +
                                                               size_ + " to " + size_of(*received.picture) +
                                                               " px; set the camera to a fixed size");
        converter_->convert(*received.picture, buffer);
        info.clock = ARHOST_CLOCK_MONOTONIC;
        info.capture_ns = received.capture_ns;
        info.skipped = received.skipped;
        return ARHOST_STATUS_OK;
    }

    std::vector<arhost::CounterValue> counters() const {
        const arhost::Receiver::Losses losses = receiver_->losses();
        return {
            {"damaged", losses.damaged}, {"superseded", losses.superseded}, {"lost_connections", losses.connections}};
    }

    void stop() { receiver_.reset(); }

private:
    static std::string size_of(const AVFrame &picture) {
        return std::to_string(picture.width) + "×" + std::to_string(picture.height);
    }

    // Waits for next_. Returns false if the stream has ended or the host cancels the call.
    bool wait_for_picture(const char *what) {
        while (!next_ && !receiver_->ended() && !host_.cancelled()) {
            host_.progress(-1, what); // prevents a deadline violation while the connection is lost
            next_ = receiver_->take(poll_interval);
        }
        return next_.has_value();
    }

    arhost::Host host_;
    std::string url_, transport_;
    milliseconds timeout_;
    bool uses_sender_clock_, verifies_tls_;
    std::string name_; // name for messages, without credentials

    std::optional<arhost::Receiver> receiver_;
    std::optional<Received> next_;
    std::optional<arhost::PictureConverter> converter_;
    std::string size_;
};

using arhost::option;
constexpr const char *transports[] = {"tcp", "udp", nullptr};
constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_TEXT, "url", nullptr,
           "URL of the stream: rtsp://, http:// or https://, with USER:PASSWORD@ before the host if necessary."),
    option(ARHOST_OPTION_TEXT, "transport", "tcp",
           "Transport of RTSP: tcp, which repeats lost data, or udp, which does not wait for it.", 0, 0, transports),
    option(ARHOST_OPTION_INTEGER, "timeout_ms", "5000",
           "Time without an intact picture after which the connection counts as lost, in ms.", 100, 600'000),
    option(ARHOST_OPTION_BOOL, "sender_clock", "false",
           "Use the wall clock of an RTSP camera, which must be synchronised with this machine's (NTP, PTP)."),
    option(ARHOST_OPTION_BOOL, "tls_verify", "true",
           "Verify the certificate of an https server; false for self-signed ones."),
};
constexpr const char *needs[] = {"network", nullptr};

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_SOURCE,
    .id = "org.arhost.source_network",
    .name = "Network camera",
    .version = "0.1.0",
    .vendor = "arhost",
    .licence = "Apache-2.0",
    .description = "Plays network cameras: RTSP, Motion-JPEG over HTTP, HLS.",
    .capabilities = ARHOST_SOURCE_CAPABILITY_LIVE,
    .option_count = std::size(options),
    .options = options,
    .needs = needs,
};

} // namespace

ARHOST_SOURCE(NetworkSource, descriptor)
