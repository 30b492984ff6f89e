// SPDX-License-Identifier: Apache-2.0
//
// A generated video of a poster in motion, half of which is covered.
#pragma once

#include <fiducial/tracker_support.hpp>

#include <opencv2/imgproc.hpp>

#include <numbers>

namespace arhost::test {

using Quad = std::array<cv::Point2d, 4>;

// A poster of 480 × 640: many patches of different brightness and size, the same for the same seed.
inline cv::Mat poster(std::uint64_t seed) {
    cv::RNG random(seed);
    cv::Mat picture(640, 480, CV_8UC1, cv::Scalar(170));
    for (int i = 0; i < 400; ++i) {
        const cv::Point at(random.uniform(0, picture.cols), random.uniform(0, picture.rows));
        const cv::Size size(random.uniform(4, 50), random.uniform(4, 50));
        if (i % 2)
            cv::rectangle(picture, {at, size}, cv::Scalar(random.uniform(0, 256)), cv::FILLED);
        else
            cv::ellipse(picture, at, size / 2, random.uniform(0, 180), 0, 360, cv::Scalar(random.uniform(0, 256)),
                        cv::FILLED, cv::LINE_AA);
    }
    return picture;
}

inline Quad moved(const Quad &quad, double x, double y) {
    Quad result = quad;
    for (cv::Point2d &corner : result)
        corner += cv::Point2d(x, y);
    return result;
}

// A poster in motion: it turns, tilts and comes nearer. `t` in frames.
inline Quad place(double t) {
    const auto wave = [&](double frames) { return std::sin(2 * std::numbers::pi * t / frames); };
    const double height = 240 + 40 * wave(170), width = height * 0.75, turn = 0.5 * wave(130);
    Quad quad;
    const double x[] = {-1, 1, 1, -1}, y[] = {-1, -1, 1, 1};
    for (std::size_t i = 0; i < 4; ++i) {
        const double depth = 1 + 0.2 * wave(90) * x[i] + 0.15 * wave(110) * y[i];
        const double u = x[i] * width / 2 / depth, v = y[i] * height / 2 / depth;
        quad[i] = {320 + 60 * wave(150) + u * std::cos(turn) - v * std::sin(turn),
                   240 + 40 * wave(100) + u * std::sin(turn) + v * std::cos(turn)};
    }
    return quad;
}

inline void draw(const cv::Mat &picture, const Quad &quad, cv::Mat &frame) {
    const float right = static_cast<float>(picture.cols) - 0.5F, bottom = static_cast<float>(picture.rows) - 0.5F;
    const std::vector<cv::Point2f> from{{-0.5F, -0.5F}, {right, -0.5F}, {right, bottom}, {-0.5F, bottom}};
    std::vector<cv::Point2f> to;
    for (const cv::Point2d &corner : quad)
        to.emplace_back(corner);
    // Drawn at twice the size and averaged.
    cv::Mat large;
    cv::resize(frame, large, {}, 2, 2, cv::INTER_NEAREST);
    for (cv::Point2f &corner : to)
        corner = 2 * corner + cv::Point2f(0.5F, 0.5F);
    cv::warpPerspective(picture, large, cv::getPerspectiveTransform(from, to), large.size(), cv::INTER_AREA,
                        cv::BORDER_TRANSPARENT);
    cv::resize(large, frame, frame.size(), 0, 0, cv::INTER_AREA);
}

// Covers a half of the picture by a grey sheet, each half for 50 frames.
inline void cover_half(cv::Mat &frame, const Quad &quad, int t) {
    const auto corner = [&](int i) { return quad[static_cast<std::size_t>((t / 50 + i) % 4)]; };
    const std::vector<cv::Point> half{corner(0), corner(1), (corner(1) + corner(2)) / 2, (corner(0) + corner(3)) / 2};
    cv::fillConvexPoly(frame, half, cv::Scalar(60), cv::LINE_AA);
}

inline cv::Mat empty_frame() {
    return {480, 640, CV_8UC1, cv::Scalar(110)};
}

inline void add_sensor(cv::Mat &frame, std::uint64_t seed) {
    cv::Mat noise(frame.size(), CV_16S);
    cv::RNG(seed).fill(noise, cv::RNG::NORMAL, 0, 2);
    cv::GaussianBlur(frame, frame, {}, 0.6);
    cv::add(frame, noise, frame, cv::noArray(), CV_8U);
}

inline double mean_error_px(const arhost_observation &seen, const Quad &truth) {
    double sum = 0;
    for (int i = 0; i < 4; ++i)
        sum += corner_distance_px(seen, i, truth[static_cast<std::size_t>(i)]) / 4;
    return sum;
}

} // namespace arhost::test
