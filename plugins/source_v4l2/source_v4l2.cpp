// SPDX-License-Identifier: Apache-2.0
//
// source_v4l2: captures frames from Video4Linux devices (USB and built-in cameras, capture cards).
#include "cameras.hpp"
#include "capture_device.hpp"
#include "controls.hpp"
#include "depth_camera.hpp"
#include "driver_clock.hpp"
#include "pixels.hpp"

#include "camera_common/camera_source.hpp"
#include "camera_common/fourcc.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <iterator>
#include <optional>
#include <string>
#include <vector>

namespace {

using arhost::Capture;
using arhost::CaptureDevice;
using arhost::CaptureFormat;
using arhost::CaptureStream;
using arhost::Failure;
using Size = arhost::FrameSize;
using arhost::PictureFormat;

bool offers(const CaptureFormat &format, const Size &size) {
    if (format.any_size)
        return size.width >= format.sizes.front().width && size.width <= format.sizes.back().width &&
               size.height >= format.sizes.front().height && size.height <= format.sizes.back().height;
    return format.sizes.empty() || // unknown
           std::any_of(format.sizes.begin(), format.sizes.end(), [&](const arhost::CaptureSize &offered) {
               return offered.width == size.width && offered.height == size.height;
           });
}

constexpr arhost::AutomaticControl<std::uint32_t> automatic_controls[] = {
    {"exposure", V4L2_CID_EXPOSURE_ABSOLUTE, V4L2_CID_EXPOSURE_AUTO},
    {"gain", V4L2_CID_GAIN, V4L2_CID_AUTOGAIN},
    {"focus", V4L2_CID_FOCUS_ABSOLUTE, V4L2_CID_FOCUS_AUTO},
    {"white_balance", V4L2_CID_WHITE_BALANCE_TEMPERATURE, V4L2_CID_AUTO_WHITE_BALANCE},
};

// Numbers of frames that were not delivered, by cause.
struct Losses {
    std::uint64_t driver = 0;     // missing in the driver's sequence numbers
    std::uint64_t marked = 0;     // marked as damaged by the driver
    std::uint64_t damaged = 0;    // truncated, or impossible to decode
    std::uint64_t superseded = 0; // replaced by a newer frame in live mode
    std::uint64_t depth = 0;      // delivered, but without depth
};

class V4l2Source : arhost::CameraSource {
public:
    using CameraSource::changeable;

    static std::vector<arhost::Device> devices() { return arhost::list_cameras(); }

    V4l2Source(const arhost::Host &host, const arhost::Options &options)
        : CameraSource(host, options), path_(options.text("device")),
          buffer_count_(static_cast<std::uint32_t>(options.integer("buffers"))),
          depth_path_(options.text("depth_device")), depth_unit_mm_(options.real("depth_unit_mm")), clock_(host) {}

    void start(const arhost_source_setup &setup, arhost_source_properties &properties) {
        start_camera(setup, [&] { open(setup, properties); });
    }

    arhost_status read(const arhost_frame_buffer &buffer, arhost_frame_info &info) {
        for (arhost::Silence silence;;) {
            const auto captured = next(silence);
            if (!captured)
                return ARHOST_STATUS_ERROR_CANCELLED;
            const bool good = copy(captured->planes, buffer);
            stream_->queue(captured->index);
            if (!good) {
                ++dropped_;
                ++losses_.damaged;
                host_.progress(-1, "waiting for an intact picture");
                continue;
            }
            info.clock = ARHOST_CLOCK_MONOTONIC;
            info.capture_ns = last_ns_ = std::max(last_ns_, clock_.monotonic_ns(*captured));
            if (depth_ && !depth_->read(info.capture_ns, buffer))
                ++losses_.depth;
            info.skipped = skipped_before(captured->sequence);
            return ARHOST_STATUS_OK;
        }
    }

    void set(const arhost::Options &changed) { set_controls(arhost::given_options(changed, changeable)); }

    std::vector<arhost::CounterValue> counters() const {
        std::vector<arhost::CounterValue> values = {{"lost_by_driver", losses_.driver},
                                                    {"marked_damaged", losses_.marked},
                                                    {"undecodable", losses_.damaged},
                                                    {"superseded", losses_.superseded}};
        if (depth_)
            values.push_back({"without_depth", losses_.depth});
        return values;
    }

