// SPDX-License-Identifier: Apache-2.0
//
// Tests of trackers with photos from ../shared/data/markers that show known tag36h11 tags.
#pragma once

#include "solved_pose.hpp"

#include <gtest/gtest.h>

#include <opencv2/calib3d.hpp>

#include <fstream>

namespace arhost::test {

// Returns the listed markers that the tracker finds in a photo, by id.
inline std::map<int, arhost_observation> markers_in(Tracker &tracker, const std::filesystem::path &file,
                                                    const std::vector<Listed> &listed) {
    const cv::Mat picture = read_grey(file);
    if (tracker.start(plain_camera(picture.size()), listed) != ARHOST_STATUS_OK)
        throw std::runtime_error(tracker.log());
    std::map<int, arhost_observation> by_id;
    for (const arhost_observation &marker : tracker.track(GreyFrame(picture, ARHOST_TRANSFER_SRGB)))
        if (std::ranges::find(listed, marker.id, &Listed::id) != listed.end())
            by_id[marker.id] = marker;
    return by_id;
}

inline std::vector<Listed> ids_to(int count, const std::string &family = "tag36h11") {
    std::vector<Listed> listed;
    for (int id = 0; id < count; ++id)
        listed.push_back({id, 100, family});
    return listed;
}

// Returns the pixel at the print's centre: the intersection of the diagonals.
inline cv::Point2d centre_px(const arhost_observation &marker) {
    const auto corner = [&](int i) { return cv::Point2d(marker.corners_px[i][0], marker.corners_px[i][1]); };
    const cv::Point2d a = corner(2) - corner(0), b = corner(3) - corner(1);
    return corner(0) + (corner(1) - corner(0)).cross(b) / a.cross(b) * a;
}

// Checks the poses and corners of the twelve tags of 53 mm in apriltag_photo. The corners may differ by 0.5 px, the
// tolerance that ViSP uses.
inline void expect_april_tag_photo(Tracker &tracker) {
    const auto folder = shared_data("markers/apriltag_photo");
    const auto photo = read_grey(folder / "AprilTag.png");
    const auto camera = intrinsics_of(photo.size(), 615.1674805, 615.1675415, 312.1889954, 243.4373779);
    ASSERT_EQ(tracker.start(camera, ids_to(30)), ARHOST_STATUS_OK);
    const auto found = tracker.track(GreyFrame(photo, ARHOST_TRANSFER_SRGB));
    EXPECT_EQ(found.size(), 12u);
    std::ifstream corners(folder / "ground_truth_detection.txt"), poses(folder / "ground_truth_pose.txt");
    for (const arhost_observation &marker : found) {
        SCOPED_TRACE(marker.id);
        std::string title;
        std::getline(corners >> std::ws, title);
        ASSERT_EQ(title, "36h11_id:_" + std::to_string(marker.id));
        for (int k = 3; k >= 0; --k) { // the file's order is counter-clockwise from the bottom left
            double row = 0, column = 0;
            corners >> row >> column;
            EXPECT_LT(corner_distance_px(marker, k, {column - 0.5, row - 0.5}),
                      0.5); // in the file, pixel centres are at +0.5
        }
        std::getline(poses >> std::ws, title);
        double t[3], u[3]; // translation in metres and rotation vector, in OpenCV's camera axes
        poses >> t[0] >> t[1] >> t[2] >> u[0] >> u[1] >> u[2];
        const auto pose = solved_pose(marker, camera, 53);
        ASSERT_TRUE(pose);
        const double sign[3] = {1, -1, -1};
        cv::Matx33d truth, measured;
        cv::Rodrigues(cv::Vec3d(u), truth);
        for (int row = 0; row < 3; ++row) {
            EXPECT_NEAR(sign[row] * pose->mt[12 + row], 1000 * t[row], 5);
            for (int column = 0; column < 3; ++column)
                measured(row, column) = sign[row] * pose->mt[4 * column + row];
        }
        cv::Vec3d difference;
        cv::Rodrigues(truth.t() * measured, difference);
        EXPECT_LT(cv::norm(difference), 0.03); // rad
    }
}

// Checks that the tracker finds all 30 tags, each about 25 px wide, in four photos of a clipboard (320×240), and the
// one tag in each of five photos of a hallway.
inline void expect_swatbotics_photos(Tracker &tracker) {
    const auto folder = shared_data("markers/swatbotics");
    for (const char *name : {"clipboard02.png", "clipboard04.png", "clipboard05.png", "clipboard06.png"})
        EXPECT_EQ(markers_in(tracker, folder / "clipboard" / name, ids_to(60)).size(), 30u) << name;
    for (const auto &[name, id] : {std::pair{"0612", 3}, std::pair{"0613", 3}, std::pair{"0614", 2},
                                   std::pair{"0615", 2}, std::pair{"0617", 10}}) {
        const auto found =
            markers_in(tracker, folder / "hallway" / ("IMG_" + std::string(name) + ".jpg"), ids_to(60));
        EXPECT_EQ(found.size(), 1u) << name;
        EXPECT_TRUE(found.contains(id)) << name;
    }
}

// Compares the tags' centres with those that AprilTags.jl computes; its pixel centres are at +0.5.
inline void expect_julia_photo(Tracker &tracker) {
    std::vector<cv::Point2d> expected{{176.1, 404.5}, {216.1, 134.0}, {130.1, 412.0}};
    const auto found = markers_in(tracker, shared_data("markers/julia/tagtest.jpg"), ids_to(30));
    ASSERT_EQ(found.size(), expected.size());
    for (const auto &[id, marker] : found) {
        const cv::Point2d centre = centre_px(marker) + cv::Point2d(0.5, 0.5);
        EXPECT_TRUE(
            std::any_of(expected.begin(), expected.end(), [&](cv::Point2d e) { return cv::norm(e - centre) < 0.5; }))
            << "tag " << id << " at " << centre;
    }
}

} // namespace arhost::test
