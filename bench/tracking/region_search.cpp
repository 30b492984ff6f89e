// SPDX-License-Identifier: Apache-2.0
//
// Time of both trackers on video of 1280×720, by the part of the picture that the markers cover: searching the whole
// frame, and only where the worker expects markers. The bare libraries on the same frames, with the same settings.
#include "bare_detectors.hpp"
#include "solving_tracker.hpp"

#include "command_line/command_line.hpp"

#include <fiducial/clutter.hpp>
#include <fiducial/prints.hpp>
#include <fiducial/rendered_marker.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <deque>
#include <exception>
#include <functional>
#include <limits>
#include <memory>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

namespace {

using namespace arhost;
using test::GreyFrame;

constexpr double side_mm = 100, seconds_per_frame = 1 / 30.0;
constexpr int marker_count = 4;
const cv::Size size(1280, 720);
const arhost_intrinsics camera = test::intrinsics_of(size, 1000, 1000, 639.5, 359.5);

// Four hand-held markers, each in its quarter of the picture, in front of clutter.
class Video {
public:
    Video(double coverage, int frame_count) {
        const double side_px = std::sqrt(coverage * size.area() / marker_count);
        const cv::Mat background = test::clutter(size, 1);
        cv::RNG random(2);
        cv::Mat noise(size, CV_16S);
        for (int i = 0; i < frame_count; ++i) {
            cv::Mat picture = background.clone();
            for (int id = 0; id < marker_count; ++id)
                draw(id, pose(id, i * seconds_per_frame, side_px), picture);
            cv::GaussianBlur(picture, picture, {}, 0.6);
            random.fill(noise, cv::RNG::NORMAL, 0, 1.5);
            cv::add(picture, noise, picture, cv::noArray(), CV_8U);
            frames_.emplace_back(picture, ARHOST_TRANSFER_LINEAR, static_cast<std::uint64_t>(i));
        }
    }
    const std::deque<GreyFrame> &frames() const { return frames_; }

private:
    static test::Mt pose(int id, double seconds, double side_px) {
        const auto wave = [&](double hertz) { return std::sin(2 * CV_PI * (hertz * seconds + 0.23 * id * hertz)); };
        const double distance_mm = camera.fx * side_mm / (side_px * (1 + 0.1 * wave(0.11)));
        const double x_px = (id % 2 == 0 ? -1 : 1) * size.width / 4.0 + 60 * wave(0.31),
                     y_px = (id < 2 ? -1 : 1) * size.height / 4.0 + 25 * wave(0.23);
        return test::pose_of(x_px * distance_mm / camera.fx, y_px * distance_mm / camera.fy, distance_mm,
                             20 * wave(0.17), 20 * wave(0.13), 90 * id + 15 * wave(0.19));
    }
    static void draw(int id, const test::Mt &pose, cv::Mat &picture) {
        constexpr int cell_px = 40;
        const test::Print print = test::april_tag("tag36h11", id).with_margin(1);
        constexpr double black = 30, white = 220; // grey levels of a well exposed print
        cv::Mat texture;
        cv::resize(print.cells, texture, {}, cell_px, cell_px, cv::INTER_NEAREST);
        texture.convertTo(texture, -1, (white - black) / 255, black);
        const double half_mm = side_mm / 2 * print.cells.cols / print.corner_cells;
        const auto last = static_cast<float>(texture.cols) - 0.5F;
        const std::vector<cv::Point2f> from{{-0.5F, -0.5F}, {last, -0.5F}, {last, last}, {-0.5F, last}};
        std::vector<cv::Point2f> to;
        for (const auto &[x, y] : {std::pair(-1, 1), {1, 1}, {1, -1}, {-1, -1}})
            to.emplace_back(test::pixel_of(pose, camera, x * half_mm, y * half_mm));
        // Averages the texture: draws the picture around the print at four times the size.
        const cv::Rect around = (cv::boundingRect(to) + cv::Point(-1, -1) + cv::Size(2, 2)) & cv::Rect({}, size);
        constexpr int samples = 4;
        for (cv::Point2f &corner : to)
            corner =
                (corner - cv::Point2f(around.tl()) + cv::Point2f(0.5F, 0.5F)) * samples - cv::Point2f(0.5F, 0.5F);
        cv::Mat part = picture(around), large;
        cv::resize(part, large, {}, samples, samples, cv::INTER_NEAREST);
        cv::warpPerspective(texture, large, cv::getPerspectiveTransform(from, to), large.size(), cv::INTER_LINEAR,
                            cv::BORDER_TRANSPARENT);
        cv::resize(large, part, part.size(), 0, 0, cv::INTER_AREA);
    }

