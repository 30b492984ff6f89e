// @NAME@: a source for arhost. Produces a moving gradient.
#include <arhost-cpp/plugin.hpp>

namespace {

using Clock = std::chrono::steady_clock;

class @CLASS@ {
public:
    @CLASS@(const arhost::Host &host, const arhost::Options &options)
        : host_(host), width_(static_cast<std::uint32_t>(options.integer("width"))),
          height_(static_cast<std::uint32_t>(options.integer("height"))),
          frames_(static_cast<std::uint64_t>(options.integer("frames"))) {}

    void start(const arhost_source_setup &setup, arhost_source_properties &properties) {
        // FILL IN: open the device or file.
        fps_ = setup.fps > 0 ? setup.fps : 30;
        paced_ = setup.paced;
        start_time_ = Clock::now() - time_of(setup.first_sequence);
        properties.frame_count = frames_;
        properties.format.pixel_format = ARHOST_PIXEL_FORMAT_RGB8;
        properties.format.width = width_;
        properties.format.height = height_;
        properties.format.fps = fps_;
        arhost_frame_layout(&properties.format);
    }

    arhost_status read(const arhost_frame_buffer &buffer, arhost_frame_info &info) {
        const std::uint64_t n = buffer.sequence;
        if (frames_ > 0 && n >= frames_)
            return ARHOST_STATUS_END;
        info.clock = ARHOST_CLOCK_MEDIA; // for a camera: ARHOST_CLOCK_MONOTONIC, at the time of exposure
        info.capture_ns = time_of(n).count();
        if (paced_ && !host_.wait_until(start_time_ + time_of(n)))
            return ARHOST_STATUS_ERROR_CANCELLED;

        // FILL IN: your pixels. arhost computes the grey plane for trackers from them.
        for (std::uint32_t row = 0; row < height_; ++row) {
            std::uint8_t *rgb = buffer.plane[0] + std::size_t(row) * buffer.format->stride[0];
            for (std::uint32_t column = 0; column < width_; ++column) {
                *rgb++ = static_cast<std::uint8_t>(column + 4 * n);
                *rgb++ = static_cast<std::uint8_t>(row);
                *rgb++ = 128;
            }
        }
        return ARHOST_STATUS_OK;
    }

private:
    std::chrono::nanoseconds time_of(std::uint64_t n) const {
        return std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 * static_cast<double>(n) / fps_));
    }

    arhost::Host host_;
    std::uint32_t width_, height_;
    std::uint64_t frames_; // 0: endless
    double fps_ = 0;
    bool paced_ = false;
    Clock::time_point start_time_; // when frame 0 was due
};

// arhost validates the configuration against these before it calls the constructor.
constexpr arhost_option_descriptor options[] = {
    arhost::option(ARHOST_OPTION_INTEGER, "width", "640", "Image width in px.", 1, 4096),
    arhost::option(ARHOST_OPTION_INTEGER, "height", "360", "Image height in px.", 1, 4096),
    arhost::option(ARHOST_OPTION_INTEGER, "frames", "60", "Number of frames; 0: endless.", 0, 1e9),
};

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_SOURCE,
    .id = "org.example.@NAME@", // FILL IN: your domain in reverse order; ends with the file name
    .name = "@NAME@",
    .version = "0.1.0",
    .vendor = "unknown", // FILL IN: your name
    .licence = "NONE",   // FILL IN: SPDX identifier, e.g. "Apache-2.0"
    .description = "Moving gradient.",
    .capabilities = ARHOST_SOURCE_CAPABILITY_SEEK, // frame n is the same wherever reading starts
    .option_count = std::size(options),
    .options = options,
    .needs = nullptr, // permissions from the sandbox: arhost/plugin.h
};

} // namespace

ARHOST_SOURCE(@CLASS@, descriptor)
