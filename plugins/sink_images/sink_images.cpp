// SPDX-License-Identifier: Apache-2.0
//
// Frames as image files: numbered ones, or a single one.
#include "encoder.hpp"
#include "last_frame.hpp"
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

std::unique_ptr<images::Encoder> make_encoder(const fs::path &path, const Options &options) {
    std::string extension = path.extension().string();
    std::ranges::transform(extension, extension.begin(), [](unsigned char c) { return std::tolower(c); });
    if (extension == ".png")
        return images::make_png_encoder(static_cast<int>(options.integer("compression")));
    if (extension == ".jpg" || extension == ".jpeg")
        return images::make_jpeg_encoder(static_cast<int>(options.integer("quality")));
    throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                  "path: '" + path.string() + "' ends in neither .png nor .jpg: the ending chooses the format");
}

// nullopt if the file name has no percent sign: a single image.
std::optional<NumberedName> numbered_name_of(const fs::path &path) try {
    const std::string name = path.filename().string();
    return name.find('%') == std::string::npos ? std::nullopt : std::optional<NumberedName>(name);
} catch (const std::invalid_argument &error) {
    throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, std::string("path: ") + error.what());
}

class ImageSink {
public:
    ImageSink(const Host &host, const Options &options)
        : host_(host), path_(options.text("path")), scratch_(files::hidden_beside(path_, ".partial")),
          kept_path_(files::hidden_beside(path_, ".last")), pattern_(numbered_name_of(path_)),
          encoder_(make_encoder(path_, options)), frame_(options.integer("frame")),
          every_(static_cast<std::uint64_t>(options.integer("every"))) {
        if (pattern_ && frame_ >= 0)
            throw Failure(
                ARHOST_STATUS_ERROR_CONFIGURATION,
                "frame: picks one frame for a plain path such as out/demo.png, but 'path' has a number in it");
        if (!pattern_ && every_ != 1)
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          "every: needs a 'path' with a number in it, such as out/frame_%05d.png");
    }

    void start(const arhost_sink_setup &setup) {
        files::make_parent_folders(path_);
        files::check_can_write(scratch_); // tells now, rather than at a frame
        if (pattern_) {
            if (setup.first_sequence == 0)
                warn_of_older_images();
            return;
        }
        std::error_code ignored;
        if (fs::is_directory(path_, ignored))
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          "path: '" + path_.string() + "' is a folder: add a file's name");
        setup_ = setup;
        if (frame_ < 0 && setup.first_sequence > 0)
            begin_keeping();
        may_be_older_ = frame_ < 0 ? setup.first_sequence == 0 : setup.first_sequence <= wanted();
    }

    arhost_status write(const arhost_output &output) {
        const Image image{output.width, output.height, output.stride, output.bgr};
        const std::uint64_t sequence = output.record->sequence;
        // From the first frame on (a run that is refused harms nothing) the file's presence tells, also after
        // a restart, that it is this run's.
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
        } else if (sequence >= wanted() && !fs::exists(path_)) {
            replace(path_, image);
        }
        return ARHOST_STATUS_OK;
    }

    void stop() {
        if (kept_)
            if (const std::optional<Image> last = kept_->newest())
                replace(path_, *last);
        kept_.reset();
        files::remove_file(kept_path_);
        if (!pattern_ && (may_be_older_ || !fs::exists(path_)))
            host_.warn(
                "'" + path_.string() + "' was not written: " +
                (frame_ < 0 ? "no frame came" : "the run ended before frame " + std::to_string(frame_) + " came"));
    }

private:
    void begin_keeping() { kept_.emplace(kept_path_, setup_.width, setup_.height, setup_.first_sequence); }

    std::uint64_t wanted() const { return static_cast<std::uint64_t>(frame_); }

    void replace(const fs::path &target, const Image &image) {
        files::replace_file(target, scratch_, encoder_->encode(image));
    }

    void warn_of_older_images() const {
        const fs::path folder = path_.has_parent_path() ? path_.parent_path() : ".";
        const auto older =
            std::count_if(fs::directory_iterator(folder), fs::directory_iterator(),
                          [&](const auto &e) { return pattern_->number(e.path().filename().string()).has_value(); });
        if (older > 0)
            host_.warn("'" + folder.string() + "' holds " + std::to_string(older) +
                       " images of an earlier run with such names: those that this run doesn't replace stay");
    }

    Host host_;
    fs::path path_;
    fs::path scratch_, kept_path_; // beside `path_`, for a while
    std::optional<NumberedName> pattern_;
    std::unique_ptr<images::Encoder> encoder_;
    std::int64_t frame_;  // of a plain path: which one, or -1, the last
    std::uint64_t every_; // of a pattern
    arhost_sink_setup setup_{};
    std::optional<images::LastFrame> kept_;
    bool may_be_older_ = false; // than this run: what lies at `path_`
};

constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_OUTPUT_PATH, "path", nullptr,
           "Images to write (out/frame_%05d.png, numbered by frame) or one image (out/demo.png); PNG or JPEG."),
    option(ARHOST_OPTION_INTEGER, "frame", "-1", "Of a path without a number: the frame to write; -1: the last one.",
           -1, 9e15),
    option(ARHOST_OPTION_INTEGER, "every", "1",
           "Of a path with a number: write the frames whose numbers this divides.", 1, 1e9),
    option(ARHOST_OPTION_INTEGER, "compression", "1", "Of PNG: 1 (fast) to 12 (small); the pixels are the same.", 1,
           12),
    option(ARHOST_OPTION_INTEGER, "quality", "95", "Of JPEG: 1 to 100; from 90 on, colour is kept at full size.", 1,
           100),
};

constexpr arhost_descriptor descriptor = {
    sizeof(arhost_descriptor),
    ARHOST_KIND_SINK,
    "sink_images",
    "Image files",
    "0.1.0",
    "arhost",
    "Apache-2.0",
    "Writes frames as PNG or JPEG files, numbered ones or a single one.",
    0,
    std::size(options),
    options,
    nullptr,
};

} // namespace

ARHOST_SINK(ImageSink, descriptor)