    std::deque<GreyFrame> frames_;
};

struct Result {
    double ms = 0; // per frame; the shortest time of each frame in three runs
    int found = 0; // markers
};

struct Detected {
    std::chrono::nanoseconds spent;
    std::ptrdiff_t found; // markers
};

using Detector = std::function<Detected(const GreyFrame &)>;

// `make`: return detectors that process the frames of the video from the first one on. They take turns frame by
// frame, and each is the first in some frames, so what else the machine does and what is in its caches affects all of
// them.
std::vector<Result> measure(const Video &video, std::span<const std::function<Detector()>> make) {
    const double infinity = std::numeric_limits<double>::infinity();
    std::vector<Result> results(make.size());
    std::vector<std::vector<double>> ms(make.size(), std::vector<double>(video.frames().size(), infinity));
    for (int repetition = 0; repetition < 3; ++repetition) {
        std::vector<Detector> detectors;
        for (const auto &one : make)
            detectors.push_back(one());
        for (Result &result : results)
            result.found = 0;
        for (std::size_t frame = 0; frame < video.frames().size(); ++frame)
            for (std::size_t turn = 0; turn < detectors.size(); ++turn) {
                const std::size_t i = (frame + static_cast<std::size_t>(repetition) + turn) % detectors.size();
                const Detected detected = detectors[i](video.frames()[frame]);
                ms[i][frame] = std::min(ms[i][frame], 1e-6 * static_cast<double>(detected.spent.count()));
                results[i].found += static_cast<int>(detected.found);
            }
    }
    for (std::size_t i = 0; i < results.size(); ++i)
        results[i].ms = std::accumulate(ms[i].begin(), ms[i].end(), 0.0) / static_cast<double>(ms[i].size());
    return results;
}

bool is_shown(int id) {
    return id < marker_count;
}

template <class Bare> Detector bare(Bare detector) {
    return [detector = std::make_shared<Bare>(std::move(detector))](const GreyFrame &frame) {
        const auto begin = std::chrono::steady_clock::now();
        const bench::Detections found = (*detector)(frame);
        return Detected{std::chrono::steady_clock::now() - begin,
                        std::ranges::count_if(found, [](const auto &tag) { return is_shown(tag.first); })};
    };
}

Detector plugin(const std::string &name, std::uint32_t full_search_every, int listed = marker_count,
                const test::Options &options = {}) {
    auto tracker =
        std::make_shared<bench::SolvingTracker>(name, camera, bench::first_markers(listed, side_mm),
                                                arhost::worker::TargetSolver::Settings{full_search_every}, options);
    return [tracker, capture_ns = std::int64_t{0}](const GreyFrame &frame) mutable {
        const std::chrono::nanoseconds spent = tracker->track(frame, capture_ns);
        capture_ns += std::llround(1e9 * seconds_per_frame);
        return Detected{spent, std::ranges::count_if(tracker->seen(), is_shown, &arhost_observation::id)};
    };
}

} // namespace

int main(int argc, char **argv) try {
    bool is_quick = false;
    arhost::command_line::CommandLine line("Measures the speed of the search for markers in video.");
    line.flag("--quick", is_quick, "Measure with fewer frames; the figures are less precise");
    if (const auto status = line.parse(argc, argv))
        return *status;
    const int frame_count = is_quick ? 30 : 300;
    bool met = true;
    std::printf("search for markers in video of 1280x720, 4 markers, %d frames; speed relative to the bare library\n"
                "%-10s %8s %8s %8s %8s %8s %8s %8s %8s %8s\n",
                frame_count, "tracker", "covered", "bare ms", "whole ms", "region ms", "whole", "regions", "bare",
                "whole", "regions");
    for (const double coverage : {0.005, 0.01, 0.02, 0.05, 0.1, 0.2}) {
        const Video video(coverage, frame_count);
        for (const std::string name : {"tracker_apriltag", "tracker_aruco"}) {
            const bool is_aruco = name == "tracker_aruco";
            const std::array<std::function<Detector()>, 6> make = {
                [&] { return is_aruco ? bare(bench::BareOpenCv(false)) : bare(bench::BareAprilTag()); },
                [&] { return plugin(name, 1); },
                [&] { return plugin(name, 10); },
                [&] { return is_aruco ? bare(bench::BareOpenCv(true)) : bare(bench::BareAprilTag(2)); },
                [&] { return plugin(name, 1, marker_count + 1); },
                [&] {
                    return plugin(name, 1, marker_count, {{"corner_refinement", "none"}});
                }};
            const std::vector<Result> results = measure(video, make);
            const Result &alone = results[0], &whole = results[1], &regions = results[2], &other = results[3],
                         &missed = results[4], &unrefined = results[5];
            const double shown = marker_count * frame_count;
            std::printf("%-10s %6.1f %% %8.2f %8.2f %8.2f %7.2fx %7.2fx %6.1f %% %6.1f %% %6.1f %%\n",
                        name.substr(8).c_str(), 100 * coverage, alone.ms, whole.ms, regions.ms, alone.ms / whole.ms,
                        alone.ms / regions.ms, 100 * alone.found / shown, 100 * whole.found / shown,
                        100 * regions.found / shown);
            std::printf("%-10s %6.1f %% %8.2f %44s %6.1f %%\n", is_aruco ? "subpix" : "decimated", 100 * coverage,
                        other.ms, "", 100 * other.found / shown);
            for (const auto &[row, result] : {std::pair("closer", missed), {"unrefined", unrefined}})
                std::printf("%-10s %6.1f %% %17.2f %16.2fx\n", row, 100 * coverage, result.ms, alone.ms / result.ms);
            std::fflush(stdout);
            met = met && alone.ms / whole.ms >= 0.97 && regions.found >= alone.found &&
                  (coverage > 0.05 || alone.ms / regions.ms >= 4);
        }
    }
    std::printf(
        "columns: markers' part of the picture; time per frame of the bare library, of the tracker that searches "
        "the whole frame, and of the tracker that searches regions; their speeds relative to the bare "
        "library's; markers found by each. decimated: the bare AprilTag library with its default "
        "quad_decimate of 2. subpix: bare OpenCV with its refinement of corners. closer: the whole frame, with a "
        "closer look because a fifth marker is missed. unrefined: the whole frame, with corner_refinement none, as "
        "the bare library. Targets: 0.97 on whole frames; 4 on "
        "regions up to 5 %%, with as many markers\n");
    return met ? 0 : 1;
} catch (const std::exception &error) {
    std::fprintf(stderr, "region-search: %s\n", error.what());
    return 1;
}
