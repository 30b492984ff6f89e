// SPDX-License-Identifier: Apache-2.0
//
// Provides tests and benchmarks of trackers with frames, cameras and the plugin under test.
#pragma once

#include <plugin_under_test.hpp>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <map>
#include <numeric>
#include <stdexcept>
#include <string>
#include <vector>

namespace arhost::test {

inline arhost_intrinsics intrinsics_of(cv::Size size, double fx, double fy, double cx, double cy,
                                       arhost_distortion distortion = ARHOST_DISTORTION_NONE,
                                       const std::vector<double> &coefficients = {}) {
    arhost_intrinsics camera{};
    camera.struct_size = sizeof camera;
    camera.width = static_cast<uint32_t>(size.width);
    camera.height = static_cast<uint32_t>(size.height);
    camera.distortion = distortion;
    camera.fx = fx;
    camera.fy = fy;
    camera.cx = cx;
    camera.cy = cy;
    camera.coefficient_count = static_cast<uint32_t>(coefficients.size());
    std::copy(coefficients.begin(), coefficients.end(), camera.coefficients);
    return camera;
}

// Returns a camera without lens distortion, for tests that check only corners.
inline arhost_intrinsics plain_camera(cv::Size size) {
    return intrinsics_of(size, size.width, size.width, (size.width - 1) / 2.0, (size.height - 1) / 2.0);
}

inline cv::Mat read_grey(const std::filesystem::path &file) {
    cv::Mat grey = cv::imread(file.string(), cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION);
    if (grey.empty())
        throw std::runtime_error("cannot read " + file.string());
    return grey;
}

// A grey frame with padded rows, as a tracker may receive it. Rendered pictures average the codes of their samples,
// so by default the codes are linear light.
class GreyFrame {
public:
    explicit GreyFrame(const cv::Mat &picture, arhost_transfer transfer = ARHOST_TRANSFER_LINEAR,
                       std::uint64_t sequence = 0)
        : sequence_(sequence), format_(layout(picture.size())), slot_(format_.byte_size) {
        format_.transfer = transfer;
        for (int y = 0; y < picture.rows; ++y)
            std::memcpy(slot_.data() + std::size_t{format_.grey_stride} * y, picture.ptr(y), picture.cols);
    }
    const arhost_frame_format &format() const { return format_; }
    arhost_frame frame() const {
        arhost_frame frame{};
        frame.struct_size = sizeof frame;
        frame.clock = ARHOST_CLOCK_MEDIA;
        frame.sequence = sequence_;
        frame.format = &format_;
        frame.plane[0] = frame.grey = slot_.data();
        return frame;
    }
    const GuardedBuffer &slot() const { return slot_; }

private:
    static arhost_frame_format layout(cv::Size size) {
        arhost_frame_format format{};
        format.struct_size = sizeof format;
        format.pixel_format = ARHOST_PIXEL_FORMAT_GREY8;
        format.width = static_cast<uint32_t>(size.width);
        format.height = static_cast<uint32_t>(size.height);
        if (!arhost_frame_layout(&format))
            throw std::runtime_error("the frame size is invalid");
        return format;
    }
    std::uint64_t sequence_;
    arhost_frame_format format_;
    GuardedBuffer slot_;
};

// A target that consists of one marker.
struct Listed {
    int id;
    double side_mm = 100;
    std::string family = "tag36h11";
    std::string file{}; // of a pattern
    double pattern_ratio = 0;
};

// A marker of a family whose prints have no file, at any place in its target.
inline arhost_marker_config marker_config(std::int32_t id, std::uint32_t family = 0, std::uint32_t target = 0) {
    return {.struct_size = sizeof(arhost_marker_config),
            .id = id,
            .family = family,
            .target = target,
            .corners_mm = {},
            .file = nullptr,
            .pattern_ratio = 0};
}

// `marker`: its index in the list.
inline arhost_expected_marker expected_at(std::uint32_t marker, const std::array<cv::Point2d, 4> &corners_px) {
    constexpr double margin_px = 6;
    arhost_expected_marker expected{sizeof expected, marker, {}, margin_px};
    for (std::size_t i = 0; i < 4; ++i) {
        expected.corners_px[i][0] = corners_px[i].x;
        expected.corners_px[i][1] = corners_px[i].y;
    }
    return expected;
}

using Options = std::map<std::string, std::string>;

// A tracker plugin's instance: created in the constructor, destroyed in the destructor.
class Tracker {
public:
    explicit Tracker(const std::string &plugin, const Options &options = {}) : plugin_(plugin) {
        created_ = plugin_.create(options);
    }
    // Starts the tracker; throws if that fails.
    Tracker(const std::string &plugin, const Options &options, const arhost_intrinsics &camera,
            const std::vector<Listed> &listed)
        : Tracker(plugin, options) {
        if (created_ != ARHOST_STATUS_OK || start(camera, listed) != ARHOST_STATUS_OK)
            throw std::runtime_error(log());
    }
    ~Tracker() { stop(); }

