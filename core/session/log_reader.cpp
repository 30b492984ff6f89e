// SPDX-License-Identifier: Apache-2.0
#include "session/log_reader.hpp"

#include "base/text.hpp"
#include "yaml/yaml.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <optional>
#include <string_view>

namespace arhost::session {
namespace {

namespace fs = std::filesystem;

// A frame with 1,024 targets and 1,024 observations takes less than 3 MB.
constexpr std::size_t max_line_bytes = 4 << 20;
constexpr int max_depth = 8; // an observation's corners are at depth 6

// Reads a line without its end, or the first bytes of one that is too long. `buffer` has max_line_bytes + 2 bytes.
// Returns nullopt if there is no line, or if the file ends within it.
std::optional<std::string_view> read_line(std::istream &stream, std::vector<char> &buffer) {
    stream.getline(buffer.data(), static_cast<std::streamsize>(buffer.size()));
    if (stream.eof() || stream.bad())
        return std::nullopt;
    const auto size = static_cast<std::size_t>(stream.gcount());
    return std::string_view(buffer.data(), stream.fail() ? size : size - 1); // without the '\n'
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
    object.at("name").get<std::string>().copy(target.name, sizeof target.name);
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
    frame.shading_px = std::max(1u, object.value("overlay_shading_px", std::uint32_t{1})); // 0: as 1
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
                                               : -1,
                        .reserved_for_growth = {}};
    if (const nlohmann::json &camera = object.at("camera"); !camera.is_null()) {
        camera::View view{};
        read_numbers(camera.at("eye"), view.eye_mm);
        read_numbers(camera.at("look_at"), view.look_at_mm);
        read_numbers(camera.at("up"), view.up);
        frame.view = view;
    }
    if (const auto truth = object.find("truth"); truth != object.end())
        frame.truth.emplace(truth->at("target").get<std::string>(), truth->at("mt").get<std::array<double, 16>>());
    return frame;
}

} // namespace

Log read_log(const fs::path &file, std::uint64_t video_bytes, const std::function<void()> &progress) {
    Log log;
    std::uint64_t end_before = 0; // `video_end` of the previous line
    std::vector<char> buffer(max_line_bytes + 2);
    std::ifstream stream(file, std::ios::binary);
    const auto cannot_be_read = [&] {
        return yaml::Error(file.string() + ": cannot be read: " + std::strerror(errno));
    };
    if (!stream)
        throw cannot_be_read();
    progress();
    Line line{file, 1};
    for (; const auto text = read_line(stream, buffer); ++line.number, progress()) {
        if (text->size() > max_line_bytes)
            line.fail("is longer than 4 MiB, which no frame needs");
        try {
            const nlohmann::json object = nlohmann::json::parse(*text, [&](int depth, auto, auto &) {
                if (depth > max_depth)
                    line.fail("is nested more deeply than the record of a frame");
                return true;
            });
            if (log.is_complete)
                line.fail("follows the line that ends the recording");
            if (object.is_object() && object.contains("end")) {
                log.is_complete = true;
                continue;
            }
            RecordedFrame frame = frame_of(line, object);
            if (const std::string problem = problem_with(frame, log.frames.empty() ? nullptr : &log.frames.back());
                !problem.empty())
                line.fail(problem);
            const auto video_end = object.at("video_end").get<std::uint64_t>();
            if (video_end <= end_before)
                line.fail("video_end: must be greater than in the line before");
            end_before = video_end;
            if (video_end > video_bytes)
                ++log.lacking;
            else
                log.frames.push_back(std::move(frame));
        } catch (const nlohmann::json::parse_error &error) {
            line.fail("is not valid JSON", std::max<std::size_t>(error.byte, 1));
        } catch (const nlohmann::json::exception &error) {
            line.fail(
                std::string("is not the record of a frame: ") +
                base::printable(std::string(error.what()).substr(std::string(error.what()).find("] ") + 2), 200));
        }
    }
    if (stream.bad())
        throw cannot_be_read();
    if (log.frames.empty())
        throw yaml::Error(file.parent_path().string() + ": contains no complete frame; record the session again");
    return log;
}

} // namespace arhost::session
