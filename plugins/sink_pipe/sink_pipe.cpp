// SPDX-License-Identifier: Apache-2.0
//
// sink_pipe: writes uncompressed video to a FIFO or to standard output, for other programs.
#include "libav_common/bgr_converter.hpp"
#include "sink_common/pipe_stream.hpp"

#include <arhost-cpp/plugin.hpp>

extern "C" {
#include <libavutil/pixdesc.h>
}

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace {

using namespace arhost;
using namespace arhost::libav;
using arhost::pipe::PipeStream;

struct Format {
    std::string_view name; // value of the option `format`
    // Name of the pixel format in a Y4M header. nullptr: pixels without headers, whose channels have the order of the
    // letters in `name`.
    const char *y4m;
    AVPixelFormat pixels; // only for Y4M
};
constexpr Format formats[] = {{"y4m", "420mpeg2 XYSCSS=420MPEG2", AV_PIX_FMT_YUV420P},
                              {"y4m444", "444 XYSCSS=444", AV_PIX_FMT_YUV444P},
                              {"rgba", nullptr, AV_PIX_FMT_NONE},
                              {"bgra", nullptr, AV_PIX_FMT_NONE},
                              {"rgb", nullptr, AV_PIX_FMT_NONE},
                              {"bgr", nullptr, AV_PIX_FMT_NONE}};

const Format &format_of(std::string_view name) {
    return *std::ranges::find(formats, name, &Format::name);
}

class PipeSink {
public:
    PipeSink(const Host &host, const Options &options)
        : host_(host), stream_(host, options.text("path"), PipeStream::Content::binary),
          format_(format_of(options.text("format"))), matrix_(options.text("matrix")),
          writes_overlay_(options.text("content") == "overlay"), reopen_(options.boolean("reopen")) {
        if (reopen_ && stream_.is_standard_output())
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          "reopen: standard output cannot be opened again; name a FIFO as 'path'");
        if (writes_overlay_ && format_.name.size() != 4)
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          "content: an overlay has transparent pixels, so it needs 'format: rgba' or 'format: bgra'");
    }

    std::uint64_t capabilities() const {
        return ARHOST_SINK_CAPABILITY_STANDARD_OUTPUT |
               (writes_overlay_ ? std::uint64_t{ARHOST_SINK_CAPABILITY_OVERLAY_INPUT} : 0);
    }

    void start(const arhost_sink_setup &setup) {
        width_ = static_cast<int>(setup.width);
        height_ = static_cast<int>(setup.height);
        // Y4M does not state the matrix. Programs assume BT.601 up to this height, and BT.709 for larger frames.
        constexpr int standard_definition = 576;
        const bool is_bt601 = matrix_ == "auto" ? height_ <= standard_definition : matrix_ == "bt601";
        if (format_.y4m)
            converter_.emplace(width_, height_, format_.pixels, is_bt601 ? Matrix::bt601 : Matrix::bt709);
        const AVRational fps = setup.fps > 0 ? av_d2q(setup.fps, 1'000'000) : AVRational{30, 1};
        header_ = format_.y4m ? "YUV4MPEG2 W" + std::to_string(width_) + " H" + std::to_string(height_) + " F" +
                                    std::to_string(fps.num) + ":" + std::to_string(fps.den) + " Ip A1:1 C" +
                                    format_.y4m + " XCOLORRANGE=LIMITED\n"
                              : "";
        stream_.check();
        // The stream of the previous process may have ended in the middle of a frame.
        was_interrupted_ = setup.first_sequence > 0;
    }

    arhost_status write(const arhost_output &output) {
        if (static_cast<int>(output.width) != width_ || static_cast<int>(output.height) != height_)
            throw Failure(ARHOST_STATUS_ERROR_INVALID_ARGUMENT, "the size of a frame differs from that in the setup");
        if (was_interrupted_ && !reopen_)
            throw Failure(
                ARHOST_STATUS_ERROR_IO,
                "the stream to " + stream_.name() +
                    " was cut when this output was restarted, and cannot be continued; 'reopen: true' would "
                    "begin another stream for the next reader of a FIFO");
        pack(output);
        for (;;) {
            if (!stream_.is_open()) {
                stream_.open(was_interrupted_);
                was_interrupted_ = false;
                frame_.insert(frame_.begin(), header_.begin(), header_.end());
            }
            if (stream_.write(frame_))
                return ARHOST_STATUS_OK;
            host_.info("the reader of " + stream_.name() + " has closed it");
            if (!reopen_)
                return ARHOST_STATUS_END;
            stream_.close();
            pack(output);
        }
    }

    void stop() { stream_.close(); }

