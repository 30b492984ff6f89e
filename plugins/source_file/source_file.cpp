// SPDX-License-Identifier: Apache-2.0
//
// source_file: reads frames from videos, numbered images and single images.
#include "folder.hpp"
#include "image_sequence.hpp"
#include "video_decoder.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <memory>
#include <thread>

namespace {

namespace fs = std::filesystem;
using arhost::Failure;
using arhost::quoted;

std::int64_t now_ns() {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
}

class FileSource {
public:
    FileSource(const arhost::Host &host, const arhost::Options &options)
        : host_(host), path_(options.text("path")), start_(options.integer("start")), loop_(options.boolean("loop")),
          limit_(static_cast<std::uint64_t>(options.integer("frames"))) {}

    void start(const arhost_source_setup &setup, arhost_source_properties &properties) {
        open();
        arhost_frame_format format = reader_->format();
        // A configured rate overrides the time stamps of the video.
        counts_time_ = setup.fps > 0 || !reader_->media_ns();
        fps_ = setup.fps > 0 ? setup.fps : format.fps > 0 ? format.fps : 30;
        paced_ = setup.paced != 0;
        format.fps = fps_;
        format.struct_size = properties.format.struct_size;
        arhost_frame_layout(&format);
        if (const arhost_intrinsics *camera = setup.intrinsics;
            camera && (camera->width != format.width || camera->height != format.height))
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          quoted(path_) + " has frames of " + std::to_string(format.width) + "×" +
                              std::to_string(format.height) + " px, but the camera calibration is for " +
                              std::to_string(camera->width) + "×" + std::to_string(camera->height));
        properties.format = format;
        const std::uint64_t count = reader_->frame_count();
        properties.frame_count = loop_ ? limit_ : limit_ && count ? std::min(limit_, count) : count;

        if (go_to(setup.first_sequence) == ARHOST_STATUS_ERROR_CANCELLED)
            throw Failure(ARHOST_STATUS_ERROR_CANCELLED, "seeking to frame " + std::to_string(setup.first_sequence) +
                                                             " of " + quoted(path_) + " was cancelled");
    }

    arhost_status read(const arhost_frame_buffer &buffer, arhost_frame_info &info) {
        std::uint64_t frame = buffer.sequence;
        if (const arhost_status status = go_to(frame); status != ARHOST_STATUS_OK)
            return status;
        if (paced_)
            if (const arhost_status status = wait_for(frame, info); status != ARHOST_STATUS_OK)
                return status;
        reader_->copy_to(buffer);
        info.clock = ARHOST_CLOCK_MEDIA;
        info.capture_ns = time_ns(frame);
        return ARHOST_STATUS_OK;
    }

