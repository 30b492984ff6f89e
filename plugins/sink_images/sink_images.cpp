// SPDX-License-Identifier: Apache-2.0
//
// sink_images: writes frames as numbered image files, or one frame as a single image file.
#include "image_encoder.hpp"
#include "last_frame.hpp"
#include "sink_common/debug_view.hpp"
#include "sink_common/files.hpp"

#include <arhost-cpp/numbered_name.hpp>
#include <arhost-cpp/plugin.hpp>

#include <algorithm>
#include <cctype>
#include <fcntl.h>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

namespace {

namespace fs = std::filesystem;
using namespace arhost;
using images::Image;
using images::PixelFormat;

PixelFormat format_of(const std::string &content) {
    return content == "overlay" ? PixelFormat::rgba8 : content == "depth" ? PixelFormat::depth16 : PixelFormat::bgr8;
}

std::unique_ptr<images::Encoder> make_encoder(const fs::path &path, const Options &options) {
    std::string extension = path.extension().string();
    std::ranges::transform(extension, extension.begin(), [](unsigned char c) { return std::tolower(c); });
    if (extension == ".png")
        return images::make_png_encoder(static_cast<int>(options.integer("compression")));
    if (extension == ".jpg" || extension == ".jpeg")
        return images::make_jpeg_encoder(static_cast<int>(options.integer("quality")));
    throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "path: '" + path.string() + "' must end in .png, .jpg or .jpeg");
}

// Returns std::nullopt if the file name has no percent sign, which means a single image.
std::optional<NumberedName> numbered_name_of(const fs::path &path) try {
    const std::string name = path.filename().string();
    return name.find('%') == std::string::npos ? std::nullopt : std::optional<NumberedName>(name);
} catch (const std::invalid_argument &error) {
    throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, std::string("path: ") + error.what());
}

class ImageSink {
public:
    static constexpr const char *changeable[] = {drawing::DebugView::key, nullptr};

    ImageSink(const Host &host, const Options &options)
        : host_(host), path_(options.text("path")), scratch_(files::hidden_sibling(path_, ".partial")),
          kept_path_(files::hidden_sibling(path_, ".last")), pattern_(numbered_name_of(path_)),
          encoder_(make_encoder(path_, options)), frame_(options.integer("frame")),
          every_(static_cast<std::uint64_t>(options.integer("every"))), format_(format_of(options.text("content"))),
          debug_view_(options) {
        if (format_ != PixelFormat::bgr8 && path_.extension() != ".png")
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          "content: JPEG stores neither transparent pixels nor depth; let 'path' end in .png");
        if (pattern_ && frame_ >= 0)
            throw Failure(
                ARHOST_STATUS_ERROR_CONFIGURATION,
                "frame: is only allowed if 'path' names a single image, such as out/demo.png; this path is numbered");
        if (!pattern_ && every_ != 1)
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          "every: is only allowed if 'path' is numbered, such as out/frame_%05d.png");
    }

    std::uint64_t capabilities() const {
        std::uint64_t capabilities = ARHOST_SINK_CAPABILITY_NUMBERED_FILES;
        if (format_ == PixelFormat::rgba8)
            capabilities |= ARHOST_SINK_CAPABILITY_OVERLAY_INPUT;
        if (format_ == PixelFormat::depth16)
            capabilities |= ARHOST_SINK_CAPABILITY_VIDEO_INPUT;
        return capabilities;
    }

    void start(const arhost_sink_setup &setup) {
        if (format_ == PixelFormat::depth16 && !setup.video_format->has_depth)
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "content: the source delivers no depth");
        debug_view_.start(setup);
        depth_stride_ = setup.video_format->depth_stride;
        files::make_parent_folders(path_);
        files::check_can_write(scratch_); // reports an error now instead of at the first frame
        if (pattern_) {
            if (setup.first_sequence == 0)
                warn_of_older_images();
            return;
        }
        std::error_code ignored;
        if (fs::is_directory(path_, ignored))
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          "path: '" + path_.string() + "' is a folder; add a file name");
        setup_ = setup;
        if (frame_ < 0 && setup.first_sequence > 0)
            begin_keeping();
        may_be_older_ = frame_ < 0 ? setup.first_sequence == 0 : setup.first_sequence <= frame_number();
    }

    arhost_status write(const arhost_output &output) {
        const Image image = image_of(output);
        const std::uint64_t sequence = output.record->sequence;
        // Deletes an older image when the first frame arrives instead of in start(), because the run may fail before.
        // From then on, even after a restart, an existing file comes from this run.
        if (may_be_older_)
            files::remove_file(path_);
        may_be_older_ = false;
        if (pattern_) {
            if (sequence % every_ == 0)
                replace(path_.parent_path() / pattern_->name(sequence), image);
        } else if (frame_ < 0) {
            if (!kept_)
                begin_keeping();
            kept_->keep(image, sequence);
        } else if (sequence >= frame_number() && !fs::exists(path_)) {
            replace(path_, image);
        }
        return ARHOST_STATUS_OK;
    }

    void set(const Options &changed) { debug_view_.is_on = changed.boolean(drawing::DebugView::key); }

    void stop() {
        if (kept_)
            if (const std::optional<Image> last = kept_->newest())
                replace(path_, *last);
        kept_.reset();
        files::remove_file(kept_path_);
        if (!pattern_ && (may_be_older_ || !fs::exists(path_)))
            host_.warn("'" + path_.string() + "' was not written: " +
                       (frame_ < 0 ? "there was no frame" : "the run ended before frame " + std::to_string(frame_)));
    }

