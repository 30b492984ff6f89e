// SPDX-License-Identifier: Apache-2.0
//
// Pictures without markers that a detector may mistake for some, and what a tracker finds in them.
#pragma once

#include "tag_pictures.hpp"

#include <functional>
#include <string>

namespace arhost::test {

// Whether a square of cells, 0 or 1 for white, is the code of a marker.
using IsMarker = std::function<bool(const cv::Mat_<uint8_t> &white)>;

// Draws quadrilaterals over each other: plain ones, framed text, framed random cells, and noise. The same seed gives
// the same picture. A few of the framed cells are markers by chance: a grid of 4×4 cells is one of DICT_4X4_1000 with
// a probability of 6 %. Those for which `is_marker` is true get other cells.
inline cv::Mat clutter(cv::Size size, uint64_t seed, const IsMarker &is_marker = nullptr) {
    constexpr int shapes = 60, texture_px = 60;
    cv::RNG random(seed);
    cv::Mat picture(size, CV_8U, cv::Scalar(random.uniform(60, 220)));
    for (int shape = 0; shape < shapes; ++shape) {
        const int dark = random.uniform(0, 90), bright = random.uniform(140, 256);
        cv::Mat_<uint8_t> texture(texture_px, texture_px, static_cast<uint8_t>(dark));
        const cv::Rect inner(10, 10, texture_px - 20, texture_px - 20); // the frame is a sixth of the side
        switch (shape % 4) {
        case 0:
            texture = static_cast<uint8_t>(random.uniform(0, 2) ? dark : bright);
            break;
        case 1: {
            texture(inner) = static_cast<uint8_t>(bright);
            const std::string text(1, static_cast<char>(random.uniform('0', 'z' + 1)));
            cv::putText(texture, text + text, {12, 42}, random.uniform(0, 8), random.uniform(0.6, 1.4),
                        cv::Scalar(dark), random.uniform(2, 8));
            break;
        }
        case 2: {
            const int cells = random.uniform(2, 7);
            cv::Mat_<uint8_t> white(cells, cells);
            do {
                for (uint8_t &cell : white)
                    cell = static_cast<uint8_t>(random.uniform(0, 2) ? 0 : 1);
            } while (is_marker && is_marker(white));
            cv::resize(white * (bright - dark) + dark, texture(inner), inner.size(), 0, 0, cv::INTER_NEAREST);
            break;
        }
        default:
            random.fill(texture, cv::RNG::UNIFORM, dark, bright);
        }
        const float side = random.uniform(14.0F, 80.0F);
        const cv::RotatedRect box({random.uniform(0.0F, static_cast<float>(size.width)),
                                   random.uniform(0.0F, static_cast<float>(size.height))},
                                  {side, side * random.uniform(0.8F, 1.25F)}, random.uniform(0.0F, 360.0F));
        std::vector<cv::Point2f> from{{0, 0}, {texture_px, 0}, {texture_px, texture_px}, {0, texture_px}}, to(4);
        box.points(to.data());
        for (cv::Point2f &corner : to)
            corner += cv::Point2f(random.uniform(-0.1F, 0.1F), random.uniform(-0.1F, 0.1F)) * side;
        const cv::Rect around = cv::boundingRect(to) & cv::Rect({}, size);
        if (around.empty())
            continue;
        for (cv::Point2f &corner : to)
            corner -= cv::Point2f(around.tl());
        cv::Mat part = picture(around);
        cv::warpPerspective(texture, part, cv::getPerspectiveTransform(from, to), part.size(), cv::INTER_LINEAR,
                            cv::BORDER_TRANSPARENT);
    }
    cv::GaussianBlur(picture, picture, {}, 0.7);
    cv::Mat noise(size, CV_16S);
    random.fill(noise, cv::RNG::NORMAL, 0, 2);
    cv::add(picture, noise, picture, cv::noArray(), CV_8U);
    return picture;
}

struct ClutterCounts {
    int pictures = 0;
    int false_positives = 0, unlisted = 0; // detections where there is none: of listed and of other ids
    int found = 0;                         // markers found that were laid over the clutter, one in each picture
};

// `print` draws a marker by its id, 0 to 29.
inline ClutterCounts find_in_clutter(Tracker &tracker, const std::string &family,
                                     const std::function<Print(int)> &print) {
    constexpr int ids = 30;
    const auto camera = intrinsics_of({480, 360}, 450, 455, 243.2, 176.9);
    std::vector<Listed> listed;
    for (int id = 0; id < ids; ++id)
        listed.push_back({id, 100, family});
    if (tracker.start(camera, listed) != ARHOST_STATUS_OK)
        throw std::runtime_error(tracker.log());
    ClutterCounts counts;
    for (counts.pictures = 0; counts.pictures < 40; ++counts.pictures) {
        const int i = counts.pictures, id = i % ids;
        cv::Mat picture = clutter({480, 360}, static_cast<uint64_t>(i) + 1);
        for (const arhost_observation &seen : tracker.track(GreyFrame(picture)))
            ++(seen.id < ids ? counts.false_positives : counts.unlisted);

        const Mt pose = pose_of(3 * i - 60, 40 - 2 * i, 900, 30 - i, i - 20, 9 * i);
        const Placed placed{print(id), 100, pose};
        cv::Mat mask(picture.size(), CV_8U, cv::Scalar(0));
        std::vector<cv::Point> paper;
        for (const cv::Point2d &corner :
             corners_of(pose, camera, 100.0 * placed.print.cells.cols / placed.print.corner_cells))
            paper.emplace_back(corner);
        cv::fillConvexPoly(mask, paper, cv::Scalar(255));
        render(camera, {placed}).copyTo(picture, mask);
        for (const arhost_observation &seen : tracker.track(GreyFrame(picture)))
            if (const auto solved = solved_pose(seen, camera, 100); solved && seen.id == id)
                counts.found += angle_degrees(solved->mt, pose) < 20;
    }
    return counts;
}

} // namespace arhost::test