    arhost_status created() const { return created_; }
    std::string log() const { return plugin_.log(); }
    arhost_status set(const char *key, const char *text) { return plugin_.set_text(key, text); }

    arhost_status start(const arhost_intrinsics &camera, const std::vector<Listed> &listed) {
        stop();
        std::vector<std::string> names;
        std::vector<arhost_marker_config> markers;
        families_.clear();
        for (const Listed &marker : listed) {
            const auto family = std::ranges::find(families_, marker.family) - families_.begin();
            if (static_cast<std::size_t>(family) == families_.size())
                families_.push_back(marker.family);
            const double h = marker.side_mm / 2;
            markers.push_back({sizeof(arhost_marker_config),
                               marker.id,
                               static_cast<uint32_t>(family),
                               static_cast<uint32_t>(names.size()),
                               {{-h, h, 0}, {h, h, 0}, {h, -h, 0}, {-h, -h, 0}},
                               marker.file.empty() ? nullptr : marker.file.c_str(),
                               marker.pattern_ratio});
            names.push_back(marker.family + "-" + std::to_string(marker.id));
        }
        std::vector<arhost_target_config> targets;
        for (const std::string &name : names)
            targets.push_back(
                {.struct_size = sizeof(arhost_target_config), .reserved = 0, .name = name.c_str(), .body = nullptr});
        std::vector<const char *> families;
        for (const std::string &family : families_)
            families.push_back(family.c_str());
        arhost_frame_format format{};
        format.struct_size = sizeof format;
        format.pixel_format = ARHOST_PIXEL_FORMAT_GREY8;
        format.width = camera.width;
        format.height = camera.height;
        arhost_frame_layout(&format);
        const arhost_tracker_setup setup{sizeof setup,
                                         static_cast<uint32_t>(targets.size()),
                                         &format,
                                         &camera,
                                         targets.data(),
                                         markers.data(),
                                         static_cast<uint32_t>(markers.size()),
                                         static_cast<uint32_t>(families.size()),
                                         families.data()};
        const arhost_status status = functions().start(plugin_.instance(), &setup);
        started_ = status == ARHOST_STATUS_OK;
        return status;
    }
    void stop() {
        if (started_)
            functions().stop(plugin_.instance());
        started_ = false;
    }
    // Searches everywhere.
    std::vector<arhost_observation> track(const GreyFrame &picture) { return track(picture, {}, true); }
    std::vector<arhost_observation>
    track(const GreyFrame &picture, const std::vector<arhost_expected_marker> &expected, bool search_everywhere) {
        arhost_observation empty{};
        empty.struct_size = sizeof empty;
        std::vector<arhost_observation> observations(ARHOST_MAX_OBSERVATIONS, empty);
        arhost_tracker_result result{.struct_size = sizeof result,
                                     .observation_count = 0,
                                     .observations = observations.data(),
                                     .poses = nullptr,
                                     .pose_count = 0,
                                     .candidate_count = -1};
        const arhost_frame frame = picture.frame();
        const arhost_track_request request{.struct_size = sizeof request,
                                           .search_everywhere = search_everywhere,
                                           .frame = &frame,
                                           .state_before = nullptr,
                                           .state_after = nullptr,
                                           .state_size = 0,
                                           .expected = expected.data(),
                                           .expected_count = static_cast<uint32_t>(expected.size()),
                                           .reserved = 0};
        if (functions().track(plugin_.instance(), &request, &result) != ARHOST_STATUS_OK)
            throw std::runtime_error("track failed: " + log());
        observations.resize(result.observation_count);
        candidate_count_ = result.candidate_count;
        return observations;
    }
    // arhost_tracker_result.candidate_count of the last frame.
    int candidate_count() const { return candidate_count_; }
    // The name under which the family of an observation was listed.
    const std::string &family(const arhost_observation &seen) const { return families_.at(seen.family); }

private:
    const arhost_tracker &functions() const { return plugin_.functions<arhost_tracker>(); }
    PluginUnderTest plugin_;
    std::vector<std::string> families_;
    arhost_status created_ = ARHOST_STATUS_ERROR_INTERNAL;
    bool started_ = false;
    int candidate_count_ = -1;
};

inline double percentile(std::vector<double> values, double fraction) {
    if (values.empty())
        throw std::runtime_error("no values");
    const auto nth = values.begin() + static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), nth, values.end());
    return *nth;
}

inline double mean(const std::vector<double> &values) {
    return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

inline double corner_distance_px(const arhost_observation &seen, int corner, cv::Point2d expected) {
    return std::hypot(seen.corners_px[corner][0] - expected.x, seen.corners_px[corner][1] - expected.y);
}
inline double greatest_distance_px(const arhost_observation &seen, const std::array<cv::Point2d, 4> &expected) {
    double greatest_px = 0;
    for (int corner = 0; corner < 4; ++corner)
        greatest_px = std::max(greatest_px, corner_distance_px(seen, corner, expected[corner]));
    return greatest_px;
}

} // namespace arhost::test
