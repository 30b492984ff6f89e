// SPDX-License-Identifier: Apache-2.0
//
// sink_session: records a session, which `arhost replay` plays back (docs/sessions.md). Writes the frames of the
// source to a video, and the record of each frame to a log. Each frame is written to the video before it is written
// to the log. Each line of the log states where the frame's data in the video ends. The log therefore shows which
// frames are complete, no matter how the process ended.
#include "sink_common/line_file.hpp"
#include "sink_common/record_line.hpp"
#include "video_file.hpp"

#include <arhost-cpp/plugin.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>

namespace {

namespace fs = std::filesystem;
using namespace arhost;
using Json = nlohmann::ordered_json;

constexpr const char *description_file = "session.json", *configuration_file = "configuration.yaml";
constexpr const char *log_file = "frames.jsonl", *video_file = "video.mkv";

// Returns the value of a string member; "" if there is none.
std::string text_of(const Json &object, const char *key) {
    const auto found = object.is_object() ? object.find(key) : object.end();
    return found != object.end() && found->is_string() ? found->get<std::string>() : "";
}

class SessionSink {
public:
    SessionSink(const Host &host, const Options &options)
        : host_(host), folder_(options.text("path")), replaces_(options.boolean("replace")),
          log_(host, folder_ / log_file), settings_{.format = {},
                                                    .fps = 0,
                                                    .codec = options.text("codec"),
                                                    .crf = static_cast<int>(options.integer("crf")),
                                                    .threads = static_cast<int>(options.integer("threads"))} {
        av_log_set_level(AV_LOG_FATAL); // suppresses x264's statistics
    }

    void start(const arhost_sink_setup &setup) {
        settings_.format = *setup.video_format;
        if (setup.video_format->has_depth && setup.first_sequence == 0)
            host_.warn("a session does not contain the depth of the frames; record it with "
                       "{plugin: sink_images, path: depth_%05d.png, options: {content: depth}}");
        settings_.fps = setup.fps;
        video_.emplace(folder_ / video_file, settings_);
        description_ = setup.run_description ? Json::parse(setup.run_description) : Json::object();
        files::make_parent_folders(folder_);
        has_restarted_ = setup.first_sequence > 0;
        if (has_restarted_)
            return resume(setup.first_sequence);
        expect_free();
        files::check_can_write(files::hidden_sibling(folder_, ".check"));
    }

    arhost_status write(const arhost_output &output) {
        is_complete_ = false; // stays false if this frame cannot be written
        const arhost_record &record = *output.record;
        if (!video_->is_open())
            begin();
        if (last_ms_ < 0)
            first_capture_ns_ = record.capture_ns;
        const std::uint64_t previous_end = video_->end();
        const std::int64_t time_ms = std::max((record.capture_ns - first_capture_ns_) / 1'000'000, last_ms_ + 1);
        video_->append(output.video, time_ms);
        line_.clear();
        record::append_members(line_, record);
        line_ += ", \"video_end\": " + std::to_string(video_->end()) + "}\n";
        try {
            log_.append(line_);
        } catch (const Failure &) {
            video_->truncate(previous_end);
            throw;
        }
        last_ms_ = time_ms;
        is_complete_ = true;
        return ARHOST_STATUS_OK;
    }

