// SPDX-License-Identifier: Apache-2.0
//
// Jitter of a corner of a marker at rest: as the bare libraries report it, and of the pose, without and with the
// filter.
#include "bare_detectors.hpp"
#include "solving_tracker.hpp"

#include "command_line/command_line.hpp"

#include <fiducial/prints.hpp>
#include <fiducial/rendered_marker.hpp>

#include <cstdio>
#include <deque>
#include <exception>

namespace {

using namespace arhost;
using test::GreyFrame;

constexpr double side_mm = 100;
constexpr std::int64_t frame_ns = 33'333'333;
const cv::Size size(640, 480);
const arhost_intrinsics camera = test::intrinsics_of(size, 600, 600, 319.5, 239.5);

// Tag 0 at rest, tilted, with blur and other noise in each frame.
std::deque<GreyFrame> frames_of(double side_px, int count) {
    const test::Mt pose = test::pose_of(20, 10, camera.fx * side_mm / side_px, 25, 20, 10);
    cv::Mat picture = test::render(camera, {{test::april_tag("tag36h11", 0).with_margin(1), side_mm, pose}});
    cv::GaussianBlur(picture, picture, {}, 0.6);
    std::deque<GreyFrame> frames;
    for (int i = 0; i < count; ++i) {
        cv::Mat noisy = picture.clone();
        test::add_noise(noisy, 2, static_cast<std::uint64_t>(i) + 1);
        frames.emplace_back(noisy);
    }
    return frames;
}

// RMS deviation from the mean, px. The filter has settled after the first frames.
double jitter_px(const std::vector<cv::Point2d> &corners) {
    const auto settled = std::span(corners).subspan(corners.size() / 10);
    cv::Point2d mean;
    for (const cv::Point2d &corner : settled)
        mean += corner / static_cast<double>(settled.size());
    double sum = 0;
    for (const cv::Point2d &corner : settled)
        sum += (corner - mean).dot(corner - mean) / static_cast<double>(settled.size());
    return std::sqrt(sum);
}

template <class Detector> double with_bare(const std::deque<GreyFrame> &frames, const Detector &detect) {
    std::vector<cv::Point2d> corners;
    for (const GreyFrame &frame : frames)
        if (const auto found = detect(frame); found.contains(0))
            corners.push_back(found.at(0)[0]);
    return jitter_px(corners);
}

double with_plugin(const std::deque<GreyFrame> &frames, const std::string &plugin, bool smooth) {
    bench::SolvingTracker tracker(plugin, camera, bench::first_markers(1, side_mm),
                                  {bench::default_full_search_every, smooth});
    std::vector<cv::Point2d> corners;
    std::int64_t capture_ns = 0;
    for (const GreyFrame &frame : frames) {
        tracker.track(frame, capture_ns += frame_ns);
        if (const arhost_target &target = tracker.targets().front(); target.state == ARHOST_TARGET_DETECTED)
            corners.push_back(test::corners_of(std::to_array(target.mt), camera, side_mm)[0]);
    }
    return jitter_px(corners);
}

} // namespace

int main(int argc, char **argv) try {
    bool is_quick = false;
    arhost::command_line::CommandLine line("Measures the jitter of a resting marker.");
    line.flag("--quick", is_quick, "Measure with fewer frames; the figures are less precise");
    if (const auto status = line.parse(argc, argv))
        return *status;
    const int count = is_quick ? 60 : 600;
    std::printf(
        "jitter of a corner of a resting marker, RMS in px, %d frames with noise of 2 grey levels: detected by "
        "the bare library (OpenCV: subpix), and projected with the pose of the tracker\n"
        "%-10s %8s %8s %8s %9s %8s\n",
        count, "tracker", "side, px", "bare", "pose", "filtered", "ratio");
    bool met = true;
    for (const double side_px : {30.0, 60.0, 120.0, 200.0}) {
        const std::deque<GreyFrame> frames = frames_of(side_px, count);
        for (const std::string plugin : {"tracker_apriltag", "tracker_aruco"}) {
            const double bare = plugin == "tracker_aruco" ? with_bare(frames, bench::BareOpenCv(true))
                                                          : with_bare(frames, bench::BareAprilTag()),
                         pose = with_plugin(frames, plugin, false), filtered = with_plugin(frames, plugin, true);
            std::printf("%-10s %8.0f %8.4f %8.4f %9.4f %8.2f\n", plugin.substr(8).c_str(), side_px, bare, pose,
                        filtered, filtered / bare);
            met = met && filtered <= 0.5 * bare;
        }
    }
    std::printf("target: filtered at most half of bare\n");
    return met ? 0 : 1;
} catch (const std::exception &error) {
    std::fprintf(stderr, "still-marker: %s\n", error.what());
    return 1;
}
