// SPDX-License-Identifier: Apache-2.0
//
// Single markers on exactly known continuous motions, with Gaussian corner noise: flips, errors relative to the
// Cramér–Rao bound, coverage of the covariance, cost, delay of the filter. OpenCV's IPPE on the same corners for
// comparison.
#include "pose/smoothing.hpp"
#include "pose/track.hpp"

#include "cramer_rao.hpp"
#include "simulated_markers.hpp"

#include <opencv2/calib3d.hpp>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <limits>
#include <optional>

namespace {

using namespace arhost::pose;
using arhost::bench::cramer_rao;

constexpr double side_mm = 80, focal_px = 900;
constexpr double chi2_6_95 = 12.59; // 95 % quantile of the chi-squared distribution with 6 degrees of freedom

// A hand-held motion at about this size in the image.
Rigid at_size(double seconds, double phase, double side_px) {
    const auto wave = [&](double hertz, double offset) {
        return std::sin(2 * std::numbers::pi * hertz * seconds + offset + phase);
    };
    const double distance_mm = focal_px * side_mm / (side_px * (1 + 0.1 * wave(0.11, 0)));
    return {rotation_by({0.9 * wave(0.31, 1), 0, 0}) * rotation_by({0, 0.9 * wave(0.23, 2), 0}) *
                pose_at({0, 0, 0}, 0, 0, 100 * wave(0.07, 3)).rotation,
            {0.3 * distance_mm * wave(0.13, 4), 0.2 * distance_mm * wave(0.17, 5), distance_mm}};
}

double percentile(std::vector<double> values, double fraction) {
    const auto nth = values.begin() + static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), nth, values.end());
    return *nth;
}

// The rotation of the pose that OpenCV prefers.
Eigen::Matrix3d opencv_rotation(const ObservedMarker &marker, const arhost_intrinsics &in) {
    std::vector<cv::Point3d> object;
    std::vector<cv::Point2d> image;
    for (int i = 0; i < 4; ++i) {
        object.emplace_back(marker.corners_on_target_mm[i].x(), marker.corners_on_target_mm[i].y(), 0);
        image.emplace_back(marker.corners_px[i].x(), marker.corners_px[i].y());
    }
    cv::Vec3d r, t;
    cv::solvePnP(object, image, cv::Matx33d(in.fx, 0, in.cx, 0, in.fy, in.cy, 0, 0, 1), cv::noArray(), r, t, false,
                 cv::SOLVEPNP_IPPE_SQUARE);
    return rotation_by({r[0], r[1], r[2]});
}

struct Cell {
    int flips = 0, opencv_flips = 0, wrong_first = 0, covered = 0, counted = 0;
    std::vector<double> rotation_share, translation_share; // errors relative to the standard deviation of the bound
    std::vector<double> lag_frames;                        // of the filter, where a corner moves by more than 1 px
    double us = 0;
};

// How many frames ago a corner was where the filtered pose shows it; nullopt if it hardly moves, because noise then
// decides.
template <class Truth>
std::optional<double> lag_of(const Rigid &filtered, double frame, const Truth &truth, const Projection &projection) {
    const auto corner = [&](const Rigid &pose) { return *projection.pixel(pose * square_corners_mm(side_mm)[1]); };
    if ((corner(truth(frame)) - corner(truth(frame - 1))).norm() <= 1)
        return std::nullopt;
    double nearest_px = std::numeric_limits<double>::infinity(), lag = 0;
    for (int tenths = 0; tenths <= 50; ++tenths)
        if (const double px = (corner(filtered) - corner(truth(frame - tenths / 10.0))).norm(); px < nearest_px) {
            nearest_px = px;
            lag = tenths / 10.0;
        }
    return lag;
}