    void stop() { reader_.reset(); }

private:
    void open() {
        std::error_code error;
        const fs::file_status status = fs::status(path_, error);
        if (fs::is_directory(status))
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          "path: " + quoted(path_) +
                              " is a folder; set the path of a video, of an image, or of numbered images "
                              "('folder/image_%04d.png'); " +
                              arhost::describe_folder(path_));
        // A percent sign in the name of an existing file is part of that name.
        if (!fs::exists(status) && path_.string().find('%') != std::string::npos) {
            reader_ = std::make_unique<arhost::ImageSequence>(arhost::numbered_files(path_, start_, host_));
            return;
        }
        if (!fs::exists(status)) {
            std::string why = error ? error.message() : "no such file";
            if (fs::is_directory(path_.parent_path(), error))
                why += "; " + arhost::describe_folder(path_.parent_path());
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "path: " + quoted(path_) + " cannot be opened: " + why);
        }
        if (!fs::is_regular_file(status))
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          "path: " + quoted(path_) + " is not a regular file; use source_v4l2 for cameras");
        if (arhost::is_image_name(path_)) {
            reader_ = std::make_unique<arhost::ImageSequence>(std::vector{path_});
            limit_ = loop_ ? limit_ : std::max<std::uint64_t>(limit_, 1);
            loop_ = true; // a single image is repeated
        } else {
            reader_ = std::make_unique<arhost::Video>(path_, host_);
        }
    }

    // Seeks to `frame`. In a loop, frame numbers continue in each iteration.
    arhost_status go_to(std::uint64_t frame) {
        if (limit_ && frame >= limit_)
            return ARHOST_STATUS_END;
        for (;;) {
            const arhost_status status = reader_->go_to(loop_frames_ ? frame % loop_frames_ : frame);
            if (status < ARHOST_STATUS_END || !loop_ || loop_frames_)
                return status;
            loop_frames_ = reader_->frame_count(); // the true length of a video is known only at its end
            loop_ns_ = reader_->end_ns();
        }
    }

    std::int64_t time_ns(std::uint64_t frame) const {
        if (counts_time_)
            return std::llround(static_cast<double>(frame) * 1e9 / fps_);
        const std::uint64_t iteration = loop_frames_ ? frame / loop_frames_ : 0;
        return static_cast<std::int64_t>(iteration) * loop_ns_ + *reader_->media_ns();
    }

    // Waits until `frame` is due. If it is late by a frame period or more, first advances `frame` to the frame that
    // is due now.
    arhost_status wait_for(std::uint64_t &frame, arhost_frame_info &info) {
        const auto period_ns = std::max(static_cast<std::int64_t>(1e9 / fps_), std::int64_t{1});
        if (!epoch_set_) {
            epoch_ns_ = now_ns() - time_ns(frame);
            epoch_set_ = true;
        }
        if (const std::int64_t late_ns = now_ns() - epoch_ns_ - time_ns(frame); late_ns >= period_ns) {
            // Skip no more than one second. After a longer pause, playback resumes close to where it stopped.
            info.skipped = static_cast<std::uint32_t>(std::min(late_ns, std::int64_t{1'000'000'000}) / period_ns);
            frame += info.skipped;
            if (const arhost_status status = go_to(frame); status != ARHOST_STATUS_OK)
                return status;
            // If the decoder is still too slow, plays slower instead of skipping more and more frames.
            if (now_ns() - epoch_ns_ - time_ns(frame) >= period_ns)
                epoch_ns_ = now_ns() - time_ns(frame);
        }
        const std::chrono::steady_clock::time_point due(std::chrono::nanoseconds(epoch_ns_ + time_ns(frame)));
        return host_.wait_until(due) ? ARHOST_STATUS_OK : ARHOST_STATUS_ERROR_CANCELLED;
    }

    arhost::Host host_;
    fs::path path_;
    std::int64_t start_; // −1: the lowest number that exists
    bool loop_;
    std::uint64_t limit_; // total number of frames; 0: no limit

    std::unique_ptr<arhost::Reader> reader_;
    bool counts_time_ = true; // true: frame n is at n/fps; false: use the time stamps of the reader
    double fps_ = 0;
    std::uint64_t loop_frames_ = 0; // frames per iteration of the loop; 0: not known yet
    std::int64_t loop_ns_ = 0;

    bool paced_ = false, epoch_set_ = false;
    std::int64_t epoch_ns_ = 0; // CLOCK_MONOTONIC at media time 0
};

using arhost::option;
constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_INPUT_PATH, "path", nullptr,
           "Path of a video, an image, or numbered images ('frames/image_%04d.png')."),
    option(ARHOST_OPTION_INTEGER, "start", "-1",
           "First number of numbered images; -1: the lowest number that exists.", -1, 2'147'483'647),
    option(ARHOST_OPTION_BOOL, "loop", "false", "Start again after the last frame."),
    option(ARHOST_OPTION_INTEGER, "frames", "0",
           "Number of frames to deliver; 0: all (1 for a single image, which is repeated).", 0, 2'147'483'647),
};

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_SOURCE,
    .id = "org.arhost.source_file",
    .name = "Video and image files",
    .version = "0.1.0",
    .vendor = "arhost",
    .licence = "Apache-2.0",
    .description = "Reads frames from a video file, numbered images or one image.",
    .capabilities = ARHOST_SOURCE_CAPABILITY_SEEK,
    .option_count = std::size(options),
    .options = options,
    .needs = nullptr,
};

} // namespace

ARHOST_SOURCE(FileSource, descriptor)
