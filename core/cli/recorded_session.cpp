// SPDX-License-Identifier: Apache-2.0
#include "cli/recorded_session.hpp"

#include "base/text.hpp"
#include "host/documents.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <limits>

namespace arhost::cli {
namespace {

using run_config::RecordedFrame;
namespace fs = std::filesystem;

constexpr const char *description_file = "session.json", *configuration_file = "configuration.yaml";
constexpr const char *log_file = "frames.jsonl";

void expect_file(const fs::path &file, const char *advice) {
    std::error_code error;
    if (!fs::is_regular_file(file, error))
        throw yaml::Error(file.string() + ": " + (fs::exists(file, error) ? "is not a file" : "is missing") + "; " +
                          advice);
}

// A frame with 1,024 targets and 1,024 observations takes less than 3 MB.
constexpr std::size_t max_line_bytes = 4 << 20;
constexpr int max_depth = 8; // an observation's corners are at depth 6

// Reads a line without its end. Returns false if there is none, or if the file ends within it.
// Reads at most max_line_bytes + 1 bytes.
bool read_line(std::istream &stream, std::string &text) {
    text.clear();
    for (int c; text.size() <= max_line_bytes && (c = stream.get()) != std::istream::traits_type::eof();) {
        if (c == '\n')
            return true;
        text.push_back(static_cast<char>(c));
    }
    return text.size() > max_line_bytes;
}

// A line of the log, for error messages.
struct Line {
    const fs::path &file;
    std::size_t number; // counts from 1

