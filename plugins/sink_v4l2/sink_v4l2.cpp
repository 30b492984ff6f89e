// SPDX-License-Identifier: Apache-2.0
//
// sink_v4l2: writes frames to a Video4Linux output device, for example a virtual camera.
#include "camera_common/fourcc.hpp"
#include "libav_common/bgr_converter.hpp"
#include "output_device.hpp"

#include <cstring>
#include <optional>

namespace {

using namespace arhost;
using namespace arhost::libav;

struct PixelFormat {
    std::string_view name; // value of the option `format`
    std::uint32_t fourcc;
    AVPixelFormat pixels;
    int bytes_per_pixel; // for the first plane
    bool is_yuv;
};
constexpr PixelFormat pixel_formats[] = {{"yuyv", V4L2_PIX_FMT_YUYV, AV_PIX_FMT_YUYV422, 2, true},
                                         {"nv12", V4L2_PIX_FMT_NV12, AV_PIX_FMT_NV12, 1, true},
                                         {"yuv420", V4L2_PIX_FMT_YUV420, AV_PIX_FMT_YUV420P, 1, true},
                                         {"bgr24", V4L2_PIX_FMT_BGR24, AV_PIX_FMT_BGR24, 3, false},
                                         {"rgb24", V4L2_PIX_FMT_RGB24, AV_PIX_FMT_RGB24, 3, false}};

std::string size_text(std::uint32_t width, std::uint32_t height) {
    return std::to_string(width) + "×" + std::to_string(height);
}

Matrix matrix_of(const OutputFormat &format) {
    const std::uint32_t encoding = format.ycbcr_encoding == V4L2_YCBCR_ENC_DEFAULT
                                       ? std::uint32_t{V4L2_MAP_YCBCR_ENC_DEFAULT(format.colour_space)}
                                       : format.ycbcr_encoding;
    return encoding == V4L2_YCBCR_ENC_709 || encoding == V4L2_YCBCR_ENC_XV709 ? Matrix::bt709 : Matrix::bt601;
}

class V4l2Sink {
public:
    V4l2Sink(const Host &host, const Options &options)
        : host_(host), path_(options.text("device")), format_option_(options.text("format")),
          io_option_(options.text("io")) {}

    void start(const arhost_sink_setup &setup) try {
        width_ = setup.width;
        height_ = setup.height;
        device_.emplace(path_);
        set_format();
        converter_.emplace(static_cast<int>(width_), static_cast<int>(height_), pixels_->pixels, matrix_of(format_));
        const double fps = device_->set_fps(setup.fps);
        device_->reserve(choose_transfer());
        std::string rate;
        if (fps > 0)
            rate = ", " + std::to_string(fps) + " fps";
        host_.info(device_->name() + ": " + fourcc_text(format_.fourcc) + " " +
                   size_text(format_.width, format_.height) + rate);
    } catch (const Failure &failure) {
        // At the start of a run, a missing device is probably a mistake in the configuration.
        if (failure.status() == ARHOST_STATUS_ERROR_DEVICE_LOST && setup.first_sequence == 0)
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, failure.what());
        throw;
    }

    arhost_status write(const arhost_output &output) {
        if (output.width != width_ || output.height != height_)
            throw Failure(ARHOST_STATUS_ERROR_INVALID_ARGUMENT, "the size of a frame differs from that in the setup");
        const AVFrame &frame = converter_->convert(output.bgr, output.stride);
        const std::span<std::uint8_t> image = device_->begin_image(host_);
        if (image.empty())
            return ARHOST_STATUS_ERROR_CANCELLED;
        std::uint8_t *to = image.data();
        const auto copy_plane = [&](int plane, std::size_t row_bytes, std::size_t stride, std::size_t rows) {
            for (std::size_t y = 0; y < rows; ++y)
                std::memcpy(to + y * stride,
                            frame.data[plane] +
                                static_cast<std::ptrdiff_t>(y) * static_cast<std::ptrdiff_t>(frame.linesize[plane]),
                            row_bytes);
            to += rows * stride;
        };
        const std::size_t width = format_.width, height = format_.height, stride = format_.stride;
        copy_plane(0, static_cast<std::size_t>(pixels_->bytes_per_pixel) * width, stride, height);
        if (format_.fourcc == V4L2_PIX_FMT_NV12)
            copy_plane(1, width, stride, height / 2);
        if (format_.fourcc == V4L2_PIX_FMT_YUV420)
            for (const int plane : {1, 2})
                copy_plane(plane, width / 2, stride / 2, height / 2);
        device_->end_image(host_);
        return ARHOST_STATUS_OK;
    }

