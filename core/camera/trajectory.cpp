// SPDX-License-Identifier: Apache-2.0
#include "camera/trajectory.hpp"

#include "camera/calibration.hpp"

#include <glm/geometric.hpp>
#include <glm/gtc/type_ptr.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>

namespace arhost::camera {
namespace {

using Json = nlohmann::json;

constexpr double dissertation_fps = 30; // frame rate of the camera used in the dissertation

// A line of a trajectory file and its position.
struct Line {
    const std::filesystem::path &file;
    std::size_t number; // counts from 1
    std::string_view text;
    bool ended; // the line has a line end; if not, the file may be truncated in this line

    [[noreturn]] void fail(std::size_t column, const std::string &message) const {
        throw yaml::Error(file.string() + ":" + std::to_string(number) + ":" + std::to_string(column) + ": " +
                          message);
    }
    std::string truncation_warning() const {
        return file.string() + ":" + std::to_string(number) + ": the last line is truncated and was ignored";
    }
};

std::vector<Line> lines_of(const std::filesystem::path &file, std::string_view text) {
    std::vector<Line> lines;
    while (!text.empty()) {
        const std::size_t end = text.find('\n');
        std::string_view line = text.substr(0, end);
        text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
        if (line.ends_with('\r'))
            line.remove_suffix(1);
        lines.push_back({file, lines.size() + 1, line, end != std::string_view::npos});
    }
    return lines;
}

// ---- arhost's format -------------------------------------------------------------------------------

// A member of the JSON object in a line. Error messages contain the position of the member.
class Member {
public:
    Member(const Line &line, const Json &object, const char *key) : line_(line), key_(key) {
        const auto found = object.find(key);
        if (found == object.end())
            line.fail(1, std::string("the key '") + key + "' is missing");
        value_ = &*found;
    }
    [[noreturn]] void fail(const std::string &message) const {
        const std::size_t at = line_.text.find("\"" + std::string(key_) + "\"");
        line_.fail(at == std::string_view::npos ? 1 : at + 1, std::string(key_) + ": " + message);
    }
    bool is_null() const { return value_->is_null(); }
    std::int64_t integer() const {
        if (value_->is_structured()) // not printed, because dump() would recurse without limit
            fail("must be a whole number");
        if (!value_->is_number_integer() ||
            (value_->is_number_unsigned() && value_->get<std::uint64_t>() > std::uint64_t(INT64_MAX)))
            fail("must be a whole number, but is " + value_->dump(-1, ' ', false, Json::error_handler_t::replace));
        return value_->get<std::int64_t>();
    }
    void read(double (&to)[3]) const {
        if (!value_->is_array() || value_->size() != 3 ||
            !std::ranges::all_of(*value_, [](const Json &number) { return number.is_number(); }))
            fail("must be three numbers, or null in a frame without a camera");
        for (std::size_t i = 0; i < 3; ++i)
            to[i] = (*value_)[i].get<double>();
    }

private:
    const Line &line_;
    const char *key_;
    const Json *value_;
};

TrajectoryFrame frame_of(const Line &line, const Json &object) {
    if (!object.is_object())
        line.fail(1, "must be an object: {\"frame\": …, \"capture_ns\": …, \"eye\": …, \"look_at\": …, \"up\": …}");
    const Member number(line, object, "frame"), eye(line, object, "eye");
    TrajectoryFrame frame{};
    if (number.integer() < 0)
        number.fail("must be at least 0");
    frame.frame = static_cast<std::uint64_t>(number.integer());
    frame.capture_ns = Member(line, object, "capture_ns").integer();
    if (eye.is_null())
        return frame;
    View view{};
    eye.read(view.eye_mm);
    Member(line, object, "look_at").read(view.look_at_mm);
    Member(line, object, "up").read(view.up);
    if (const std::string problem = problem_with(view); !problem.empty())
        eye.fail(problem);
    frame.view = view;
    return frame;
}

// Reads the header with the YAML parser (JSON is valid YAML), so that the camera is read and its errors are reported
// as in a configuration.
void read_header(Trajectory &to, const Line &line) {
    const yaml::Node header = yaml::Node::parse(std::string(line.text), line.file.string());
    header.require("format").choice({"arhost-trajectory"});
    if (const yaml::Node version = header.require("version"); version.integer() != 1)
        version.fail("must be 1, the only version that this arhost can read");
    header.require("unit").choice({"mm"});
    to.clock = header.require("clock").choice({"media", "monotonic"}) == "media" ? ARHOST_CLOCK_MEDIA
                                                                                 : ARHOST_CLOCK_MONOTONIC;
    to.fps = header.require("fps").real(0, 1e6);
    to.intrinsics = parse_camera(header.require("camera"));
}

Trajectory read_arhost(const std::vector<Line> &lines) {
    Trajectory trajectory;
    if (!lines.front().ended)
        lines.front().fail(lines.front().text.size() + 1,
                           "the first line is truncated, and the file contains no frame");
    read_header(trajectory, lines.front());
    for (const Line &line : std::span(lines).subspan(1)) {
        Json object;
        try {
            object = Json::parse(line.text);
        } catch (const Json::exception &error) {
            if (!line.ended) {
                trajectory.warning = line.truncation_warning();
                break;
            }
            const auto *syntax = dynamic_cast<const Json::parse_error *>(&error);
            line.fail(syntax ? std::max<std::size_t>(syntax->byte, 1) : 1,
                      "is not valid JSON; delete the line or record the run again");
        }
        const TrajectoryFrame frame = frame_of(line, object);
        if (!trajectory.frames.empty()) {
            const TrajectoryFrame &before = trajectory.frames.back();
            if (frame.frame <= before.frame)
                Member(line, object, "frame")
                    .fail("must be greater than the frame number of the previous line, " +
                          std::to_string(before.frame));
            if (frame.capture_ns < before.capture_ns)
                Member(line, object, "capture_ns")
                    .fail("must not be less than the capture time in the previous line");
        }
        trajectory.frames.push_back(frame);
    }
    return trajectory;
}

// ---- the dissertation's format ----------------------------------------------------------------------------

// Returns the numbers of a line; empty if the line has none.
std::vector<double> numbers_of(const Line &line) {
    std::vector<double> numbers;
    const char *const begin = line.text.data(), *const end = begin + line.text.size();
    const auto is_space = [](char c) { return c == ' ' || c == '\t'; };
    for (const char *at = std::find_if_not(begin, end, is_space); at != end;
         at = std::find_if_not(at, end, is_space)) {
        const char *const word_end = std::find_if(at, end, is_space);
        const auto column = static_cast<std::size_t>(at - begin) + 1;
        double number = 0;
        const auto [stopped, error] = std::from_chars(at, word_end, number);
        if (error != std::errc() || stopped != word_end || !std::isfinite(number)) {
            if (!line.ended && word_end == end) // the line ends in a truncated number such as "-" or "1e"
                return {};
            line.fail(column, "'" + std::string(at, std::min<std::ptrdiff_t>(word_end - at, 30) + at) +
                                  "' is not a number; a line has nine (eye, look_at, up), or none for a frame "
                                  "without a camera");
        }
        if (numbers.size() == 9)
            line.fail(column, "the line has more than nine numbers (three each for eye, look_at and up)");
        numbers.push_back(number);
        at = word_end;
    }
    return numbers;
}

Trajectory read_dissertation(const std::vector<Line> &lines) {
    Trajectory trajectory;
    trajectory.fps = dissertation_fps;
    for (const Line &line : lines) {
        const std::vector<double> numbers = numbers_of(line);
        // If no blank follows the ninth number, its last digits may be missing.
        if (!line.ended && (numbers.size() < 9 || !(line.text.ends_with(' ') || line.text.ends_with('\t')))) {
            trajectory.warning = line.truncation_warning();
            break;
        }
        const std::uint64_t number = line.number - 1;
        TrajectoryFrame frame{number, std::llround(static_cast<double>(number) * 1e9 / dissertation_fps), {}};
        if (numbers.size() == 9) {
            View view{};
            std::copy_n(numbers.begin(), 3, view.eye_mm);
            std::copy_n(numbers.begin() + 3, 3, view.look_at_mm);
            std::copy_n(numbers.begin() + 6, 3, view.up);
            if (const std::string problem = problem_with(view); !problem.empty())
                line.fail(1, problem);
            frame.view = view;
        } else if (!numbers.empty()) {
            line.fail(line.text.size() + 1,
                      "the line has " + std::to_string(numbers.size()) + " numbers; eye, look_at and up need nine");
        }
        trajectory.frames.push_back(frame);
    }
    return trajectory;
}

} // namespace

std::string problem_with(const View &view) {
    const glm::dvec3 eye = glm::make_vec3(view.eye_mm), up = glm::make_vec3(view.up);
    const glm::dvec3 backwards = eye - glm::make_vec3(view.look_at_mm);
    if (!(glm::length(backwards) > 0))
        return "look_at must differ from eye";
    constexpr double limit_mm = 1e9; // the same limit as for scenes
    for (const double number : {eye.x, eye.y, eye.z, view.look_at_mm[0], view.look_at_mm[1], view.look_at_mm[2]})
        if (!(std::abs(number) <= limit_mm))
            return "the coordinates of eye and look_at must be between -1e9 and 1e9 mm";
    if (!(glm::length(glm::cross(up, backwards)) > 1e-9 * glm::length(up) * glm::length(backwards)))
        return "up must not be 0 or parallel to the line of sight";
    return "";
}

const TrajectoryFrame *Trajectory::at_or_after(std::uint64_t frame) const {
    const auto found = std::ranges::lower_bound(frames, frame, {}, &TrajectoryFrame::frame);
    return found == frames.end() ? nullptr : &*found;
}

Trajectory read_trajectory(const std::filesystem::path &file) {
    std::error_code ignored;
    if (std::filesystem::exists(file, ignored) && !std::filesystem::is_regular_file(file, ignored))
        throw yaml::Error(file.string() + ": is not a regular file");
    errno = 0;
    std::ifstream stream(file, std::ios::binary);
    const std::string text{std::istreambuf_iterator<char>(stream), {}};
    if (!stream)
        throw yaml::Error(file.string() + ": cannot be read: " + std::strerror(errno ? errno : EIO));
    const std::vector<Line> lines = lines_of(file, text);
    Trajectory trajectory = text.starts_with('{') ? read_arhost(lines) : read_dissertation(lines);
    if (trajectory.frames.empty())
        throw yaml::Error(file.string() +
                          ": contains no frames; record one with sink_trajectory (docs/trajectories.md)");
    return trajectory;
}

arhost_camera camera_of(const View &view, const arhost_intrinsics &intrinsics) {
    arhost_camera camera{};
    camera.struct_size = sizeof camera;
    std::ranges::copy(view.eye_mm, camera.eye);
    std::ranges::copy(view.look_at_mm, camera.look_at);
    std::ranges::copy(view.up, camera.up);
    camera.intrinsics = intrinsics;
    return camera;
}

} // namespace arhost::camera
