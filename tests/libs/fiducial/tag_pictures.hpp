// SPDX-License-Identifier: Apache-2.0
//
// Pictures of many tags (tag36h11) of one size at known random poses, with blur, noise and low exposure, and what a
// tracker finds in them. They are the same in every run.
#pragma once

#include "prints.hpp"

#include <algorithm>
#include <numbers>
#include <random>

namespace arhost::test {

struct Conditions {
    const char *name;
    double side_px;       // of a tag that faces the camera
    double motion_px = 0; // length of a motion blur; in addition, the lens blurs with a standard deviation of 0.6 px
    double exposure = 1;
    double noise = 1.5; // standard deviation, grey levels
};

class TagPictures {
public:
    struct Outcome {
        int found = 0, wrong = 0;      // wrong: the corners have a pose that is rotated by more than 20°, or none
        std::vector<double> corner_px; // of each tag that was found: the greatest distance of a corner
    };

    // `tags` is rounded up to full pictures.
    TagPictures(const Conditions &conditions, int tags) {
        const double distance_mm = camera_.fx * side_mm / conditions.side_px;
        const double pitch_px = 1.9 * conditions.side_px + 4 + 2 * conditions.motion_px;
        const int columns = static_cast<int>(camera_.width / pitch_px),
                  rows = std::min(static_cast<int>(camera_.height / pitch_px), 64 / columns);
        std::mt19937 generator(1);
        std::uniform_real_distribution<double> tilt(-45, 45), turn(-180, 180), shift(-0.5, 0.5);
        for (std::uint64_t seed = 1; shown_ < tags; ++seed) {
            std::vector<Placed> placed;
            for (int i = 0; i < columns * rows; ++i) {
                const double x_px = (i % columns + 0.5) * pitch_px + shift(generator),
                             y_px = (i / columns + 0.5) * pitch_px + shift(generator);
                const double about_x = tilt(generator), about_y = tilt(generator), about_z = turn(generator);
                placed.push_back({april_tag("tag36h11", i).with_margin(1), side_mm,
                                  pose_of((x_px - camera_.cx) / camera_.fx * distance_mm,
                                          -(y_px - camera_.cy) / camera_.fy * distance_mm, distance_mm, about_x,
                                          about_y, about_z)});
            }
            cv::Mat picture = render(camera_, placed);
            cv::GaussianBlur(picture, picture, {}, 0.6);
            if (conditions.motion_px > 0)
                blur_along(picture, conditions.motion_px, turn(generator) * std::numbers::pi / 180);
            picture *= conditions.exposure;
            add_noise(picture, conditions.noise, seed);
            Picture &added = pictures_.emplace_back(Picture{GreyFrame(picture), {}});
            for (const Placed &tag : placed)
                added.poses.push_back(tag.mt);
            shown_ += columns * rows;
        }
    }

    int shown() const { return shown_; }

    Outcome show_to(Tracker &tracker) const {
        Outcome outcome;
        std::vector<Listed> listed;
        for (std::size_t id = 0; id < pictures_.front().poses.size(); ++id)
            listed.push_back({static_cast<int>(id), side_mm});
        if (tracker.start(camera_, listed) != ARHOST_STATUS_OK)
            throw std::runtime_error(tracker.log());
        for (const Picture &picture : pictures_)
            for (const arhost_observation &seen : tracker.track(picture.frame)) {
                if (static_cast<std::size_t>(seen.id) >= picture.poses.size())
                    continue;
                const Mt &truth = picture.poses[static_cast<std::size_t>(seen.id)];
                const auto pose = solved_pose(seen, camera_, side_mm);
                ++outcome.found;
                outcome.wrong += !pose || angle_degrees(pose->mt, truth) > 20;
                outcome.corner_px.push_back(greatest_distance_px(seen, corners_of(truth, camera_, side_mm)));
            }
        return outcome;
    }

private:
    struct Picture {
        GreyFrame frame;
        std::vector<Mt> poses; // index: id
    };

    static void blur_along(cv::Mat &picture, double length_px, double angle) {
        constexpr int samples = 64;
        const int radius = static_cast<int>(std::ceil(length_px / 2)) + 1;
        cv::Mat_<float> kernel(2 * radius + 1, 2 * radius + 1, 0.0F);
        for (int i = 0; i < samples; ++i) {
            const double along = ((i + 0.5) / samples - 0.5) * length_px;
            const double x = radius + along * std::cos(angle), y = radius + along * std::sin(angle);
            const int column = static_cast<int>(x), row = static_cast<int>(y);
            const double a = x - column, b = y - row;
            kernel(row, column) += static_cast<float>((1 - a) * (1 - b) / samples);
            kernel(row, column + 1) += static_cast<float>(a * (1 - b) / samples);
            kernel(row + 1, column) += static_cast<float>((1 - a) * b / samples);
            kernel(row + 1, column + 1) += static_cast<float>(a * b / samples);
        }
        cv::filter2D(picture, picture, -1, kernel);
    }

    static constexpr double side_mm = 100;
    static inline const arhost_intrinsics camera_ = intrinsics_of({480, 360}, 450, 455, 243.2, 176.9);
    std::vector<Picture> pictures_;
    int shown_ = 0;
};

} // namespace arhost::test
