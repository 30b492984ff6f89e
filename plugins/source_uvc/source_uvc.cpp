// SPDX-License-Identifier: Apache-2.0
//
// source_uvc: captures frames from USB cameras (UVC 1.0 to 1.5) through libusb, without the kernel's camera driver.
#include "cameras.hpp"
#include "controls.hpp"
#include "frame_stream.hpp"
#include "negotiation.hpp"
#include "usb.hpp"

#include "camera_common/camera_source.hpp"
#include "camera_common/copy_rows.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace {

namespace uvc = arhost::uvc;
using arhost::Failure;
using Size = arhost::FrameSize;

constexpr arhost::AutomaticControl<std::string_view> automatic_controls[] = {
    {"exposure", "exposure_time_absolute", "auto_exposure"},
    {"gain", "gain", ""}, // the class defines no automatic gain; automatic exposure includes it
    {"focus", "focus_absolute", "focus_automatic_continuous"},
    {"white_balance", "white_balance_temperature", "white_balance_automatic"},
};

// A frame size in a format of a streaming interface.
struct Mode {
    const uvc::StreamingInterface *stream;
    const uvc::Format *format;
    const uvc::FrameSize *frame;
    Size size() const { return {frame->width, frame->height}; }
};

std::string rate_text(double fps) {
    char text[32];
    std::snprintf(text, sizeof text, "%.4g fps", fps);
    return text;
}

// The option `extension` is not changeable during a run. Otherwise, an output with the right to change options could
// replace the firmware of some cameras.
class UvcSource : arhost::CameraSource {
public:
    using CameraSource::changeable;

    static std::vector<arhost::Device> devices() { return uvc::list_cameras(); }

    UvcSource(const arhost::Host &host, const arhost::Options &options)
        : CameraSource(host, options), camera_(static_cast<std::size_t>(options.integer("camera"))),
          extension_option_(options.text("extension")),
          buffer_count_(static_cast<std::size_t>(options.integer("buffers"))) {
        if (const std::string usb = options.text("usb"); !usb.empty()) {
            identity_ = uvc::parse_identity(usb);
            if (!identity_)
                throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                              "usb: '" + usb + "' is not of the form VENDOR:PRODUCT[:SERIAL], such as 046d:0825");
        }
    }
    ~UvcSource() { stop(); }

    void start(const arhost_source_setup &setup, arhost_source_properties &properties) {
        start_camera(setup, [&] { open(setup, properties); });
    }

    arhost_status read(const arhost_frame_buffer &buffer, arhost_frame_info &info) {
        for (arhost::Silence silence;;) {
            auto frame = next(silence);
            if (!frame)
                return ARHOST_STATUS_ERROR_CANCELLED;
            lost_ += frame->lost_before;
            const bool is_good = copy(frame->bytes, buffer);
            info.capture_ns = frame->capture_ns;
            stream_->recycle(std::move(*frame));
            if (!is_good) {
                ++undecodable_;
                ++lost_;
                continue;
            }
            info.clock = ARHOST_CLOCK_MONOTONIC;
            info.skipped = has_delivered_ ? lost_ : 0; // frames before the first delivered one do not count
            has_delivered_ = true;
            lost_ = 0;
            return ARHOST_STATUS_OK;
        }
    }

    void set(const arhost::Options &changed) {
        set_controls(choose_function(), arhost::given_options(changed, changeable));
    }

    std::vector<arhost::CounterValue> counters() const {
        const uvc::Losses losses = stream_->losses();
        return {{"marked_damaged", losses.marked},
                {"lost_packet", losses.lost_packet},
                {"malformed", losses.malformed},
                {"truncated", losses.truncated},
                {"oversized", losses.oversized},
                {"undecodable", undecodable_},
                {"superseded", losses.superseded + superseded_}};
    }

    void stop() {
        stream_.reset();
        // Releases the control interface last, because the kernel's driver takes all interfaces when it takes the
        // control interface.
        for (; device_ && !claimed_.empty(); claimed_.pop_back())
            device_->release(claimed_.back());
        device_.reset();
    }

