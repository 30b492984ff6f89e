// SPDX-License-Identifier: Apache-2.0
//
// A source whose camera is lost for a while, or forever, before each frame. It reports progress meanwhile and ignores
// the host's request to cancel. With some options, the camera is unplugged instead.
#include <arhost-cpp/plugin.hpp>

#include <cstring>
#include <filesystem>
#include <string>

namespace {

using namespace arhost;

class Waiting {
public:
    Waiting(const Host &host, const Options &options)
        : host_(host), wait_(options.integer("wait_ms")), unplugged_at_(options.integer("unplugged_at")),
          back_(options.text("back")) {}

    void start(const arhost_source_setup &setup, arhost_source_properties &properties) {
        is_first_ = setup.first_sequence == 0;
        if (!is_first_ && (back_.empty() || !std::filesystem::exists(back_)))
            throw Failure(ARHOST_STATUS_ERROR_DEVICE_LOST, "the camera is not connected");
        properties.format.pixel_format = ARHOST_PIXEL_FORMAT_GREY8;
        properties.format.width = properties.format.height = 8;
        arhost_frame_layout(&properties.format);
    }

    arhost_status read(const arhost_frame_buffer &buffer, arhost_frame_info &info) {
        const auto now = std::chrono::steady_clock::now;
        if (is_first_ && static_cast<std::int64_t>(buffer.sequence) == unplugged_at_)
            throw Failure(ARHOST_STATUS_ERROR_DEVICE_LOST, "the camera has disappeared");
        host_.log(ARHOST_SEVERITY_INFO, "waits for a frame");
        for (const auto end = now() + wait_; wait_.count() < 0 || now() < end;) {
            host_.progress(-1, "waiting for the camera");
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
        }
        std::memset(buffer.plane[0], 0, buffer.format->byte_size);
        info.clock = ARHOST_CLOCK_MONOTONIC;
        info.capture_ns = std::chrono::nanoseconds(now().time_since_epoch()).count();
        return ARHOST_STATUS_OK;
    }

private:
    Host host_;
    std::chrono::milliseconds wait_;
    std::int64_t unplugged_at_;
    std::string back_;
    bool is_first_ = true;
};

constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_INTEGER, "wait_ms", "1000", "Duration of each outage, in ms; -1: forever"),
    option(ARHOST_OPTION_INTEGER, "unplugged_at", "-1", "Frame at which the camera is unplugged; -1: never"),
    option(ARHOST_OPTION_TEXT, "back", "", "File that exists once it is plugged in again; empty: never")};
constexpr arhost_descriptor descriptor = {sizeof(arhost_descriptor),
                                          ARHOST_KIND_SOURCE,
                                          "org.arhost.test." ID,
                                          "Waiting",
                                          "0.1.0",
                                          "arhost",
                                          "Apache-2.0",
                                          "Waits for its camera, for tests.",
                                          CAPABILITIES,
                                          std::size(options),
                                          options,
                                          nullptr};

} // namespace

ARHOST_SOURCE(Waiting, descriptor)
