// SPDX-License-Identifier: Apache-2.0
//
// Measures a tracker's accuracy on a real sequence with known poses (../shared/data/markers/rbt_sequence).
#pragma once

#include "solved_pose.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <fstream>

namespace arhost::test {

class RbtSequence {
public:
    static constexpr double side_mm = 95.5;

    using Frames =
        std::vector<std::map<int, arhost_observation>>; // for each frame, the markers that the tracker found, by id

    RbtSequence() {
        const auto folder = shared_data("markers/rbt_sequence");
        truth_ = nlohmann::json::parse(std::ifstream(folder / "apriltag_data.json"));
        for (std::size_t k = 0; k < truth_["grid"].size(); ++k) {
            char name[48];
            std::snprintf(name, sizeof name, "color_image_%04zu.png", k);
            frames_.emplace_back(read_grey(folder / name), ARHOST_TRANSFER_SRGB);
            for (const auto &[id, detection] : truth_["detections"][k].items())
                ids_.push_back(std::stoi(id));
        }
        std::sort(ids_.begin(), ids_.end());
        ids_.erase(std::unique(ids_.begin(), ids_.end()), ids_.end());
    }

    // Runs the tracker on the sequence. Appends the tracking time of each frame, in ms, to `ms` if it is not null.
    Frames run(Tracker &tracker, std::vector<double> *ms = nullptr) const {
        std::vector<Listed> listed;
        for (int id : ids_)
            listed.push_back({id, side_mm});
        if (tracker.start(camera(), listed) != ARHOST_STATUS_OK)
            throw std::runtime_error("start failed: " + tracker.log());
        Frames frames;
        for (const GreyFrame &frame : frames_) {
            const auto begin = std::chrono::steady_clock::now();
            const auto markers = tracker.track(frame);
            const std::chrono::duration<double, std::milli> taken = std::chrono::steady_clock::now() - begin;
            if (ms)
                ms->push_back(taken.count());
            frames.emplace_back();
            for (const arhost_observation &marker : markers)
                frames.back()[marker.id] = marker;
        }
        return frames;
    }

    struct Accuracy {
        int listed = 0, found = 0;     // tags in the reference; number of these that the tracker found
        std::vector<double> corner_px; // distance of each corner from the reference
        std::vector<double> distance;  // relative error of each tag's distance from the camera
        double found_fraction() const { return static_cast<double>(found) / listed; }
    };
    Accuracy accuracy(const Frames &frames) const {
        Accuracy result;
        for (std::size_t k = 0; k < frames.size(); ++k)
            for (const auto &[name, reference] : truth_["detections"][k].items()) {
                ++result.listed;
                const int id = std::stoi(name);
                const auto marker = frames[k].find(id);
                if (marker == frames[k].end())
                    continue;
                ++result.found;
                // The reference lists the corners counter-clockwise from the bottom left, each as row and column;
                // its pixel centres are at +0.5.
                for (int corner = 0; corner < 4; ++corner) {
                    const auto &at = reference["tag_corners"][3 - corner];
                    result.corner_px.push_back(corner_distance_px(
                        marker->second, corner, {at[1].get<double>() - 0.5, at[0].get<double>() - 0.5}));
                }
                const Mt mt = solved_pose(marker->second, camera(), side_mm).value().mt;
                const double expected_mm = distance_mm(truth_["grid"][k], id);
                result.distance.push_back(std::abs(std::hypot(mt[12], mt[13], mt[14]) / expected_mm - 1));
            }
        return result;
    }

    // Returns the distances, in px, between the corners in `a` and `b` of each marker that both trackers found.
    static std::vector<double> disagreement_px(const Frames &a, const Frames &b) {
        std::vector<double> distances;
        for (std::size_t k = 0; k < a.size(); ++k)
            for (const auto &[id, marker] : a[k])
                if (const auto other = b[k].find(id); other != b[k].end())
                    for (int corner = 0; corner < 4; ++corner)
                        distances.push_back(corner_distance_px(
                            marker, corner,
                            {other->second.corners_px[corner][0], other->second.corners_px[corner][1]}));
        return distances;
    }

    static arhost_intrinsics camera() { // from the sequence's cam.json; the images are already undistorted
        return intrinsics_of({640, 480}, 607.178466796875, 607.2342529296875, 321.39129638671875, 241.91822814941406);
    }
    const std::vector<GreyFrame> &frames() const { return frames_; }
    const std::vector<int> &ids() const { return ids_; }
    // The reference pose of the board, as rows of [rotation | translation in metres] in OpenCV's camera axes.
    const nlohmann::json &camera_from_board(std::size_t frame) const { return truth_["grid"][frame]; }

    // The corners of a tag on the board, in the ABI's order; z points out of the paper. See ../shared/data/README.md
    // for the board's layout. On the board, the tags' y axes point along −x.
    static std::array<cv::Point2d, 4> on_board_mm(int id) {
        const double x = 120.0 * (id / 4), y = 120.0 * (id % 4);
        return {{{x, y}, {x, y + side_mm}, {x + side_mm, y + side_mm}, {x + side_mm, y}}};
    }

private:
    // Returns the distance from the camera to a tag's centre. See ../shared/data/README.md for the board's layout.
    static double distance_mm(const nlohmann::json &camera_from_board, int id) {
        const double x = 47.75 + 120.0 * (id / 4), y = 47.75 + 120.0 * (id % 4);
        std::array<double, 3> centre;
        for (int row = 0; row < 3; ++row) {
            const auto &r = camera_from_board[row];
            centre[row] = r[0].get<double>() * x + r[1].get<double>() * y + 1000 * r[3].get<double>();
        }
        return std::hypot(centre[0], centre[1], centre[2]);
    }

    nlohmann::json truth_;
    std::vector<GreyFrame> frames_;
    std::vector<int> ids_;
};

} // namespace arhost::test