    void stop() {
        depth_.reset();
        stream_.reset();
        device_.reset();
    }

private:
    void open(const arhost_source_setup &setup, arhost_source_properties &properties) {
        newest_only_ = setup.paced != 0;
        device_.emplace(path_);
        camera_ = set_format(setup);
        set_controls(control_values_); // precedes the stream, so that the controls apply to the first frame
        const double fps = device_->set_fps(setup.fps);
        const Size size{camera_.width, camera_.height};
        const std::string mode = arhost::fourcc_text(camera_.fourcc) + " " + size.text();
        if (setup.fps > 0 && fps > 0 && std::abs(fps - setup.fps) > 0.05 * setup.fps)
            host_.warn("the camera delivers " + std::to_string(fps) + " fps at " + mode + ", not the configured " +
                       std::to_string(setup.fps) + " fps; it offers " + device_->describe_formats());

        arhost_frame_format format{};
        format.struct_size = properties.format.struct_size;
        stream_.emplace(*device_, buffer_count_);
        if (arhost::describe(camera_, format)) {
            if (!arhost::has_known_matrix(camera_))
                host_.warn(
                    "the camera's Y'CbCr matrix is neither that of BT.601 nor of BT.709, so colours are inexact");
        } else {
            describe_first_picture(format, size, "the camera '" + path_ + "'", mode,
                                   [&](arhost::Silence &silence, const auto &use) {
                                       const auto captured = next(silence);
                                       if (captured) {
                                           use(captured->planes.front());
                                           stream_->queue(captured->index);
                                       }
                                       return captured.has_value();
                                   });
        }
        format.fps = fps > 0 ? fps : setup.fps;
        frame_ns_ = fps > 0 ? static_cast<std::int64_t>(1e9 / fps) : 0;
        if (!depth_path_.empty())
            depth_.emplace(host_, depth_path_, size, format.fps, depth_unit_mm_);
        format.has_depth = depth_.has_value();
        if (!arhost_frame_layout(&format))
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          "the camera '" + path_ + "' delivers " + mode + ", which is unsupported");
        properties.format = format;
        host_.info(device_->card() + " at " + path_ + ": " + mode + ", " + std::to_string(fps) + " fps");
    }

    PictureFormat set_format(const arhost_source_setup &setup) {
        const arhost::DemandedSize wanted = arhost::demanded_size(configured_size_, setup.intrinsics);
        Size size = wanted.size;
        const bool demanded = size != Size{};
        if (!demanded) {
            const PictureFormat current = device_->current_format();
            size = {current.width, current.height};
        }
        const CaptureFormat &chosen = choose_format(size, setup.fps);
        PictureFormat set = device_->set_format(chosen.fourcc, size.width, size.height);
        const std::string camera = name();
        if (set.fourcc != chosen.fourcc)
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          camera + " rejects " + arhost::fourcc_text(chosen.fourcc) + " at " + size.text() +
                              ", although it lists " + device_->describe_formats());
        if (demanded && size != Size{set.width, set.height})
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          camera + " has no size " + size.text() + " in " + arhost::fourcc_text(chosen.fourcc) +
                              " (it would deliver " + Size{set.width, set.height}.text() + "); the nearest are " +
                              device_->describe_sizes_near(chosen, size.width, size.height) + "; " + wanted.advice);
        if (const std::string defect = arhost::find_raw_format(set.fourcc) ? arhost::defect_of(set) : "";
            !defect.empty())
            throw Failure(ARHOST_STATUS_ERROR_IO, camera + " has a defective driver: " + defect);
        return set;
    }

    void set_controls(const std::vector<std::pair<std::string, std::string>> &values) const {
        if (!values.empty())
            arhost::set_option_controls(host_, arhost::Controls(*device_), automatic_controls,
                                        std::uint32_t{V4L2_CID_POWER_LINE_FREQUENCY}, values);
    }

    // Returns the formats that the camera offers and the option `format` permits, in order of preference.
    std::vector<const CaptureFormat *> permitted_formats() const {
        std::vector<const CaptureFormat *> permitted;
        const auto add = [&](std::uint32_t fourcc, std::string_view name) {
            const CaptureFormat *format = device_->find(fourcc);
            if (format && permits(name))
                permitted.push_back(format);
        };
        const auto add_raw = [&](bool is_grey) {
            for (const arhost::RawFormat &raw : arhost::raw_formats)
                if (raw.is_grey == is_grey)
                    add(raw.fourcc, raw.name);
        };
        add_raw(false);
        add(V4L2_PIX_FMT_MJPEG, "mjpeg");
        add(V4L2_PIX_FMT_JPEG, "mjpeg");
        add_raw(true);
        return permitted;
    }

    // Chooses a permitted format. If any format has this size, considers only formats with this size.
    const CaptureFormat &choose_format(const Size &size, double fps) const {
        std::vector<const CaptureFormat *> formats = permitted_formats();
        if (formats.empty())
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "format: " + name() + " offers no " + permitted_text() +
                                                                 ", only " + device_->describe_formats());
        const CaptureFormat &first = *formats.front();
        std::erase_if(formats, [&](const CaptureFormat *format) { return !offers(*format, size); });
        if (formats.empty())
            return first;
        return *choose_by_rate(formats, fps, [&](const CaptureFormat *format) {
            return device_->max_fps(format->fourcc, size.width, size.height);
        });
    }

    std::string name() const { return "the camera '" + path_ + "' (" + device_->card() + ")"; }

    std::optional<Capture> next(arhost::Silence &silence) {
        return wait_for_frame(silence, name(),
                              [&] { return stream_->wait(poll_slice.count()) ? dequeue_intact() : std::nullopt; });
    }

    // Returns a frame from the driver's queue that the driver does not mark as damaged: the newest frame in live
    // mode, otherwise the oldest frame.
    std::optional<Capture> dequeue_intact() {
        std::optional<Capture> found;
        while (auto captured = stream_->dequeue()) {
            if (captured->flags & V4L2_BUF_FLAG_ERROR) {
                stream_->queue(captured->index);
                ++dropped_;
                ++losses_.marked;
                continue;
            }
            if (found) {
                stream_->queue(found->index);
                ++dropped_;
                ++losses_.superseded;
            }
            found = std::move(captured);
            if (!newest_only_ || is_fresh(*found))
                break;
        }
        return found;
    }

    // Returns whether the camera cannot have captured another picture since this one.
    bool is_fresh(const Capture &captured) const {
        const auto age_ns = arhost::DriverClock::age_ns(captured);
        return age_ns && *age_ns < frame_ns_ / 2;
    }

    bool copy(const std::vector<std::span<const std::uint8_t>> &planes, const arhost_frame_buffer &buffer) {
        return arhost::find_raw_format(camera_.fourcc)
                   ? arhost::copy_picture(camera_, planes, buffer, fault_)
                   : jpeg_.decode(planes.front(), *buffer.format, buffer.plane, fault_);
    }

    // Returns the number of frames lost since the last delivered frame. The gap in the driver's sequence numbers
    // includes the frames that this plugin dropped, unless the driver does not count frames.
    std::uint32_t skipped_before(std::uint32_t sequence) {
        std::uint32_t skipped = dropped_;
        if (last_sequence_) {
            const std::uint32_t gap = sequence - *last_sequence_ - 1;
            if (gap < 1'000'000 && gap > skipped) { // a larger gap means that the counter was reset
                losses_.driver += gap - skipped;
                skipped = gap;
            }
        } else {
            skipped = 0; // frames before the first delivered one do not count
        }
        last_sequence_ = sequence;
        dropped_ = 0;
        return skipped;
    }

    std::string path_;
    std::uint32_t buffer_count_;
    std::string depth_path_; // empty: no depth
    double depth_unit_mm_;

    std::optional<CaptureDevice> device_;
    std::optional<CaptureStream> stream_; // declared after device_, because it must be destroyed first
    std::optional<arhost::DepthCamera> depth_;
    arhost::DriverClock clock_;
    std::int64_t frame_ns_ = 0; // time from frame to frame; 0: unknown
    PictureFormat camera_;
    std::optional<std::uint32_t> last_sequence_;
    std::uint32_t dropped_ = 0; // frames dropped since the last delivered frame
    Losses losses_;
    std::int64_t last_ns_ = 0;
};