private:
    void open(const arhost_source_setup &setup, arhost_source_properties &properties) {
        newest_only_ = setup.paced != 0;
        device_.emplace(uvc::UsbDevice::open(identity_));
        const uvc::VideoFunction &function = choose_function();
        const Mode mode = choose_mode(function, setup);
        claim(function.control_interface);
        claim(mode.stream->number);
        // Sets the controls before the stream starts, so that they apply to the first frame.
        set_controls(function, control_values_);
        arhost::show_warnings(host_,
                              uvc::Controls(*device_, function).set_extensions(extension_option_, "extension"));
        const uvc::ProbeControl agreed = negotiate(function, mode, setup.fps);
        const std::string what = mode.format->name + " " + mode.size().text();
        const double fps =
            agreed.interval > 0 ? static_cast<double>(uvc::intervals_per_second) / agreed.interval : setup.fps;
        if (setup.fps > 0 && std::abs(fps - setup.fps) > 0.05 * setup.fps)
            host_.warn("the camera delivers " + rate_text(fps) + " at " + what + ", not the configured " +
                       rate_text(setup.fps) + "; it offers " + describe(function));
        start_stream(function, mode, agreed);

        arhost_frame_format format{};
        format.struct_size = properties.format.struct_size;
        format.width = mode.frame->width;
        format.height = mode.frame->height;
        format.pixel_format =
            mode.format->encoding == uvc::Encoding::yuy2 ? ARHOST_PIXEL_FORMAT_YUYV : ARHOST_PIXEL_FORMAT_NV12;
        constexpr std::uint8_t bt709 = 1; // bMatrixCoefficients
        format.yuv_matrix = mode.format->matrix == bt709 ? ARHOST_YUV_MATRIX_BT709 : ARHOST_YUV_MATRIX_BT601;
        format.yuv_range = ARHOST_YUV_RANGE_LIMITED;
        encoding_ = mode.format->encoding;
        if (encoding_ == uvc::Encoding::mjpeg)
            describe_first_picture(format, mode.size(), device_->name(), what,
                                   [&](arhost::Silence &silence, const auto &use) {
                                       auto frame = next(silence);
                                       if (frame) {
                                           use(frame->bytes);
                                           stream_->recycle(std::move(*frame));
                                       }
                                       return frame.has_value();
                                   });
        format.fps = fps;
        if (!arhost_frame_layout(&format))
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          device_->name() + " delivers " + what + ", which is unsupported");
        properties.format = format;
        host_.info(device_->name() + ": " + what + ", " + rate_text(fps));
    }

    void claim(std::uint8_t interface) {
        device_->claim(interface);
        claimed_.push_back(interface);
    }

    const uvc::VideoFunction &choose_function() const {
        const std::vector<uvc::VideoFunction> &functions = device_->configuration().functions;
        if (camera_ >= functions.size())
            device_->fail_configuration("camera", "has no camera number " + std::to_string(camera_) + ", only " +
                                                      std::to_string(functions.size()) +
                                                      "; the number of the first one is 0");
        return functions[camera_];
    }

    static std::string describe(const uvc::VideoFunction &function) {
        std::string text;
        for (const uvc::StreamingInterface &stream : function.streams)
            for (const uvc::Format &format : stream.formats) {
                text += (text.empty() ? "" : ", ") + format.name;
                if (format.encoding == uvc::Encoding::unsupported)
                    text += " (unsupported)";
                std::string sizes;
                for (const uvc::FrameSize &frame : format.frames)
                    sizes += (sizes.empty() ? "" : ", ") + Size{frame.width, frame.height}.text() + " " +
                             rate_text(frame.max_fps());
                if (!sizes.empty())
                    text += " (" + sizes + ")";
            }
        return text.empty() ? "no format" : text;
    }

    // Returns the modes that the camera offers and the option `format` permits, in order of preference.
    std::vector<Mode> permitted_modes(const uvc::VideoFunction &function) const {
        std::vector<Mode> modes;
        for (const auto &[encoding, name] : uvc::encodings)
            for (const uvc::StreamingInterface &stream : function.streams)
                for (const uvc::Format &format : stream.formats)
                    if (format.encoding == encoding && permits(name))
                        for (const uvc::FrameSize &frame : format.frames)
                            if (frame.width <= ARHOST_MAX_IMAGE_SIDE && frame.height <= ARHOST_MAX_IMAGE_SIDE)
                                modes.push_back({&stream, &format, &frame});
        return modes;
    }

    Mode choose_mode(const uvc::VideoFunction &function, const arhost_source_setup &setup) const {
        const arhost::DemandedSize wanted = arhost::demanded_size(configured_size_, setup.intrinsics);
        Size size = wanted.size;
        std::vector<Mode> modes = permitted_modes(function);
        if (modes.empty())
            device_->fail_configuration("format", "offers no " + permitted_text() + ", only " + describe(function));
        if (size == Size{}) {
            const auto standard = std::ranges::find_if(
                modes, [](const Mode &mode) { return mode.frame->index == mode.format->default_frame; });
            size = (standard == modes.end() ? modes.front() : *standard).size();
        }
        std::erase_if(modes, [&](const Mode &mode) { return mode.size() != size; });
        if (modes.empty())
            device_->fail_configuration("width, height", "has no size " + size.text() + "; it offers " +
                                                             describe(function) + "; " + wanted.advice);
        return choose_by_rate(modes, setup.fps, [](const Mode &mode) { return mode.frame->max_fps(); });
    }

    void set_controls(const uvc::VideoFunction &function,
                      const std::vector<std::pair<std::string, std::string>> &values) const {
        arhost::set_option_controls(host_, uvc::Controls(*device_, function), automatic_controls,
                                    std::string_view("power_line_frequency"), values);
    }

    // Negotiates the mode and the nearest possible rate with the camera. If `fps` is 0, uses the camera's default
    // rate.
    uvc::ProbeControl negotiate(const uvc::VideoFunction &function, const Mode &mode, double fps) const {
        constexpr std::uint8_t probe = 1, commit = 2; // selectors
        const std::uint16_t entity = mode.stream->number;
        const double wanted = fps > 0 ? uvc::intervals_per_second / fps : mode.frame->default_interval;
        const auto interval = static_cast<std::uint32_t>(std::clamp(std::round(wanted), 1.0, 4e9));
        std::vector<std::uint8_t> data = uvc::encode_probe(
            {mode.format->index, mode.frame->index, mode.frame->nearest_interval(interval), 0, 0, 0},
            uvc::probe_size(function.version));
        if (const int sent = device_->set(probe, entity, data); sent < 0)
            device_->fail("setting the format", sent);
        const int got = device_->get(uvc::get_current, probe, entity, data);
        if (got < 0)
            device_->fail("reading the format", got);
        data.resize(static_cast<std::size_t>(got));
        auto agreed = uvc::decode_probe(data);
        if (!agreed || agreed->format != mode.format->index || agreed->frame != mode.frame->index)
            throw Failure(ARHOST_STATUS_ERROR_IO, device_->name() + " rejects " + mode.format->name + " at " +
                                                      mode.size().text() + ", although it lists " +
                                                      describe(function));
        if (const int sent = device_->set(commit, entity, data); sent < 0)
            device_->fail("confirming the format", sent);
        return *agreed;
    }

    void start_stream(const uvc::VideoFunction &function, const Mode &mode, const uvc::ProbeControl &agreed) {
        const uvc::AlternateSetting *alternate = uvc::choose_alternate(*mode.stream, agreed.max_payload_bytes);
        if (!alternate)
            device_->fail_configuration("width, height", "needs packets of " +
                                                             std::to_string(agreed.max_payload_bytes) +
                                                             " bytes, for which it has no setting; choose a smaller "
                                                             "size, a lower 'fps' or 'format: mjpeg'");
        uvc::FrameStream::Setup setup;
        setup.interface = mode.stream->number;
        setup.alternate = *alternate;
        setup.payload_bytes = agreed.max_payload_bytes;
        setup.max_frame_bytes = uvc::max_frame_bytes(*mode.format, *mode.frame, agreed.max_frame_bytes);
        setup.exact_frame_bytes =
            uvc::exact_frame_bytes(mode.format->encoding, mode.frame->width, mode.frame->height);
        setup.clock_hz = agreed.clock_hz > 0 ? agreed.clock_hz : function.clock_hz;
        setup.queue_length = buffer_count_;
        setup.keeps_newest = newest_only_;
        stream_.emplace(*device_, setup);
    }

    // Waits for a frame. Returns the newest frame in live mode, otherwise the oldest frame.
    std::optional<uvc::CapturedFrame> next(arhost::Silence &silence) {
        return wait_for_frame(silence, device_->name(), [&] {
            auto found = stream_->next(poll_slice);
            while (found && newest_only_ && stream_->has_more()) {
                lost_ += found->lost_before + 1;
                ++superseded_;
                stream_->recycle(std::move(*found));
                found = stream_->next(poll_slice);
            }
            return found;
        });
    }

    bool copy(const std::vector<std::uint8_t> &bytes, const arhost_frame_buffer &buffer) {
        const arhost_frame_format &format = *buffer.format;
        if (encoding_ == uvc::Encoding::mjpeg)
            return jpeg_.decode(bytes, format, buffer.plane, fault_);
        const std::uint8_t *from = bytes.data(); // an intact frame contains all rows without padding
        const auto copy_plane = [&](std::uint32_t plane, std::size_t row_bytes, std::size_t rows) {
            arhost::copy_rows(from, row_bytes, buffer.plane[plane], format.stride[plane], row_bytes, rows);
            from += rows * row_bytes;
        };
        if (encoding_ == uvc::Encoding::yuy2) {
            copy_plane(0, 2 * std::size_t{format.width}, format.height);
        } else {
            copy_plane(0, format.width, format.height);
            copy_plane(1, format.width, format.height / 2);
        }
        return true;
    }

    std::size_t camera_;
    std::string extension_option_;
    std::size_t buffer_count_;
    std::optional<uvc::UsbIdentity> identity_;

    std::optional<uvc::UsbDevice> device_;
    std::vector<std::uint8_t> claimed_; // numbers of the claimed interfaces
    std::optional<uvc::FrameStream> stream_;
    uvc::Encoding encoding_ = uvc::Encoding::yuy2;
    bool has_delivered_ = false;
    std::uint32_t lost_ = 0; // frames lost since the last delivered frame
    std::uint64_t undecodable_ = 0, superseded_ = 0;
};