    void stop() { device_.reset(); }

private:
    // Sets the first permitted pixel format in which the device accepts frames of this size.
    void set_format() {
        const std::vector<std::uint32_t> offered = device_->formats();
        std::string rejected, offers;
        for (const std::uint32_t fourcc : offered)
            offers += (offers.empty() ? "" : ", ") + fourcc_text(fourcc);
        for (const PixelFormat &candidate : pixel_formats) {
            if (std::ranges::count(offered, candidate.fourcc) == 0 ||
                (format_option_ != "auto" && format_option_ != candidate.name))
                continue;
            // Programs that read the device may not receive the colour space. They then derive it from the height, as
            // follows.
            constexpr std::uint32_t standard_definition = 576;
            const std::uint32_t colour_space = !candidate.is_yuv                ? V4L2_COLORSPACE_SRGB
                                               : height_ <= standard_definition ? V4L2_COLORSPACE_SMPTE170M
                                                                                : V4L2_COLORSPACE_REC709;
            format_ = device_->set_format({candidate.fourcc, width_, height_, 0, 0, colour_space, 0});
            pixels_ = &candidate;
            if (format_.fourcc == candidate.fourcc && fits())
                return check_layout();
            rejected = " (it would take " + fourcc_text(format_.fourcc) + " " +
                       size_text(format_.width, format_.height) + ")";
        }
        if (rejected.empty())
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          "format: the output device " + device_->name() + " accepts no " +
                              (format_option_ == "auto" ? "supported format" : format_option_) + ", only " +
                              (offers.empty() ? "nothing" : offers));
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "device: " + device_->name() + " does not take frames of " +
                                                             size_text(width_, height_) + rejected +
                                                             "; set the source or the device to another size");
    }

    // Subsampled formats require even sizes.
    bool fits() const {
        const auto is_same_or_even = [](std::uint32_t size, std::uint32_t frame) {
            return size == frame || size == (frame + 1) / 2 * 2;
        };
        return is_same_or_even(format_.width, width_) && is_same_or_even(format_.height, height_);
    }

    void check_layout() const {
        const bool has_chroma_planes = pixels_->bytes_per_pixel == 1;
        const std::uint64_t row = std::uint64_t(pixels_->bytes_per_pixel) * format_.width,
                            luma = std::uint64_t(format_.stride) * format_.height;
        if (format_.stride < row || format_.image_size < (has_chroma_planes ? luma / 2 * 3 : luma))
            throw Failure(ARHOST_STATUS_ERROR_IO, "the output device " + device_->name() +
                                                      " has a defective driver: rows of " +
                                                      std::to_string(format_.stride) + " bytes, images of " +
                                                      std::to_string(format_.image_size));
    }

    Transfer choose_transfer() const {
        const Transfer transfer =
            io_option_ == "write" || (io_option_ == "auto" && !device_->supports(Transfer::mmap)) ? Transfer::write
                                                                                                  : Transfer::mmap;
        if (!device_->supports(transfer))
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "io: the output device " + device_->name() +
                                                                 " does not support '" + io_option_ +
                                                                 "'; set 'io: auto'");
        return transfer;
    }

    Host host_;
    std::string path_, format_option_, io_option_;
    std::uint32_t width_ = 0, height_ = 0; // size of the frames
    std::optional<OutputDevice> device_;
    OutputFormat format_;
    const PixelFormat *pixels_ = nullptr;
    std::optional<BgrConverter> converter_;
};

constexpr const char *format_names[] = {"auto", "yuyv", "nv12", "yuv420", "bgr24", "rgb24", nullptr};
constexpr const char *io_names[] = {"auto", "write", "mmap", nullptr};
constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_TEXT, "device", nullptr, "Device node of the output, such as /dev/video10."),
    option(ARHOST_OPTION_TEXT, "format", "auto",
           "Pixel format; auto: the first of yuyv, nv12, yuv420, bgr24, rgb24 that the device accepts.", 0, 0,
           format_names),
    option(ARHOST_OPTION_TEXT, "io", "auto",
           "How frames are passed to the driver: mmap, write, or auto (mmap if the device supports it).", 0, 0,
           io_names),
};
constexpr const char *needs[] = {"video", nullptr};

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_SINK,
    .id = "org.arhost.sink_v4l2",
    .name = "V4L2 output",
    .version = "0.1.0",
    .vendor = "arhost",
    .licence = "Apache-2.0",
    .description = "Writes frames to a Video4Linux output device, such as the virtual camera of v4l2loopback.",
    .capabilities = 0,
    .option_count = std::size(options),
    .options = options,
    .needs = needs,
};

} // namespace

ARHOST_SINK(V4l2Sink, descriptor)