private:
    Image image_of(const arhost_output &output) {
        switch (format_) {
        case PixelFormat::rgba8:
            return {output.width, output.height, output.overlay_stride, output.overlay_rgba, format_};
        case PixelFormat::depth16:
            return {output.width, output.height, depth_stride_,
                    reinterpret_cast<const std::uint8_t *>(output.depth_mm), format_};
        default:
            const arhost_output &shown = debug_view_.applied_to(output);
            return {shown.width, shown.height, shown.stride, shown.bgr, format_};
        }
    }

    void begin_keeping() { kept_.emplace(kept_path_, setup_.width, setup_.height, format_, setup_.first_sequence); }

    std::uint64_t frame_number() const { return static_cast<std::uint64_t>(frame_); }

    void replace(const fs::path &target, const Image &image) {
        files::replace_file(target, scratch_, encoder_->encode(image));
    }

    void warn_of_older_images() const {
        const fs::path folder = path_.has_parent_path() ? path_.parent_path() : ".";
        const auto older =
            std::count_if(fs::directory_iterator(folder), fs::directory_iterator(),
                          [&](const auto &e) { return pattern_->number(e.path().filename().string()).has_value(); });
        if (older > 0)
            host_.warn("'" + folder.string() + "' already contains " + std::to_string(older) +
                       " images whose names match the pattern; this run keeps those it does not overwrite");
    }

    Host host_;
    fs::path path_;
    fs::path scratch_, kept_path_; // temporary files next to `path_`
    std::optional<NumberedName> pattern_;
    std::unique_ptr<images::Encoder> encoder_;
    std::int64_t frame_;  // number of the frame to write as a single image, or -1 for the last frame
    std::uint64_t every_; // interval of numbered images, in frames
    PixelFormat format_;
    drawing::DebugView debug_view_;
    std::uint32_t depth_stride_ = 0;
    arhost_sink_setup setup_{};
    std::optional<images::LastFrame> kept_;
    bool may_be_older_ = false; // the file at `path_` may be from an earlier run
};

constexpr const char *contents[] = {"frame", "overlay", "depth", nullptr};
constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_OUTPUT_PATH, "path", nullptr,
           "PNG or JPEG files to write: one per frame (out/frame_%05d.png), or a single image (out/demo.png)."),
    option(ARHOST_OPTION_INTEGER, "frame", "-1",
           "For a single image: number of the frame to write; -1: the last frame.", -1, 9e15),
    option(ARHOST_OPTION_INTEGER, "every", "1",
           "For a numbered path: write only the frames whose number is a multiple of this.", 1, 1e9),
    option(ARHOST_OPTION_TEXT, "content", "frame",
           "frame, the overlay alone with straight alpha (PNG), or the depth of the real scene in mm (16-bit PNG).",
           0, 0, contents),
    option(ARHOST_OPTION_INTEGER, "compression", "1", "PNG compression: 1 (fast) to 12 (small); lossless.", 1, 12),
    option(ARHOST_OPTION_INTEGER, "quality", "95", "JPEG quality: 1 to 100; from 90 on, chroma is not subsampled.", 1,
           100),
    drawing::DebugView::option,
};

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_SINK,
    .id = "org.arhost.sink_images",
    .name = "Image files",
    .version = "0.1.0",
    .vendor = "arhost",
    .licence = "Apache-2.0",
    .description = "Writes frames as numbered PNG or JPEG files, or one frame as a single file.",
    .capabilities = ARHOST_SINK_CAPABILITY_NUMBERED_FILES | ARHOST_SINK_CAPABILITY_VIDEO_INPUT |
                    ARHOST_SINK_CAPABILITY_OVERLAY_INPUT,
    .option_count = std::size(options),
    .options = options,
    .needs = nullptr,
};

} // namespace

ARHOST_SINK(ImageSink, descriptor)
