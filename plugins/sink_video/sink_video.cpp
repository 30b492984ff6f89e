// SPDX-License-Identifier: Apache-2.0
//
// sink_video: writes a video. Encodes each frame immediately and writes it to a segment file. Each restart begins a
// new segment. At the end, joins all segments without re-encoding and atomically replaces the video.
#include "segments.hpp"
#include "sink_common/debug_view.hpp"
#include "sink_common/files.hpp"
#include "video_encoder.hpp"

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
    throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "path: '" + path.string() + "' must end in .mp4, .mkv or .mov");
}

AVRational rational(double fps) {
    if (!(fps > 0))
        return {30, 1}; // the rate is unknown
    // The time stamps of segments have a resolution of 1 ms. This limits the frame rate.
    if (fps < 0.001 || fps > 500)
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      "the source has " + std::to_string(fps) +
                          " frames per second, but a video must have 0.001 to 500; set 'fps' of the source");
    return av_d2q(fps, 65535); // MPEG-4 stores the denominator in 16 bits
}

class VideoSink {
public:
    static constexpr const char *changeable[] = {drawing::DebugView::key, nullptr};

    VideoSink(const Host &host, const Options &options)
        : host_(host), path_(options.text("path")), partial_(files::hidden_sibling(path_, ".partial")),
          format_(format_of(path_)), settings_{.width = 0,
                                               .height = 0,
                                               .fps = {30, 1},
                                               .codec = options.text("codec"),
                                               .crf = static_cast<int>(options.integer("crf")),
                                               .preset = options.text("preset"),
                                               .threads = static_cast<int>(options.integer("threads"))},
          debug_view_(options) {
        av_log_set_level(AV_LOG_FATAL); // suppresses x264's statistics and messages about truncated segments
    }

    void start(const arhost_sink_setup &setup) {
        settings_.width = static_cast<int>(setup.width);
        settings_.height = static_cast<int>(setup.height);
        settings_.fps = rational(setup.fps);
        encoder_.emplace(settings_);
        debug_view_.start(setup);

        files::make_parent_folders(path_);
        std::error_code ignored;
        if (fs::is_directory(path_, ignored))
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          "path: '" + path_.string() + "' is a folder; add a file name");
        files::check_can_write(partial_);
        first_ = static_cast<std::int64_t>(setup.first_sequence);
        if (first_ > 0)
            begin();
        else
            recover();
    }

    arhost_status write(const arhost_output &output) {
        if (static_cast<int>(output.width) != settings_.width || static_cast<int>(output.height) != settings_.height)
            throw Failure(ARHOST_STATUS_ERROR_INVALID_ARGUMENT, "the size of a frame differs from that in the setup");
        if (failed_)
            return ARHOST_STATUS_ERROR_IO; // the error has already been reported
        if (!writer_) {
            failed_ = true; // set to false after success
            begin();
            failed_ = false;
        }
        const auto number = static_cast<std::int64_t>(output.record->sequence);
        const arhost_output &shown = debug_view_.applied_to(output);
        writer_->append(encoder_->encode(shown.bgr, shown.stride, number), number, output.record->capture_ns);
        finished_ = false;
        return ARHOST_STATUS_OK;
    }

    void set(const Options &changed) { debug_view_.is_on = changed.boolean(drawing::DebugView::key); }

    void stop() {
        if (failed_)
            return files::remove_file(segment_of(path_, first_).path);
        if (!writer_)
            return host_.warn("'" + path_.string() + "' was not written, because there were no frames");
        writer_.reset();
        encoder_.reset();
        const std::vector<Segment> segments = find_segments(path_);
        if (!finished_)
            finish(segments);
        for (const Segment &segment : segments)
            files::remove_file(segment.path);
    }