    [[noreturn]] void fail(const std::string &message, std::size_t column = 1) const {
        throw yaml::Error(file.string() + ":" + std::to_string(number) + ":" + std::to_string(column) + ": " +
                          message + "; to replay the frames before it, delete this line and all that follow");
    }
};

template <std::size_t size> void read_numbers(const nlohmann::json &from, double (&to)[size]) {
    const auto numbers = from.get<std::array<double, size>>();
    std::ranges::copy(numbers, to);
}

template <class Value>
Value one_of(const Line &line, const nlohmann::json &object, const char *key,
             std::initializer_list<std::pair<const char *, Value>> values) {
    const auto text = object.at(key).get<std::string>();
    std::string names;
    for (const auto &[name, value] : values) {
        if (text == name)
            return value;
        names += (names.empty() ? "" : ", ") + std::string(name);
    }
    line.fail(std::string(key) + ": '" + base::printable(text, 100) + "' is not one of " + names);
}

// Appends a target and its observations to the frame.
void read_target(const Line &line, const nlohmann::json &object, RecordedFrame &frame) {
    arhost_target &target = frame.targets.emplace_back();
    target.struct_size = sizeof target;
    const auto name = object.at("name").get<std::string>();
    if (name.empty() || name.size() >= sizeof target.name)
        line.fail("name: must have 1 to 63 bytes");
    name.copy(target.name, sizeof target.name - 1);
    target.state = one_of<arhost_target_state>(
        line, object, "state",
        {{"detected", ARHOST_TARGET_DETECTED}, {"predicted", ARHOST_TARGET_PREDICTED}, {"lost", ARHOST_TARGET_LOST}});
    target.age_frames = object.at("age_frames").get<std::uint32_t>();
    read_numbers(object.at("mt"), target.mt);
    if (object.contains("mt_alternative"))
        read_numbers(object.at("mt_alternative"), target.mt_alternative);
    if (object.contains("covariance"))
        read_numbers(object.at("covariance"), target.covariance);
    target.reprojection_px = object.value("reprojection_px", 0.0);
    target.ambiguity = object.value("ambiguity", 0.0);
    target.first_observation = static_cast<std::uint32_t>(frame.observations.size());
    for (const nlohmann::json &seen : object.value("observations", nlohmann::json::array())) {
        arhost_observation &observation = frame.observations.emplace_back();
        observation.struct_size = sizeof observation;
        observation.id = seen.at("id").get<std::int32_t>();
        observation.hamming = seen.at("hamming").get<std::uint32_t>();
        observation.decision_margin = seen.at("decision_margin").get<double>();
        observation.corner_sigma_px = seen.value("corner_sigma_px", 0.0);
        const auto corners = seen.at("corners_px").get<std::array<std::array<double, 2>, 4>>();
        for (std::size_t i = 0; i < 4; ++i)
            std::ranges::copy(corners[i], observation.corners_px[i]);
        ++target.observation_count;
    }
    if (frame.targets.size() > ARHOST_MAX_TARGETS || frame.observations.size() > ARHOST_MAX_OBSERVATIONS)
        line.fail("targets: has more targets or observations than a frame can have");
}

// Throws nlohmann::json::exception if a member is missing or has the wrong type.
RecordedFrame frame_of(const Line &line, const nlohmann::json &object) {
    RecordedFrame frame{};
    frame.number = object.at("frame").get<std::uint64_t>();
    frame.capture_ns = object.at("capture_ns").get<std::int64_t>();
    frame.clock = one_of<arhost_clock>(line, object, "clock",
                                       {{"media", ARHOST_CLOCK_MEDIA}, {"monotonic", ARHOST_CLOCK_MONOTONIC}});
    frame.overlay = one_of<arhost_overlay>(
        line, object, "overlay",
        {{"rendered", ARHOST_OVERLAY_RENDERED}, {"held", ARHOST_OVERLAY_HELD}, {"none", ARHOST_OVERLAY_NONE}});
    frame.scale = object.value("overlay_scale", 1.0);
    frame.samples = object.value("overlay_samples", std::uint32_t{0});
    if (!(frame.scale >= 0.01 && frame.scale <= 1))
        line.fail("overlay_scale: must be 0.01 to 1");
    for (const nlohmann::json &target : object.at("targets"))
        read_target(line, target, frame);
    if (const auto search = object.find("search"); search != object.end())
        frame.search = {.everywhere = search->at("everywhere").get<bool>(),
                        .observation_count = search->at("observations").get<std::uint32_t>(),
                        .unlisted_count = search->at("unlisted").get<std::uint32_t>(),
                        .expected_count = search->at("expected").get<std::uint32_t>(),
                        .missed_count = search->at("missed").get<std::uint32_t>(),
                        .candidate_count = search->contains("candidates") && !search->at("candidates").is_null()
                                               ? search->at("candidates").get<std::int32_t>()
                                               : -1};
    if (const nlohmann::json &camera = object.at("camera"); !camera.is_null()) {
        camera::View view{};
        read_numbers(camera.at("eye"), view.eye_mm);
        read_numbers(camera.at("look_at"), view.look_at_mm);
        read_numbers(camera.at("up"), view.up);
        if (const std::string problem = camera::problem_with(view); !problem.empty())
            line.fail("camera: " + problem);
        frame.view = view;
    } else if (frame.overlay != ARHOST_OVERLAY_NONE) {
        line.fail("camera: is null, but the frame has an overlay");
    }
    if (const auto truth = object.find("truth"); truth != object.end())
        frame.truth.emplace(truth->at("target").get<std::string>(), truth->at("mt").get<std::array<double, 16>>());
    return frame;
}

void expect_ascending(const Line &line, const RecordedFrame &frame, const RecordedFrame &before) {
    if (frame.number <= before.number)
        line.fail("frame: must be greater than in the line before, " + std::to_string(before.number));
    if (frame.capture_ns < before.capture_ns)
        line.fail("capture_ns: must not be less than in the line before");
}

// Reads the frames that the video contains completely. The video has `video_bytes` bytes.
void read_log(Session &session, std::uint64_t video_bytes) {
    const fs::path file = session.folder / log_file;
    std::ifstream stream(file, std::ios::binary);
    std::vector<RecordedFrame> &frames = session.recording.frames;
    std::uint64_t lacking = 0, end_before = 0; // frames that the video lacks; `video_end` of the previous line
    bool is_complete = false;
    std::string text;
    for (Line line{file, 1}; read_line(stream, text); ++line.number) {
        if (text.size() > max_line_bytes)
            line.fail("is longer than 4 MiB, which no frame needs");
        try {
            const nlohmann::json object = nlohmann::json::parse(text, [&](int depth, auto, auto &) {
                if (depth > max_depth)
                    line.fail("is nested more deeply than the record of a frame");
                return true;
            });
            if (is_complete)
                line.fail("follows the line that ends the recording");
            if (object.is_object() && object.contains("end")) {
                is_complete = true;
                continue;
            }
            const RecordedFrame frame = frame_of(line, object);
            if (!frames.empty())
                expect_ascending(line, frame, frames.back());
            const auto video_end = object.at("video_end").get<std::uint64_t>();
            if (video_end <= end_before)
                line.fail("video_end: must be greater than in the line before");
            end_before = video_end;
            if (video_end > video_bytes)
                ++lacking;
            else
                frames.push_back(frame);
        } catch (const nlohmann::json::parse_error &error) {
            line.fail("is not valid JSON", std::max<std::size_t>(error.byte, 1));
        } catch (const nlohmann::json::exception &error) {
            line.fail(
                std::string("is not the record of a frame: ") +
                base::printable(std::string(error.what()).substr(std::string(error.what()).find("] ") + 2), 200));
        }
    }
    if (stream.bad())
        throw yaml::Error(file.string() + ": cannot be read: " + std::strerror(errno));
    if (frames.empty())
        throw yaml::Error(session.folder.string() + ": contains no complete frame; record the session again");
    const std::string last = std::to_string(frames.back().number);
    if (lacking > 0)
        session.warning = session.video().string() + ": ends after frame " + last + ": the last " +
                          std::to_string(lacking) + " frames of " + log_file + " are missing";
    else if (!is_complete)
        session.warning = session.folder.string() + ": the recording was interrupted; it ends after frame " + last +
                          ", and frames that were not written then are missing";
}

} // namespace

Session read_session(const fs::path &path) {
    const fs::path folder = fs::absolute(path).lexically_normal();
    std::error_code error;
    if (!fs::is_directory(folder, error))
        throw yaml::Error(path.string() + ": " + (fs::exists(folder, error) ? "is not a folder" : "does not exist") +
                          "; name the folder of a session that sink_session has recorded");
    constexpr const char *advice = "a session that sink_session has recorded contains it (docs/sessions.md)";
    const fs::path description = folder / description_file, configuration = folder / configuration_file;
    for (const fs::path &file : {description, configuration, folder / log_file, folder / "video.mkv"})
        expect_file(file, advice);
    yaml::Node root = yaml::Node::load(description);
    root.require("format").choice({"arhost-session"});
    if (const yaml::Node version = root.require("version"); version.integer() != host::session_version)
        version.fail("must be " + std::to_string(host::session_version) +
                     ", the only version that this arhost can replay; record the session again, or replay it with "
                     "the arhost that has recorded it");
    yaml::Node::Origin origin{root.require("folder").text(), {}};
    const yaml::Node overridden = root.require("overridden");
    for (const auto &[path, relative_to] : overridden.entries())
        origin.overridden[path] = relative_to.text();
    Session session{folder, root, yaml::Node::load_copy(configuration, origin), {}, ""};
    const std::uint64_t bytes = fs::file_size(session.video(), error);
    if (error)
        throw yaml::Error(session.video().string() + ": cannot be read: " + error.message());
    read_log(session, bytes);
    return session;
}

std::vector<std::string> Session::changed_scene_files() const {
    std::vector<std::string> changes;
    const yaml::Node files = description.require("scene_files");
    for (const yaml::Node &entry : files.items()) {
        const fs::path file = entry.require("file").text();
        const auto hash = entry.find("fnv1a");
        const auto found = host::fingerprint_of(file, hash ? std::numeric_limits<std::uint64_t>::max() : 0);
        const host::Fingerprint recorded{static_cast<std::uint64_t>(entry.require("bytes").integer(0)),
                                         hash ? hash->text() : ""};
        if (found != recorded)
            changes.push_back("the scene file '" + file.string() + "' " +
                              (found ? "has changed since the recording" : "of the recording cannot be read") +
                              "; the images will differ from the recorded ones");
    }
    return changes;
}

} // namespace arhost::cli
