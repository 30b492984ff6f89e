// SPDX-License-Identifier: Apache-2.0
//
// A source whose frames encode the frame number in their pixels: B and G are the low and high byte, R is 85. With
// some options, it writes to the previous frame or reports capture times in the future.
#include "faults.hpp"

#include <cstring>

namespace {

using namespace arhost;

class Counter {
public:
    Counter(const Host &host, const Options &options)
        : host_(host), faults_(options), frames_(static_cast<std::uint64_t>(options.integer("frames"))),
          width_(static_cast<std::uint32_t>(options.integer("width"))),
          height_(static_cast<std::uint32_t>(options.integer("height"))),
          writes_later_(options.boolean("writes_later")), ahead_ms_(options.real("ahead_ms")),
          ahead_at_(options.integer("ahead_at")), hold_at_(options.integer("hold_at")) {}

    static std::vector<Device> devices() {
        return {{.index = 0,
                 .kind = ARHOST_DEVICE_DISCRETE_GPU,
                 .name = "Abacus \x1b[2J3000",
                 .serial = "0d15c0de-0000",
                 .abilities = "counts: up, down"},
                {.index = 1, .kind = ARHOST_DEVICE_CPU, .is_default = true, .name = "Ten fingers"}};
    }

    std::vector<arhost::CounterValue> counters() const { return {{"delivered", delivered_}, {"never", 0}}; }

    void start(const arhost_source_setup &setup, arhost_source_properties &properties) {
        fps_ = setup.fps > 0 ? setup.fps : 30;
        paced_ = setup.paced;
        first_ = setup.first_sequence;
        begin_ = std::chrono::steady_clock::now();
        arhost_frame_format &format = properties.format;
        format.pixel_format = ARHOST_PIXEL_FORMAT_BGR8;
        format.width = width_;
        format.height = height_;
        format.fps = fps_;
        arhost_frame_layout(&format);
        properties.frame_count = frames_;
        if (setup.intrinsics)
            return;
        properties.has_intrinsics = 1;
        properties.intrinsics.width = width_;
        properties.intrinsics.height = height_;
        properties.intrinsics.fx = properties.intrinsics.fy = width_;
        properties.intrinsics.cx = 0.5 * (width_ - 1);
        properties.intrinsics.cy = 0.5 * (height_ - 1);
        properties.intrinsics.distortion = ARHOST_DISTORTION_NONE;
    }

    arhost_status read(const arhost_frame_buffer &buffer, arhost_frame_info &info) {
        if (buffer.sequence >= frames_)
            return ARHOST_STATUS_END;
        while (first_ == 0 && static_cast<std::int64_t>(buffer.sequence) == hold_at_)
            ::pause();
        faults_.at(buffer.sequence);
        if (paced_)
            std::this_thread::sleep_until(
                begin_ + std::chrono::duration_cast<std::chrono::nanoseconds>(
                             std::chrono::duration<double>(static_cast<double>(buffer.sequence - first_) / fps_)));
        for (std::uint32_t y = 0; y < height_; ++y)
            for (std::uint32_t x = 0; x < width_; ++x) {
                std::uint8_t *pixel = buffer.plane[0] + y * buffer.format->stride[0] + 3 * x;
                pixel[0] = static_cast<std::uint8_t>(buffer.sequence);
                pixel[1] = static_cast<std::uint8_t>(buffer.sequence >> 8);
                pixel[2] = 85;
            }
        if (last_ && writes_later_)
            std::memset(last_, 0, buffer.format->byte_size);
        last_ = buffer.plane[0];
        info.clock = ARHOST_CLOCK_MEDIA;
        info.capture_ns = static_cast<std::int64_t>(1e9 * static_cast<double>(buffer.sequence) / fps_);
        if (ahead_ms_ != 0) {
            const bool now =
                ahead_at_ < 0 || (first_ == 0 && buffer.sequence == static_cast<std::uint64_t>(ahead_at_));
            info.clock = ARHOST_CLOCK_MONOTONIC;
            info.capture_ns = std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count() +
                              (now ? static_cast<std::int64_t>(1e6 * ahead_ms_) : 0);
        }
        ++delivered_;
        return ARHOST_STATUS_OK;
    }

private:
    Host host_;
    test::Faults faults_;
    std::uint64_t frames_, first_ = 0, delivered_ = 0;
    std::uint32_t width_, height_;
    bool writes_later_;
    std::uint8_t *last_ = nullptr; // buffer of the previous frame
    double ahead_ms_;
    std::int64_t ahead_at_, hold_at_;
    double fps_ = 30;
    bool paced_ = false;
    std::chrono::steady_clock::time_point begin_;
};

constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_INTEGER, "frames", "100", "Number of frames"),
    option(ARHOST_OPTION_INTEGER, "width", "64", "Width, in px", 1, 4096),
    option(ARHOST_OPTION_INTEGER, "height", "48", "Height, in px", 1, 4096),
    option(ARHOST_OPTION_BOOL, "writes_later", "false", "Also writes to the previous frame"),
    option(ARHOST_OPTION_REAL, "ahead_ms", "0",
           "Reports capture times this far in the future, or in the past if negative, in ms; 0: media times"),
    option(ARHOST_OPTION_INTEGER, "ahead_at", "-1",
           "Applies ahead_ms only to this frame, and not after a restart; -1: always"),
    option(ARHOST_OPTION_INTEGER, "hold_at", "-1", "Hangs at this frame, but not after a restart; -1: never"),
    ARHOST_FAULT_OPTIONS};
constexpr arhost_descriptor descriptor = {sizeof(arhost_descriptor),
                                          ARHOST_KIND_SOURCE,
                                          "org.arhost.test.source_counter",
                                          "Counter",
                                          "0.1.0",
                                          "arhost",
                                          "Apache-2.0",
                                          "Numbered frames, for tests.",
                                          ARHOST_SOURCE_CAPABILITY_SEEK,
                                          std::size(options),
                                          options,
                                          nullptr};

} // namespace

ARHOST_SOURCE(Counter, descriptor)