using arhost::option;
constexpr const char *formats[] = {"auto", "yuyv", "nv12", "yuv420", "uyvy",  "rgb24", "bgr24",
                                   "grey", "y16",  "y12",  "y10",    "mjpeg", nullptr};
constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_TEXT, "device", "/dev/video0", "Device node of the camera."),
    option(ARHOST_OPTION_INTEGER, "width", "0",
           "Frame size in px; 0: the size of the calibration if set, otherwise the driver's default.", 0,
           ARHOST_MAX_IMAGE_SIDE),
    option(ARHOST_OPTION_INTEGER, "height", "0",
           "Frame size in px; 0: the size of the calibration if set, otherwise the driver's default.", 0,
           ARHOST_MAX_IMAGE_SIDE),
    option(ARHOST_OPTION_TEXT, "format", "auto",
           "Pixel format of the camera; auto: uncompressed if that is fast enough, otherwise mjpeg.", 0, 0, formats),
    option(ARHOST_OPTION_INTEGER, "buffers", "4", "Number of driver buffers.", 2, 32),
    option(ARHOST_OPTION_TEXT, "depth_device", "",
           "Device node with depth (Z16) that belongs to the colour frames; empty: no depth."),
    option(ARHOST_OPTION_REAL, "depth_unit_mm", "1", "Unit of the depth device's values in mm.", 1e-3, 1000),
    arhost::exposure_option,
    arhost::gain_option,
    arhost::focus_option,
    arhost::white_balance_option,
    arhost::power_line_frequency_option,
    arhost::controls_option,
};
constexpr const char *needs[] = {"video", nullptr};

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_SOURCE,
    .id = "org.arhost.source_v4l2",
    .name = "V4L2 camera",
    .version = "0.1.0",
    .vendor = "arhost",
    .licence = "Apache-2.0",
    .description = "Captures frames from a Video4Linux camera, uncompressed or as Motion-JPEG.",
    .capabilities = ARHOST_SOURCE_CAPABILITY_LIVE,
    .option_count = std::size(options),
    .options = options,
    .needs = needs,
};

} // namespace

ARHOST_SOURCE(V4l2Source, descriptor)
