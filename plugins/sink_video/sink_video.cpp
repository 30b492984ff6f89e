// SPDX-License-Identifier: Apache-2.0
//
// A film. Frames are encoded at once into a segment file beside it; at the end all segments, one more
// for each restart, are joined without encoding again and put in place as a whole.
#include "encoder.hpp"
#include "segments.hpp"
#include "sink_common/files.hpp"

#include <arhost-cpp/plugin.hpp>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <optional>
#include <string>

namespace {

namespace fs = std::filesystem;
using namespace arhost;
using namespace arhost::video;

const char *format_of(const fs::path &path) {
    std::string extension = path.extension().string();
    std::ranges::transform(extension, extension.begin(), [](unsigned char c) { return std::tolower(c); });
    if (extension == ".mp4")
        return "mp4";
    if (extension == ".mov")
        return "mov";
    if (extension == ".mkv")
        return "matroska";
    throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                  "path: '" + path.string() + "' ends in none of .mp4, .mkv and .mov: the ending chooses the format");
}

AVRational rational(double fps) {
    if (!(fps > 0))
        return {30, 1}; // unknown
    // Segments count milliseconds, from which a frame's number must be found again.
    if (fps < 0.001 || fps > 500)
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      "a film has 0.001 to 500 frames a second, not the source's " + std::to_string(fps) +
                          ": set the source's fps");
    return av_d2q(fps, 65535); // MPEG-4 has 16 bits for it
}

class VideoSink {
public:
    VideoSink(const Host &host, const Options &options)
        : host_(host), path_(options.text("path")), partial_(files::hidden_beside(path_, ".partial")),
          format_(format_of(path_)), settings_{.width = 0,
                                               .height = 0,
                                               .fps = {30, 1},
                                               .codec = options.text("codec"),
                                               .crf = static_cast<int>(options.integer("crf")),
                                               .preset = options.text("preset"),
                                               .threads = static_cast<int>(options.integer("threads"))} {
        av_log_set_level(AV_LOG_FATAL); // the rest is x264's statistics, and that a killed segment ends early
    }

    void start(const arhost_sink_setup &setup) {
        settings_.width = static_cast<int>(setup.width);
        settings_.height = static_cast<int>(setup.height);
        settings_.fps = rational(setup.fps);
        encoder_.emplace(settings_);

        files::make_parent_folders(path_);
        std::error_code ignored;
        if (fs::is_directory(path_, ignored))
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          "path: '" + path_.string() + "' is a folder: add a file's name");
        files::check_can_write(partial_);
        first_ = static_cast<std::int64_t>(setup.first_sequence);
        if (first_ > 0)
            begin();
    }

    arhost_status write(const arhost_output &output) {
        if (static_cast<int>(output.width) != settings_.width || static_cast<int>(output.height) != settings_.height)
            throw Failure(ARHOST_STATUS_ERROR_INVALID_ARGUMENT, "a frame's size is not that of the start");
        if (failed_)
            return ARHOST_STATUS_ERROR_IO; // said already
        if (!writer_) {
            failed_ = true; // unless the next lines succeed
            begin();
            failed_ = false;
        }
        const auto number = static_cast<std::int64_t>(output.record->sequence);
        writer_->append(encoder_->encode(output.bgr, output.stride, number));
        finished_ = false;
        return ARHOST_STATUS_OK;
    }

    void stop() {
        if (failed_)
            return files::remove_file(segment_of(path_, first_).path);
        if (!writer_)
            return host_.warn("no frame came: '" + path_.string() + "' was not written");
        writer_.reset();
        encoder_.reset();
        const std::vector<Segment> segments = find_segments(path_);
        if (!finished_)
            finish(segments);
        for (const Segment &segment : segments)
            files::remove_file(segment.path);
    }

private:
    // Not before a frame is there: a run that is refused leaves what an earlier one could not finish.
    void begin() {
        bool has_beginning = false;
        for (const Segment &segment : find_segments(path_))
            if (segment.first >= first_)
                files::remove_file(segment.path); // is made anew, or lies there from an earlier run
            else
                has_beginning |= segment.first == 0;
        files::remove_file(partial_);
        // The first segment goes first once the film is in place: a kill after that leaves nothing to do.
        std::error_code ignored;
        finished_ = first_ > 0 && !has_beginning && fs::exists(path_, ignored);
        if (first_ > 0 && !has_beginning && !finished_)
            host_.warn("the film's part before frame " + std::to_string(first_) + " is gone: '" +
                       segment_of(path_, 0).path.string() + "' is not there");
        writer_.emplace(segment_of(path_, first_).path, encoder_->context());
    }

    void finish(const std::vector<Segment> &segments) {
        try {
            const std::int64_t frames = join(
                segments, partial_, format_, settings_.fps,
                [&](double fraction) { host_.progress(fraction, "finishing the film"); },
                [&](const std::string &text) { host_.warn(text); });
            if (frames == 0)
                host_.warn("no frame came: '" + path_.string() + "' was not written");
            else if (std::error_code error; fs::rename(partial_, path_, error), error)
                throw files::io_failure("can't write", path_, error.value());
        } catch (const Failure &failure) {
            files::remove_file(partial_);
            throw Failure(failure.status(), std::string(failure.what()) + "; the film's frames are kept in '" +
                                                files::hidden_beside(path_, ".from*.mkv").string() + "'");
        }
    }

    Host host_;
    fs::path path_, partial_;
    const char *format_; // libav's name
    EncoderSettings settings_;
    std::optional<Encoder> encoder_;
    std::optional<SegmentWriter> writer_;
    std::int64_t first_ = 0; // number of the frame to begin with
    bool failed_ = false;    // it could not even begin
    bool finished_ = false;  // by a process that died before it could say so
};

constexpr const char *codecs[] = {"h264", "mpeg4", nullptr};
constexpr const char *presets[] = {"ultrafast", "superfast", "veryfast", "faster",   "fast",
                                   "medium",    "slow",      "slower",   "veryslow", nullptr};
constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_OUTPUT_PATH, "path", nullptr, "The film to write: .mp4, .mkv or .mov."),
    option(ARHOST_OPTION_TEXT, "codec", "h264", "How frames are encoded: h264 or mpeg4.", 0, 0, codecs),
    option(ARHOST_OPTION_INTEGER, "crf", "18",
           "Quality: 0 (best; of h264: lossless) to 51; 18 can hardly be told from the original.", 0, 51),
    option(ARHOST_OPTION_TEXT, "preset", "veryfast", "Of h264: slower ones make smaller files.", 0, 0, presets),
    option(ARHOST_OPTION_INTEGER, "threads", "1", "Threads of the encoder.", 1, 64),
};

constexpr arhost_descriptor descriptor = {
    sizeof(arhost_descriptor),
    ARHOST_KIND_SINK,
    "sink_video",
    "Film",
    "0.1.0",
    "arhost",
    "Apache-2.0",
    "Writes frames as a film that survives kills and restarts.",
    0,
    std::size(options),
    options,
    nullptr,
};

} // namespace

ARHOST_SINK(VideoSink, descriptor)