private:
    // Makes a video of the segments that an earlier recording, of this run or another, has left, because it was
    // killed or the disk was full. Drops a single frame: this run wrote it, if it was killed before the host received
    // the answer.
    void recover() {
        const std::vector<Segment> segments = find_segments(path_);
        if (segments.empty())
            return;
        const std::string interrupted = "an earlier recording of '" + path_.string() + "' was interrupted";
        std::int64_t frames = 0;
        try {
            frames = join(
                segments, partial_, format_, settings_.fps,
                [&](double fraction) { host_.progress(fraction, "recovering an interrupted video"); },
                [&](const std::string &text) { host_.warn(text); });
            if (frames > 1) {
                const fs::path recovered = free_sibling();
                if (std::error_code error; fs::rename(partial_, recovered, error), error)
                    throw files::io_failure("cannot write", recovered, error.value());
                host_.warn(interrupted + "; its " + std::to_string(frames) + " frames are now in '" +
                           recovered.string() + "'");
            }
        } catch (const Failure &failure) {
            files::remove_file(partial_);
            // Whatever the status is: the host must not retry.
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          interrupted + ", and its frames cannot be recovered: " + failure.what() +
                              "; correct that, or move '" + files::hidden_sibling(path_, ".from*.mkv").string() +
                              "' to another folder");
        }
        files::remove_file(partial_);
        for (const Segment &segment : segments)
            files::remove_file(segment.path);
    }

    // Returns the first free name of "demo.recovered-1.mp4", "demo.recovered-2.mp4", …
    fs::path free_sibling() const {
        fs::path free;
        std::error_code ignored;
        for (int i = 1; free.empty() || fs::exists(free, ignored); ++i) {
            free = path_;
            free.replace_filename(path_.stem().string() + ".recovered-" + std::to_string(i) +
                                  path_.extension().string());
        }
        return free;
    }

    // Begins a segment.
    void begin() {
        bool has_beginning = false;
        for (const Segment &segment : find_segments(path_))
            if (segment.first >= first_)
                files::remove_file(segment.path); // the segment created below
            else
                has_beginning |= segment.first == 0;
        files::remove_file(partial_);
        // When the video is complete, stop() deletes segment 0 first. A missing segment 0 therefore tells a restarted
        // sink that the video is complete.
        std::error_code ignored;
        finished_ = first_ > 0 && !has_beginning && fs::exists(path_, ignored);
        if (first_ > 0 && !has_beginning && !finished_)
            host_.warn("the part of the video before frame " + std::to_string(first_) + " is lost: '" +
                       segment_of(path_, 0).path.string() + "' does not exist");
        writer_.emplace(segment_of(path_, first_).path, encoder_->context());
    }

    void finish(const std::vector<Segment> &segments) {
        try {
            const std::int64_t frames = join(
                segments, partial_, format_, settings_.fps,
                [&](double fraction) { host_.progress(fraction, "finishing the video"); },
                [&](const std::string &text) { host_.warn(text); });
            if (frames == 0)
                host_.warn("'" + path_.string() + "' was not written, because there were no frames");
            else if (std::error_code error; fs::rename(partial_, path_, error), error)
                throw files::io_failure("cannot write", path_, error.value());
        } catch (const Failure &failure) {
            files::remove_file(partial_);
            throw Failure(failure.status(), std::string(failure.what()) + "; the frames are kept in '" +
                                                files::hidden_sibling(path_, ".from*.mkv").string() + "'");
        }
    }

    Host host_;
    fs::path path_, partial_;
    const char *format_; // libav's name of the file format
    EncoderSettings settings_;
    drawing::DebugView debug_view_;
    std::optional<Encoder> encoder_;
    std::optional<SegmentWriter> writer_;
    std::int64_t first_ = 0; // number of the first frame
    bool failed_ = false;    // the segment could not be opened
    bool finished_ = false;  // a previous process completed the video, but was killed before it reported this
};

constexpr const char *codecs[] = {"h264", "mpeg4", nullptr};
constexpr const char *presets[] = {"ultrafast", "superfast", "veryfast", "faster",   "fast",
                                   "medium",    "slow",      "slower",   "veryslow", nullptr};
constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_OUTPUT_PATH, "path", nullptr, "Video file to write: .mp4, .mkv or .mov."),
    option(ARHOST_OPTION_TEXT, "codec", "h264", "Video codec: h264 or mpeg4.", 0, 0, codecs),
    option(ARHOST_OPTION_INTEGER, "crf", "18",
           "Quality: 0 (best; lossless with h264) to 51 (worst); 18 is visually lossless.", 0, 51),
    option(ARHOST_OPTION_TEXT, "preset", "veryfast", "x264 preset; slower presets give smaller files.", 0, 0,
           presets),
    option(ARHOST_OPTION_INTEGER, "threads", "1", "Number of encoder threads.", 1, 64),
    drawing::DebugView::option,
};

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_SINK,
    .id = "org.arhost.sink_video",
    .name = "Video",
    .version = "0.1.0",
    .vendor = "arhost",
    .licence = "Apache-2.0",
    .description = "Writes frames to a video file; survives kills and restarts.",
    .capabilities = 0,
    .option_count = std::size(options),
    .options = options,
    .needs = nullptr,
};

} // namespace

ARHOST_SINK(VideoSink, descriptor)