private:
    // Sets frame_ to the bytes of a frame.
    void pack(const arhost_output &output) {
        frame_.clear();
        if (format_.y4m)
            pack_y4m(converter_->convert(output.bgr, output.stride));
        else
            pack_pixels(output);
    }

    void pack_y4m(const AVFrame &converted) {
        static constexpr std::string_view frame_header = "FRAME\n";
        frame_.assign(frame_header.begin(), frame_header.end());
        const AVPixFmtDescriptor &description = *av_pix_fmt_desc_get(format_.pixels);
        for (int plane = 0; plane < description.nb_components; ++plane) {
            const int width = AV_CEIL_RSHIFT(width_, plane ? description.log2_chroma_w : 0),
                      height = AV_CEIL_RSHIFT(height_, plane ? description.log2_chroma_h : 0);
            for (int y = 0; y < height; ++y) {
                const std::uint8_t *row =
                    converted.data[plane] + static_cast<std::ptrdiff_t>(y) * converted.linesize[plane];
                frame_.insert(frame_.end(), row, row + width);
            }
        }
    }

    // Does not use swscale, because it converts BGR to RGBA through YUV, which loses information.
    void pack_pixels(const arhost_output &output) {
        const std::size_t channels = format_.name.size(), input_channels = writes_overlay_ ? 4 : 3;
        const std::string_view input_names = writes_overlay_ ? "rgba" : "bgr";
        const std::uint8_t *const input = writes_overlay_ ? output.overlay_rgba : output.bgr;
        const std::size_t stride = writes_overlay_ ? output.overlay_stride : output.stride;
        frame_.resize(channels * output.width * output.height);
        for (std::size_t channel = 0; channel < channels; ++channel) {
            const std::size_t source = input_names.find(format_.name[channel]); // npos: the alpha of an opaque frame
            std::uint8_t *to = frame_.data() + channel;
            for (std::size_t y = 0; y < output.height; ++y) {
                const std::uint8_t *row = input + y * stride;
                for (std::size_t x = 0; x < output.width; ++x, to += channels)
                    *to = source == std::string_view::npos ? 255 : row[input_channels * x + source];
            }
        }
    }

    Host host_;
    PipeStream stream_;
    const Format &format_;
    std::string matrix_;
    bool writes_overlay_, reopen_;
    int width_ = 0, height_ = 0;
    std::string header_;                    // header of the stream
    std::optional<BgrConverter> converter_; // only for Y4M
    std::vector<std::uint8_t> frame_;       // the frame's bytes in the output format
    bool was_interrupted_ = false;
};

constexpr const char *format_names[] = {"y4m", "y4m444", "rgba", "bgra", "rgb", "bgr", nullptr};
constexpr const char *contents[] = {"frame", "overlay", nullptr};
constexpr const char *matrices[] = {"auto", "bt601", "bt709", nullptr};
constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_OUTPUT_PATH, "path", nullptr, "Existing FIFO (mkfifo), or '-' for standard output."),
    option(ARHOST_OPTION_TEXT, "format", "y4m",
           "Y4M with YUV 4:2:0 (y4m) or 4:4:4 (y4m444), or pixels without headers: rgba, bgra, rgb or bgr.", 0, 0,
           format_names),
    option(ARHOST_OPTION_TEXT, "content", "frame",
           "frame, or the overlay alone with straight alpha (format rgba or bgra).", 0, 0, contents),
    option(ARHOST_OPTION_TEXT, "matrix", "auto",
           "YUV matrix of Y4M: bt601, bt709, or auto (bt601 up to 576 rows, otherwise bt709).", 0, 0, matrices),
    option(ARHOST_OPTION_BOOL, "reopen", "false",
           "After the reader has closed the FIFO, wait for the next reader; false: end the output."),
};

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_SINK,
    .id = "org.arhost.sink_pipe",
    .name = "Pipe",
    .version = "0.1.0",
    .vendor = "arhost",
    .licence = "Apache-2.0",
    .description = "Writes uncompressed video (Y4M or pixels) to a FIFO or standard output, for other programs.",
    .capabilities = ARHOST_SINK_CAPABILITY_STANDARD_OUTPUT | ARHOST_SINK_CAPABILITY_OVERLAY_INPUT,
    .option_count = std::size(options),
    .options = options,
    .needs = nullptr,
};

} // namespace

ARHOST_SINK(PipeSink, descriptor)