Cell run(double side_px, double noise_px, int frames) {
    const arhost_intrinsics in{sizeof in, 1280, 720, ARHOST_DISTORTION_NONE, focal_px, focal_px, 639.5, 359.5, 0,
                               0,         {},   {}};
    Cell cell;
    constexpr int frames_per_run = 1000;
    std::chrono::nanoseconds spent{};
    for (int start = 0; start < frames; start += frames_per_run) {
        Camera camera(in, static_cast<std::uint32_t>(start + 1));
        Track track{};
        Smoothing smoothing{};
        const auto truth_at = [&](double frame) { return at_size(frame / 30.0, 0.0007 * start, side_px); };
        bool was_right = false, opencv_was_right = false;
        for (int frame = 0; frame < frames_per_run; ++frame) {
            const Rigid truth = truth_at(frame);
            const ObservedMarker marker = camera.observe(truth, square_corners_mm(side_mm), noise_px);
            const auto begin = std::chrono::steady_clock::now();
            const auto poses = estimate_poses({&marker, 1}, camera.projection());
            if (poses.empty())
                continue;
            const Step step = next_step(track, poses, std::int64_t{frame} * 33'333'333);
            spent += std::chrono::steady_clock::now() - begin;
            track = step.track;
            const Estimate &found = poses[step.chosen];
            const Rigid filtered = smoothed(smoothing, found, std::int64_t{frame} * 33'333'333);
            const bool right = degrees_between(found.camera_from_target, truth) < 20;
            const bool opencv_right = angle_between_rad(opencv_rotation(marker, camera.projection().intrinsics()),
                                                        truth.rotation) < 20 * radians;
            cell.flips += was_right && !right;
            cell.opencv_flips += opencv_was_right && !opencv_right;
            cell.wrong_first += frame == 0 && !right;
            was_right = right;
            opencv_was_right = opencv_right;
            if (!right)
                continue;
            if (const auto lag = lag_of(filtered, frame, truth_at, camera.projection()))
                cell.lag_frames.push_back(*lag);
            const Matrix6d bound = cramer_rao(truth, camera.projection(), side_mm, noise_px);
            Eigen::Matrix<double, 6, 1> error;
            error << truth.translation_mm - found.camera_from_target.translation_mm,
                rotation_vector(truth.rotation * found.camera_from_target.rotation.transpose());
            ++cell.counted;
            cell.covered += error.dot(found.covariance.ldlt().solve(error)) < chi2_6_95;
            cell.translation_share.push_back(error.head<3>().norm() / std::sqrt(bound.topLeftCorner<3, 3>().trace()));
            cell.rotation_share.push_back(error.tail<3>().norm() /
                                          std::sqrt(bound.bottomRightCorner<3, 3>().trace()));
        }
    }
    cell.us = 1e-3 * static_cast<double>(spent.count()) / frames;
    return cell;
}

} // namespace

int main(int argc, char **argv) {
    const bool quick = argc > 1 && std::string(argv[1]) == "--quick";
    const int frames = quick ? 1000 : 10'000;
    std::printf(
        "single markers in continuous motion, corner noise 0.1 px, %d frames per size; errors relative to the "
        "Cramer-Rao bound\n%8s %8s %10s %8s %12s %8s %12s %8s %10s %8s %10s\n",
        frames, "side, px", "flips", "OpenCV's", "wrong 1st", "rotation p50", "p99", "translat. p50", "p99",
        "covered", "us", "lag p95");
    bool met = true;
    for (const double side_px : {15.0, 20.0, 25.0, 35.0, 50.0, 80.0, 120.0, 200.0}) {
        const Cell cell = run(side_px, 0.1, frames);
        const double covered = 100.0 * cell.covered / cell.counted;
        std::printf("%8.0f %8d %10d %8d %12.2f %8.2f %12.2f %8.2f %9.1f%% %8.1f %10.1f\n", side_px, cell.flips,
                    cell.opencv_flips, cell.wrong_first, percentile(cell.rotation_share, 0.5),
                    percentile(cell.rotation_share, 0.99), percentile(cell.translation_share, 0.5),
                    percentile(cell.translation_share, 0.99), covered, cell.us, percentile(cell.lag_frames, 0.95));
        met = met && percentile(cell.lag_frames, 0.95) <= 1;
        if (side_px >= 25)
            met = met && cell.flips == 0 && covered >= 90 && covered <= 98;
    }
    return met ? 0 : 1;
}