    void stop() {
        if (!video_->is_open())
            return host_.warn("'" + folder_.string() + "' was not written, because there were no frames");
        if (is_complete_)
            log_.append("{\"end\": true}\n"); // a log without this line was interrupted
    }

private:
    // Throws if the folder has contents that must not be overwritten. A restarted sink may overwrite the files that
    // it wrote before the host received its first answer.
    void expect_free() const {
        std::error_code error;
        const fs::file_status status = fs::status(folder_, error);
        if (!fs::exists(status))
            return;
        if (!fs::is_directory(status))
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          "path: '" + folder_.string() + "' is not a folder; choose another path");
        const bool is_empty = fs::is_empty(folder_, error);
        if (error)
            throw files::io_failure("cannot list the folder", folder_, error.value());
        if (is_empty || replaces_ || is_of_this_run())
            return;
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      "path: the folder '" + folder_.string() +
                          "' exists; choose another path, or replace the session in it with 'replace: true'");
    }

    bool is_of_this_run() const {
        std::ifstream file(folder_ / description_file);
        const Json written = Json::parse(file, nullptr, false);
        const std::string id = text_of(description_, "id");
        return !id.empty() && text_of(written, "id") == id;
    }

    void begin() {
        std::error_code error;
        fs::create_directory(folder_, error);
        if (error)
            throw files::io_failure("cannot create the folder", folder_, error.value());
        if (!has_restarted_) // otherwise the log is open
            files::remove_file(folder_ / log_file);
        Json description = description_;
        if (const std::string configuration = text_of(description, "configuration"); !configuration.empty()) {
            write_text(configuration_file, configuration);
            description.erase("configuration");
        }
        description["video"] = {
            {"file", video_file}, {"codec", settings_.codec}, {"lossless", settings_.codec == "ffv1"}};
        write_text(description_file, description.dump(2) + "\n");
        video_->create();
    }

    void write_text(const char *name, const std::string &text) const {
        const fs::path file = folder_ / name;
        files::replace_file(file, files::hidden_sibling(file, ".partial"),
                            {reinterpret_cast<const std::uint8_t *>(text.data()), text.size()});
    }

    void resume(std::uint64_t first_sequence) {
        std::uint64_t end = 0;
        std::int64_t last_capture_ns = 0;
        log_.start(first_sequence, [&](std::string_view text) {
            const Json line = Json::parse(text, nullptr, false);
            try {
                if (line.at("frame").get<std::uint64_t>() >= first_sequence)
                    return false;
                last_capture_ns = line.at("capture_ns").get<std::int64_t>();
                if (last_ms_ < 0)
                    first_capture_ns_ = last_capture_ns;
                last_ms_ = std::max((last_capture_ns - first_capture_ns_) / 1'000'000, last_ms_ + 1);
                end = line.at("video_end").get<std::uint64_t>();
                return true;
            } catch (const Json::exception &) {
                return false;
            }
        });
        if (last_ms_ >= 0) // otherwise no frame was written, and write() creates the video
            video_->resume(end);
    }

    Host host_;
    fs::path folder_;
    bool replaces_, has_restarted_ = false;
    bool is_complete_ = true; // whether the last frame was written
    files::LineFile log_;
    session::VideoSettings settings_;
    std::optional<session::VideoFile> video_;
    Json description_;
    std::string line_;
    std::int64_t first_capture_ns_ = 0;
    std::int64_t last_ms_ = -1; // time of the last frame in the video, in ms; -1: there is none
};

constexpr const char *codecs[] = {"ffv1", "h264", nullptr};
constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_OUTPUT_PATH, "path", nullptr, "Folder to create for the session."),
    option(ARHOST_OPTION_TEXT, "codec", "ffv1",
           "Video codec: ffv1 (lossless) or h264 (smaller and faster to write, visually lossless).", 0, 0, codecs),
    option(ARHOST_OPTION_INTEGER, "crf", "12", "Quality of h264: 0 (lossless) to 51 (worst).", 0, 51),
    option(ARHOST_OPTION_INTEGER, "threads", "1", "Number of encoder threads.", 1, 64),
    option(ARHOST_OPTION_BOOL, "replace", "false", "Replace a session that exists in the folder."),
};

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_SINK,
    .id = "org.arhost.sink_session",
    .name = "Session",
    .version = "0.1.0",
    .vendor = "arhost",
    .licence = "Apache-2.0",
    .description = "Records the raw video, poses and configuration of a run, for arhost replay.",
    .capabilities = ARHOST_SINK_CAPABILITY_VIDEO_INPUT | ARHOST_SINK_CAPABILITY_RUN_DESCRIPTION,
    .option_count = std::size(options),
    .options = options,
    .needs = nullptr,
};

} // namespace

ARHOST_SINK(SessionSink, descriptor)
