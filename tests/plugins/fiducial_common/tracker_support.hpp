// SPDX-License-Identifier: Apache-2.0
//
// Provides tests and benchmarks of trackers with frames, cameras and the plugin under test.
#pragma once

#include <plugin_under_test.hpp>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include <algorithm>
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

// A grey frame with padded rows, as a tracker may receive it.
class GreyFrame {
public:
    explicit GreyFrame(const cv::Mat &picture) : format_(layout(picture.size())), slot_(format_.byte_size) {
        for (int y = 0; y < picture.rows; ++y)
            std::memcpy(slot_.data() + std::size_t{format_.grey_stride} * y, picture.ptr(y), picture.cols);
    }
    const arhost_frame_format &format() const { return format_; }
    arhost_frame frame() const {
        arhost_frame frame{};
        frame.struct_size = sizeof frame;
        frame.clock = ARHOST_CLOCK_MEDIA;
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
    arhost_frame_format format_;
    GuardedBuffer slot_;
};

struct Listed {
    int id;
    double side_mm = 100;
};

using Options = std::map<std::string, std::string>;

// A tracker plugin's instance: created in the constructor, destroyed in the destructor.
class Tracker {
public:
    explicit Tracker(const std::string &plugin, const Options &options = {}) : plugin_(plugin) {
        created_ = plugin_.create(options);
    }
    ~Tracker() { stop(); }

    arhost_status created() const { return created_; }
    std::string log() const { return plugin_.log(); }
    arhost_status set(const char *key, const char *text) { return plugin_.set_text(key, text); }

    arhost_status start(const arhost_intrinsics &camera, const std::vector<Listed> &listed) {
        stop();
        std::vector<arhost_marker_config> markers;
        for (const Listed &marker : listed)
            markers.push_back({sizeof(arhost_marker_config), marker.id, marker.side_mm});
        arhost_frame_format format{};
        format.struct_size = sizeof format;
        format.pixel_format = ARHOST_PIXEL_FORMAT_GREY8;
        format.width = camera.width;
        format.height = camera.height;
        arhost_frame_layout(&format);
        const arhost_tracker_setup setup{sizeof setup, static_cast<uint32_t>(markers.size()), &format, &camera,
                                         markers.data()};
        const arhost_status status = functions().start(plugin_.instance(), &setup);
        started_ = status == ARHOST_STATUS_OK;
        return status;
    }
    void stop() {
        if (started_)
            functions().stop(plugin_.instance());
        started_ = false;
    }
    std::vector<arhost_marker> track(const GreyFrame &picture) {
        auto result = std::make_unique<arhost_tracker_result>();
        result->struct_size = sizeof *result;
        const arhost_frame frame = picture.frame();
        const arhost_track_request request{sizeof request, 0, &frame, nullptr, nullptr, 0};
        if (functions().track(plugin_.instance(), &request, result.get()) != ARHOST_STATUS_OK)
            throw std::runtime_error("track failed: " + log());
        return {result->markers, result->markers + result->marker_count};
    }

private:
    const arhost_tracker &functions() const { return plugin_.functions<arhost_tracker>(); }
    PluginUnderTest plugin_;
    arhost_status created_ = ARHOST_STATUS_ERROR_INTERNAL;
    bool started_ = false;
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

inline double corner_distance_px(const arhost_marker &marker, int corner, cv::Point2d expected) {
    return std::hypot(marker.corners_px[corner][0] - expected.x, marker.corners_px[corner][1] - expected.y);
}

} // namespace arhost::test