using arhost::option;
constexpr const char *formats[] = {"auto", "yuyv", "nv12", "mjpeg", nullptr};
constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_TEXT, "usb", "",
           "The camera: VENDOR:PRODUCT or VENDOR:PRODUCT:SERIAL. Usually set by the key 'usb' of the source."),
    option(ARHOST_OPTION_INTEGER, "camera", "0", "Number of the camera, if the device contains several.", 0,
           uvc::max_functions - 1),
    option(ARHOST_OPTION_INTEGER, "width", "0",
           "Frame size in px; 0: the size of the calibration if set, otherwise the camera's default.", 0,
           ARHOST_MAX_IMAGE_SIDE),
    option(ARHOST_OPTION_INTEGER, "height", "0",
           "Frame size in px; 0: the size of the calibration if set, otherwise the camera's default.", 0,
           ARHOST_MAX_IMAGE_SIDE),
    option(ARHOST_OPTION_TEXT, "format", "auto",
           "Pixel format of the camera; auto: uncompressed if that is fast enough, otherwise mjpeg.", 0, 0, formats),
    option(ARHOST_OPTION_INTEGER, "buffers", "4", "Number of frames that may wait.", 2, 32),
    arhost::exposure_option,
    arhost::gain_option,
    arhost::focus_option,
    arhost::white_balance_option,
    arhost::power_line_frequency_option,
    arhost::controls_option,
    option(ARHOST_OPTION_TEXT, "extension", "",
           "Controls of extension units, as UNIT:SELECTOR=BYTES in hexadecimal digits: '4:9=01ff, 4:10=00'."),
};
constexpr const char *needs[] = {"usb", nullptr};

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_SOURCE,
    .id = "org.arhost.source_uvc",
    .name = "USB camera",
    .version = "0.1.0",
    .vendor = "arhost",
    .licence = "Apache-2.0",
    .description = "Captures frames from a USB camera through libusb, uncompressed or as Motion-JPEG.",
    .capabilities = ARHOST_SOURCE_CAPABILITY_LIVE,
    .option_count = std::size(options),
    .options = options,
    .needs = needs,
};

} // namespace

ARHOST_SOURCE(UvcSource, descriptor)
