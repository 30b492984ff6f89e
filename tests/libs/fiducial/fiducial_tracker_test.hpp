// SPDX-License-Identifier: Apache-2.0
//
// Tests for every fiducial tracker, with the families tag36h11 and tag25h9. Each tracker's test program includes this
// file and instantiates the suite FiducialTracker with the tracker's configurations.
#pragma once

#include "tag_pictures.hpp"

#include <gmock/gmock.h>

#include <opencv2/core/utility.hpp>

#include <algorithm>

namespace arhost::test {

struct TrackerCase {
    const char *name, *plugin;
    Options options;
    Options multithreaded; // additional options that make the tracker use several threads
};

inline const arhost_intrinsics test_camera = intrinsics_of({480, 360}, 450, 455, 243.2, 176.9);

inline cv::Mat picture_of(const std::vector<Placed> &markers) {
    cv::Mat picture = render(test_camera, markers);
    cv::GaussianBlur(picture, picture, {}, 0.6);
    add_noise(picture, 1.5, 1);
    return picture;
}

inline Print tag(int id) {
    return april_tag("tag36h11", id).with_margin(1);
}

// Inverts the first `count` of two cells inside the border of a tag.
inline Print with_wrong_bits(Print print, int count) {
    constexpr int rows[] = {3, 4}, columns[] = {3, 5};
    for (int i = 0; i < count; ++i) {
        uint8_t &cell = print.cells(rows[i], columns[i]);
        cell = static_cast<uint8_t>(255 - cell);
    }
    return print;
}

class FiducialTracker : public testing::TestWithParam<TrackerCase> {
protected:
    FiducialTracker() : tracker_(GetParam().plugin, GetParam().options) {
        EXPECT_EQ(tracker_.created(), ARHOST_STATUS_OK) << tracker_.log();
    }
    std::vector<arhost_observation> track(const cv::Mat &picture, const std::vector<Listed> &listed) {
        auto camera = test_camera;
        camera.width = static_cast<uint32_t>(picture.cols);
        camera.height = static_cast<uint32_t>(picture.rows);
        EXPECT_EQ(tracker_.start(camera, listed), ARHOST_STATUS_OK) << tracker_.log();
        return tracker_.track(GreyFrame(picture));
    }
    // Shows the pictures to the tracker with arhost's refinement of the corners, and with the corners of its library.
    std::pair<TagPictures::Outcome, TagPictures::Outcome> refined_and_plain(const TagPictures &pictures) {
        Options options = GetParam().options;
        options["corner_refinement"] = "none";
        Tracker plain(GetParam().plugin, options);
        return {pictures.show_to(tracker_), pictures.show_to(plain)};
    }
    Tracker tracker_;
};

inline void PrintTo(const TrackerCase &tracker, std::ostream *out) {
    *out << tracker.name;
}
inline std::string case_name(const testing::TestParamInfo<TrackerCase> &info) {
    return info.param.name;
}

// A marker with sides of 100 mm that is difficult to detect.
struct Difficult {
    const char *name;
    double side_px, tilt_degrees = 30, blur_px = 0.6, exposure = 1, noise = 1.5;

    Mt truth() const { return pose_of(20, 10, 450 * 100 / side_px, tilt_degrees, 0, 20); }
    cv::Mat picture(const Print &print) const {
        cv::Mat picture = render(test_camera, {{print, 100, truth()}});
        cv::GaussianBlur(picture, picture, {}, blur_px);
        picture *= exposure;
        add_noise(picture, noise, 2);
        return picture;
    }
};

// Shows a picture until so many markers are seen, but not longer than it takes until each closer look has been taken
// in each tile. Returns what is seen in the last frame.
inline std::vector<arhost_observation> track_until_seen(Tracker &tracker, const cv::Mat &picture,
                                                        std::size_t count = 1, std::uint64_t first_sequence = 0) {
    constexpr std::uint64_t frames_of_all_turns = 47; // for one family
    std::vector<arhost_observation> seen;
    for (std::uint64_t i = 0; i < frames_of_all_turns && seen.size() < count; ++i)
        seen = tracker.track(GreyFrame(picture, ARHOST_TRANSFER_LINEAR, first_sequence + i));
    return seen;
}

// Expects that a tracker finds the marker only in a closer look, and in a large frame whenever it is expected.
inline void expect_found_in_closer_look(const std::string &plugin, const Difficult &marker) {
    const cv::Mat picture = marker.picture(tag(3));
    Tracker tracker(plugin);
    ASSERT_EQ(tracker.start(test_camera, {{3}}), ARHOST_STATUS_OK) << tracker.log();
    for (const auto &[closer_look, count] : {std::pair{"true", 1u}, {"false", 0u}, {"true", 1u}}) {
        EXPECT_EQ(tracker.set("closer_look", closer_look), ARHOST_STATUS_OK) << tracker.log();
        EXPECT_EQ(track_until_seen(tracker, picture).size(), count) << closer_look;
    }
    cv::Mat wide(720, 1280, CV_8U, cv::Scalar(picture.at<uint8_t>(0, 0)));
    const cv::Rect place(430, 210, picture.cols, picture.rows);
    picture.copyTo(wide(place));
    auto corners = corners_of(marker.truth(), test_camera, 100);
    for (cv::Point2d &corner : corners)
        corner += cv::Point2d(place.tl());
    ASSERT_EQ(tracker.start(plain_camera(wide.size()), {{3}}), ARHOST_STATUS_OK) << tracker.log();
    for (const bool everywhere : {false, true})
        for (std::uint64_t sequence = 0; sequence < 8; ++sequence) {
            const GreyFrame frame_of_video(wide, ARHOST_TRANSFER_LINEAR, sequence);
            const auto seen = tracker.track(frame_of_video, {expected_at(0, corners)}, everywhere);
            ASSERT_EQ(seen.size(), 1u) << "frame " << sequence;
            EXPECT_LT(greatest_distance_px(seen[0], corners), 0.5);
        }
}

// Expects that a tracker locates the corners of a print that is blurred by so many of its cells.
inline void expect_refined_if_blurred(const std::string &plugin, const Listed &listed, const Print &print,
                                      double blur_cells, double max_error_px) {
    Tracker tracker(plugin);
    ASSERT_EQ(tracker.start(test_camera, {listed}), ARHOST_STATUS_OK) << tracker.log();
    const Mt truth = pose_of(-20, 10, 600, 15, -10, 160);
    cv::Mat picture = render(test_camera, {{print, listed.side_mm, truth}});
    const double cell_px = 60.0 / print.corner_cells;
    cv::GaussianBlur(picture, picture, {}, blur_cells * cell_px);
    add_noise(picture, 1.5, 1);
    const auto seen = tracker.track(GreyFrame(picture));
    ASSERT_EQ(seen.size(), 1u);
    EXPECT_LT(greatest_distance_px(seen[0], corners_of(truth, test_camera, listed.side_mm)), max_error_px);
}

// Returns the log of a tracker after it has looked for a family in a picture of another one.
inline std::string log_after(const std::string &plugin, const std::string &family, const Print &seen) {
    Tracker tracker(plugin);
    EXPECT_EQ(tracker.start(test_camera, {{3, 80, family}}), ARHOST_STATUS_OK) << tracker.log();
    tracker.track(GreyFrame(picture_of({{seen, 80, pose_of(10, 5, 400, 10, -20, 160)}})));
    tracker.stop();
    return tracker.log();
}

TEST_P(FiducialTracker, PutsCornersWhereTheyWereRendered) {
    cv::Point2d bias;
    const std::vector<Mt> poses{pose_of(0, 0, 500), pose_of(60, 40, 450, 30, 20, 15),
                                pose_of(-70, 30, 600, -35, 25, 90), pose_of(40, -50, 550, 20, -45, 180),
                                pose_of(-30, -40, 700, -20, -30, -100)};
    for (const Mt &truth : poses) {
        const auto seen = track(picture_of({{tag(17), 100, truth}}), {{17}});
        ASSERT_EQ(seen.size(), 1u);
        EXPECT_EQ(seen[0].id, 17);
        EXPECT_EQ(seen[0].family, 0u);
        EXPECT_EQ(seen[0].struct_size, sizeof(arhost_observation));
        const auto corners = corners_of(truth, test_camera, 100);
        EXPECT_LT(greatest_distance_px(seen[0], corners), 0.2);
        for (int k = 0; k < 4; ++k)
            bias += cv::Point2d(seen[0].corners_px[k][0], seen[0].corners_px[k][1]) - corners[k];
    }
    // Fails if the tracker does not put pixel centres at integers: the bias would then be half a pixel.
    EXPECT_LT(cv::norm(bias) / (4.0 * static_cast<double>(poses.size())), 0.03);
}

TEST_P(FiducialTracker, BeginsWithTheTopLeftCornerOfTheUprightTagAndContinuesClockwise) {
    const auto upright = track(picture_of({{tag(3), 100, pose_of(20, 30, 400)}}), {{3}});
    ASSERT_EQ(upright.size(), 1u);
    EXPECT_LT(upright[0].corners_px[0][0], upright[0].corners_px[1][0]); // top-left is left of top-right
    EXPECT_LT(upright[0].corners_px[0][1], upright[0].corners_px[3][1]); // top-left is above bottom-left

    for (const double turn : {0.0, 90.0, 180.0, 270.0}) {
        const Mt truth = pose_of(0, 0, 400, 0, 0, turn);
        const auto turned = track(picture_of({{tag(3), 100, truth}}), {{3}});
        ASSERT_EQ(turned.size(), 1u);
        EXPECT_LT(greatest_distance_px(turned[0], corners_of(truth, test_camera, 100)), 0.2);
    }
}

TEST_P(FiducialTracker, FitsTheCurvedEdgesOfADistortedTag) {
    // The distortion moves the corners by up to 10 px and bends the edges by up to 1 px.
    arhost_intrinsics lens = test_camera;
    lens.distortion = ARHOST_DISTORTION_BROWN;
    lens.coefficient_count = 4;
    lens.coefficients[0] = -0.2;
    const Mt truth = pose_of(140, 80, 450, 20, -15, 10);
    const cv::Mat straight = render(test_camera, {{tag(8), 110, truth}});
    cv::Mat_<cv::Vec2f> source(straight.size());
    std::vector<cv::Point2d> distorted, ideal;
    for (int y = 0; y < source.rows; ++y)
        for (int x = 0; x < source.cols; ++x)
            distorted.emplace_back(x, y);
    const cv::Matx33d k(lens.fx, 0, lens.cx, 0, lens.fy, lens.cy, 0, 0, 1);
    cv::undistortPoints(distorted, ideal, k, std::vector<double>{-0.2, 0, 0, 0}, cv::noArray(), k,
                        cv::TermCriteria(cv::TermCriteria::COUNT, 30, 0));
    std::transform(ideal.begin(), ideal.end(), source.begin(), [](cv::Point2d p) { return cv::Vec2f(p.x, p.y); });
    cv::Mat bent;
    cv::remap(straight, bent, source, cv::noArray(), cv::INTER_LINEAR);

    ASSERT_EQ(tracker_.start(lens, {{8}}), ARHOST_STATUS_OK);
    const auto seen = tracker_.track(GreyFrame(bent));
    ASSERT_EQ(seen.size(), 1u);
    EXPECT_GT(corner_distance_px(seen[0], 1, corners_of(truth, test_camera, 110)[1]), 5);
    EXPECT_LT(greatest_distance_px(seen[0], corners_of(truth, lens, 110)), 0.1);
}

TEST_P(FiducialTracker, ReportsListedAndUnlistedMarkersByTheirIds) {
    const std::map<int, Mt> poses{
        {2, pose_of(100, 60, 500)}, {5, pose_of(-100, 60, 500)}, {586, pose_of(0, -60, 500, 10, 20, 30)}};
    std::vector<Placed> placed;
    for (const auto &[id, pose] : poses)
        placed.push_back({tag(id), 80, pose});
    const cv::Mat picture = picture_of(placed);
    for (const std::vector<Listed> &listed :
         {std::vector<Listed>{{5}, {2}, {586}}, {{586}, {7}, {2}}, {{5}}, {{7}, {9}}}) {
        const auto seen = track(picture, listed);
        std::vector<int> ids;
        for (const arhost_observation &one : seen) {
            ids.push_back(one.id);
            EXPECT_EQ(one.family, 0u);
            const bool is_listed = std::ranges::find(listed, one.id, &Listed::id) != listed.end();
            EXPECT_LT(greatest_distance_px(one, corners_of(poses.at(one.id), test_camera, 80)), is_listed ? 0.2 : 2.5)
                << one.id;
        }
        EXPECT_THAT(ids, testing::ElementsAre(2, 5, 586)) << "with " << listed.size() << " listed";
    }
}

TEST_P(FiducialTracker, NamesOtherMarkersOnceIfNoListedOneAppears) {
    const GreyFrame other(picture_of({{april_tag("tag25h9", 7).with_margin(1), 80, pose_of(-60, 0, 400)},
                                      {april_tag("tag25h9", 9).with_margin(1), 80, pose_of(60, 0, 400)}}));
    const GreyFrame listed(picture_of({{tag(5), 80, pose_of(0, 0, 400)}})), empty(picture_of({}));
    ASSERT_EQ(tracker_.start(test_camera, {{5}}), ARHOST_STATUS_OK) << tracker_.log();
    for (int frame = 1; frame < 60; ++frame)
        tracker_.track(empty);
    tracker_.track(other);
    EXPECT_EQ(tracker_.log(), "");
    tracker_.track(other);
    EXPECT_THAT(tracker_.log(), testing::EndsWith("other markers were in view: tag25h9 7, 9\n"));
    const std::string log = tracker_.log();
    tracker_.stop();
    EXPECT_EQ(tracker_.log(), log);

    ASSERT_EQ(tracker_.start(test_camera, {{5}}), ARHOST_STATUS_OK);
    tracker_.track(listed);
    tracker_.track(other);
    tracker_.stop();
    EXPECT_EQ(tracker_.log(), log);
}

TEST_P(FiducialTracker, ReportsAllCopiesOfAMarkerByTheirPlaces) {
    const Mt left = pose_of(-90, 20, 500), right = pose_of(90, -20, 500);
    for (const auto &placed :
         {std::vector<Placed>{{tag(5), 80, left}, {tag(5), 80, right}}, {{tag(5), 80, right}, {tag(5), 80, left}}}) {
        const auto seen = track(picture_of(placed), {{5}});
        ASSERT_EQ(seen.size(), 2u);
        EXPECT_EQ(seen[0].id, 5);
        EXPECT_EQ(seen[1].id, 5);
        EXPECT_LT(greatest_distance_px(seen[0], corners_of(left, test_camera, 80)), 0.2);
        EXPECT_LT(greatest_distance_px(seen[1], corners_of(right, test_camera, 80)), 0.2);
    }
}

TEST_P(FiducialTracker, FindsTheMarkersOfTwoFamilies) {
    const auto tag25 = [](int id) { return april_tag("tag25h9", id).with_margin(1); };
    const Mt poses[] = {pose_of(-100, 60, 500), pose_of(100, 60, 500, 20, 10, 40), pose_of(-100, -60, 500, 0, 20, 80),
                        pose_of(100, -60, 500, 10, 0, 200)};
    const cv::Mat picture = picture_of(
        {{tag(5), 80, poses[0]}, {tag(7), 80, poses[1]}, {tag25(5), 80, poses[2]}, {tag25(9), 80, poses[3]}});
    struct Expected {
        std::string family;
        int id;
        Mt pose;
    };
    std::vector<Expected> expected{
        {"tag36h11", 5, poses[0]}, {"tag36h11", 7, poses[1]}, {"tag25h9", 5, poses[2]}, {"tag25h9", 9, poses[3]}};
    for (const bool swapped : {false, true}) {
        if (swapped)
            std::ranges::rotate(expected, expected.begin() + 2);
        std::vector<Listed> listed;
        for (const auto &[family, id, pose] : expected)
            listed.push_back({id, 80, family});
        const auto seen = track(picture, listed);
        ASSERT_EQ(seen.size(), expected.size());
        for (std::size_t i = 0; i < seen.size(); ++i) {
            EXPECT_EQ(seen[i].family, i / 2);
            EXPECT_EQ(tracker_.family(seen[i]), expected[i].family);
            EXPECT_EQ(seen[i].id, expected[i].id);
            EXPECT_LT(greatest_distance_px(seen[i], corners_of(expected[i].pose, test_camera, 80)), 0.2);
        }
    }
}

TEST_P(FiducialTracker, KnowsAprilTagsFamiliesByTheirNamesInOpenCvToo) {
    const cv::Mat picture =
        picture_of({{tag(3), 80, pose_of(-90, 20, 500, 10, 20, 30)}, {tag(4), 80, pose_of(90, -20, 500)}});
    const auto expected = track(picture, {{3}, {4}});
    ASSERT_EQ(expected.size(), 2u);
    auto seen = track(picture, {{3, 100, "DICT_APRILTAG_36h11"}, {4, 100, "DICT_APRILTAG_36h11"}});
    ASSERT_EQ(seen.size(), 2u);
    EXPECT_EQ(std::memcmp(seen.data(), expected.data(), 2 * sizeof(arhost_observation)), 0);

    // With both names, each marker is reported once: in the family under whose name it is listed.
    seen = track(picture, {{4}, {3, 100, "DICT_APRILTAG_36h11"}});
    ASSERT_EQ(seen.size(), 2u);
    EXPECT_EQ(tracker_.family(seen[0]), "tag36h11");
    EXPECT_EQ(seen[0].id, 4);
    EXPECT_EQ(tracker_.family(seen[1]), "DICT_APRILTAG_36h11");
    EXPECT_EQ(seen[1].id, 3);
    EXPECT_EQ(tracker_.start(test_camera, {{3}, {3, 100, "DICT_APRILTAG_36h11"}}), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(tracker_.log(), testing::HasSubstr("marker id 3 of DICT_APRILTAG_36h11 is also listed as a marker of "
                                                   "tag36h11"));
}

TEST_P(FiducialTracker, CountsTheBitsThatItCorrects) {
    double margin = 0;
    for (const int wrong_bits : {2, 1, 0}) {
        const Print print = with_wrong_bits(april_tag("tag36h11", 3), wrong_bits).with_margin(1);
        const auto seen = track(picture_of({{print, 100, pose_of(0, 0, 400, 20, 20, 130)}}), {{3}});
        ASSERT_EQ(seen.size(), 1u) << wrong_bits;
        EXPECT_EQ(seen[0].hamming, static_cast<uint32_t>(wrong_bits));
        margin = seen[0].decision_margin;
        EXPECT_GT(margin, 30);
    }
    const cv::Mat pale = picture_of({{tag(3), 100, pose_of(0, 0, 400, 20, 20, 130)}}) / 2 + 60;
    const auto seen = track(pale, {{3}});
    ASSERT_EQ(seen.size(), 1u);
    EXPECT_EQ(seen[0].hamming, 0u);
    EXPECT_NEAR(seen[0].decision_margin, margin / 2, margin / 8);
}

TEST_P(FiducialTracker, RejectsAMirroredPrint) {
    EXPECT_EQ(track(picture_of({{tag(3), 100, pose_of(0, 0, 400)}}), {{3}}).size(), 1u);
    std::vector<Listed> all;
    for (int id = 0; id < 64; ++id)
        all.push_back({id});
    EXPECT_TRUE(track(picture_of({{tag(3).mirrored(), 100, pose_of(0, 0, 400)}}), all).empty());
}

TEST_P(FiducialTracker, FindsNothingInEmptyImages) {
    std::vector<Listed> all;
    for (int id = 0; id < 64; ++id)
        all.push_back({id});
    for (const cv::Size size : {cv::Size(1, 1), cv::Size(2, 3), cv::Size(7, 7), cv::Size(8, 8), cv::Size(13, 12),
                                cv::Size(1, 500), cv::Size(500, 1), cv::Size(33, 9), cv::Size(320, 240)})
        for (const int grey : {0, 255, 128}) {
            cv::Mat picture(size, CV_8U, cv::Scalar(grey));
            EXPECT_TRUE(track(picture, all).empty()) << size << " grey " << grey;
            add_noise(picture, 60, 4);
            EXPECT_TRUE(track(picture, all).empty()) << size << " with noise, grey " << grey;
        }
}

TEST_P(FiducialTracker, RejectsAnIdThatIsNotInTheFamily) {
    EXPECT_EQ(tracker_.start(test_camera, {{0}, {587}}), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(tracker_.log(), testing::HasSubstr("target 'tag36h11-587': marker id 587 is not in tag36h11, whose "
                                                   "ids are 0 to 586"));
    EXPECT_EQ(tracker_.start(test_camera, {{0}, {586}}), ARHOST_STATUS_OK);
}

TEST_P(FiducialTracker, RejectsAFamilyThatItDoesNotKnow) {
    EXPECT_EQ(tracker_.start(test_camera, {{0}, {0, 100, "tag99h9"}}), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(tracker_.log(),
                testing::AllOf(testing::ContainsRegex("unknown (family|dictionary) 'tag99h9': tracker_"),
                               testing::HasSubstr("tag36h11, tag36h10, tag25h9, tag16h5")));
    EXPECT_EQ(tracker_.start(test_camera, {{0, 100, ""}}), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(tracker_.log(), testing::ContainsRegex("unknown (family|dictionary) ''"));
}

TEST_P(FiducialTracker, ReportsNoCornersOfAWrongSquareWithAHiddenCorner) {
    const Mt truth = pose_of(10, 5, 450, 25, -20, 30);
    const cv::Mat whole = picture_of({{tag(17), 100, truth}});
    const auto corners = corners_of(truth, test_camera, 100);
    double shortest_px = 1e9;
    for (int k = 0; k < 4; ++k)
        shortest_px = std::min(shortest_px, cv::norm(corners[(k + 1) % 4] - corners[k]));
    for (int hidden = 0; hidden < 4; ++hidden)
        for (const int radius_px : {4, 8, 14, 22, 30})
            for (const int grey : {20, 120, 230}) {
                cv::Mat picture = whole.clone();
                cv::circle(picture, corners[hidden], radius_px, cv::Scalar(grey), cv::FILLED);
                for (const arhost_observation &seen : track(picture, {{17}})) {
                    const auto pose = solved_pose(seen, test_camera, 100);
                    if (!pose || pose->reprojection_px > 0.05 * shortest_px) // no square has these corners
                        continue;
                    EXPECT_LT(angle_degrees(pose->mt, truth), 5)
                        << "corner " << hidden << " radius " << radius_px << " grey " << grey;
                    EXPECT_NEAR(pose->mt[14] / truth[14], 1, 0.02)
                        << "corner " << hidden << " radius " << radius_px << " grey " << grey;
                }
            }
}

TEST_P(FiducialTracker, RefinementKeepsEveryDetectionAtATenthOfTheExposure) {
    const TagPictures pictures({"dark", 40, 0, 0.1, 2}, 112);
    const auto [refined, plain] = refined_and_plain(pictures);
    EXPECT_EQ(refined.found, plain.found);
    EXPECT_GE(refined.found, 0.9 * pictures.shown());
}

TEST_P(FiducialTracker, RefinedCornersAreNoWorseThanThoseOfTheLibrary) {
    for (const auto &[conditions, tags] : {std::pair{Conditions{"sharp", 13}, 1200}, // few poses are wrong
                                           {{"sharp", 28}, 112},
                                           {{"sharp", 60}, 60},
                                           {{"noisy", 28, 0, 1, 10}, 112},
                                           {{"dark", 20, 0, 0.1, 2}, 200},
                                           {{"dark", 28, 0, 0.1, 2}, 112},
                                           {{"moved", 28, 3}, 112},
                                           {{"moved", 110, 13}, 60}}) {
        SCOPED_TRACE(testing::Message() << conditions.name << ", " << conditions.side_px << " px");
        const TagPictures pictures(conditions, tags);
        const auto [refined, plain] = refined_and_plain(pictures);
        EXPECT_GE(refined.found, plain.found) << "a closer look reads the bits at the reported corners";
        EXPECT_LE(refined.wrong, plain.wrong);
        if (plain.found > 0) {
            EXPECT_LE(percentile(refined.corner_px, 0.99), percentile(plain.corner_px, 0.99));
        }
    }
}

TEST_P(FiducialTracker, GivesTheSameResultWithAnyNumberOfThreads) {
    std::vector<Placed> placed;
    std::vector<Listed> listed;
    for (int id = 0; id < 12; ++id) {
        placed.push_back(
            {tag(id), 60, pose_of((id % 4 - 1.5) * 110, (id / 4 - 1) * 110, 500, 3 * id, 20 - 4 * id, 31 * id)});
        listed.push_back({id, 60});
    }
    const cv::Mat picture = picture_of(placed);
    const int threads = cv::getNumThreads();
    cv::setNumThreads(1);
    const auto single = track(picture, listed);
    cv::setNumThreads(2);
    Options options = GetParam().options;
    options.insert(GetParam().multithreaded.begin(), GetParam().multithreaded.end());
    Tracker multithreaded(GetParam().plugin, options);
    ASSERT_EQ(multithreaded.start(test_camera, listed), ARHOST_STATUS_OK);
    for (int repetition = 0; repetition < 5; ++repetition) {
        const auto several = multithreaded.track(GreyFrame(picture));
        ASSERT_EQ(several.size(), single.size());
        EXPECT_EQ(std::memcmp(several.data(), single.data(), single.size() * sizeof(arhost_observation)), 0);
    }
    EXPECT_EQ(single.size(), 12u);
    cv::setNumThreads(threads);
}

TEST_P(FiducialTracker, FindsSmallTiltedBlurredDimAndNoisyMarkers) {
    for (const Difficult &one : {Difficult{"small", 13},
                                 {"tilted", 60, 77},
                                 {"blurred", 60, 30, 3.8},
                                 {"dim", 60, 30, 0.6, 0.06},
                                 {"noisy", 60, 30, 0.6, 1, 40}}) {
        ASSERT_EQ(tracker_.start(test_camera, {{3}}), ARHOST_STATUS_OK);
        const auto seen = track_until_seen(tracker_, one.picture(tag(3)));
        ASSERT_EQ(seen.size(), 1u) << one.name;
        EXPECT_LT(greatest_distance_px(seen[0], corners_of(one.truth(), test_camera, 100)), 0.5) << one.name;
    }
}

TEST_P(FiducialTracker, FindsASmallMarkerAnywhereBeforeAllTurnsHavePassed) {
    ASSERT_EQ(tracker_.start(test_camera, {{3}}), ARHOST_STATUS_OK);
    std::uint64_t sequence = 1000;
    for (const double x : {-1400, 0, 1400})
        for (const double y : {-1000, 1000}) {
            const Mt truth = pose_of(x, y, 3200, 20, -15, 10);
            const auto seen = track_until_seen(tracker_, picture_of({{tag(3), 100, truth}}), 1, sequence);
            ASSERT_EQ(seen.size(), 1u) << x << ' ' << y;
            EXPECT_LT(greatest_distance_px(seen[0], corners_of(truth, test_camera, 100)), 0.5);
            sequence += 17;
        }
}

TEST_P(FiducialTracker, TakesACloserLookWhereASmallMarkerIsExpected) {
    const Mt small = pose_of(-700, 500, 3200, 20, -15, 10), large = pose_of(60, -20, 500);
    const cv::Mat picture = picture_of({{tag(3), 100, small}, {tag(5), 100, large}});
    ASSERT_EQ(tracker_.start(test_camera, {{3}, {5}}), ARHOST_STATUS_OK);
    ASSERT_EQ(track_until_seen(tracker_, picture, 2).size(), 2u);
    const auto seen =
        tracker_.track(GreyFrame(picture), {expected_at(0, corners_of(small, test_camera, 100))}, false);
    ASSERT_EQ(seen.size(), 1u) << "not by a search of the whole frame";
    EXPECT_EQ(seen[0].id, 3);
}

// A request that expects the corners of a marker here.
TEST_P(FiducialTracker, SearchesOnlyWhereMarkersAreExpected) {
    const Mt here = pose_of(-83, 40, 600, 30, 20, 15), there = pose_of(97, -60, 620, -20, 10, 200);
    const cv::Mat picture = picture_of({{tag(4), 80, here}, {tag(9), 80, there}});
    const auto everywhere = track(picture, {{4, 80}, {9, 80}});
    ASSERT_EQ(everywhere.size(), 2u);
    const auto expected = expected_at(0, corners_of(here, test_camera, 80));
    const auto seen = tracker_.track(GreyFrame(picture), {expected}, false);
    ASSERT_EQ(seen.size(), 1u);
    EXPECT_EQ(seen[0].id, 4);
    EXPECT_EQ(seen[0].hamming, everywhere[0].hamming);
    EXPECT_NEAR(seen[0].decision_margin, everywhere[0].decision_margin, 0.5);
    for (int i = 0; i < 4; ++i) // a refinement that begins elsewhere samples other pixels
        EXPECT_LT(corner_distance_px(seen[0], i, {everywhere[0].corners_px[i][0], everywhere[0].corners_px[i][1]}),
                  3 * seen[0].corner_sigma_px);
}

TEST_P(FiducialTracker, SearchesTheWholeFrameIfATargetIsNotWhereItIsExpected) {
    const Mt here = pose_of(-80, 40, 600), there = pose_of(95, -60, 620), nowhere = pose_of(90, 60, 600);
    const cv::Mat picture = picture_of({{tag(4), 80, here}, {tag(9), 80, there}});
    const auto everywhere = track(picture, {{4, 80}, {9, 80}});
    const auto right = expected_at(0, corners_of(here, test_camera, 80)),
               wrong = expected_at(1, corners_of(nowhere, test_camera, 80));
    const auto seen = tracker_.track(GreyFrame(picture), {right, wrong}, false);
    ASSERT_EQ(seen.size(), 2u);
    EXPECT_EQ(std::memcmp(seen[1].corners_px, everywhere[1].corners_px, sizeof seen[1].corners_px), 0);
    const auto alone = tracker_.track(GreyFrame(picture), {right}, false);
    ASSERT_EQ(alone.size(), 1u);
    EXPECT_EQ(std::memcmp(&seen[0], &alone[0], sizeof seen[0]), 0)
        << "not changed by the search for the other marker";
}

TEST_P(FiducialTracker, FindsExpectedMarkersOfTwoFamiliesAtTheBorderOfTheFrame) {
    const Print other = april_tag("tag25h9", 4).with_margin(1);
    const Mt left = pose_of(-250, 190, 600), right = pose_of(260, -190, 600);
    const cv::Mat picture = picture_of({{tag(4), 80, left}, {other, 80, right}});
    ASSERT_EQ(track(picture, {{4, 80}, {4, 80, "tag25h9"}}).size(), 2u);
    const auto seen = tracker_.track(
        GreyFrame(picture),
        {expected_at(0, corners_of(left, test_camera, 80)), expected_at(1, corners_of(right, test_camera, 80))},
        false);
    ASSERT_EQ(seen.size(), 2u);
    EXPECT_LT(greatest_distance_px(seen[0], corners_of(left, test_camera, 80)), 0.2);
    EXPECT_LT(greatest_distance_px(seen[1], corners_of(right, test_camera, 80)), 0.2);
}

TEST_P(FiducialTracker, SearchesRegionsOfTinyFrames) {
    for (const cv::Size size : {cv::Size(1, 1), cv::Size(3, 40), cv::Size(40, 20)}) {
        const cv::Mat picture(size, CV_8UC1, cv::Scalar(128));
        ASSERT_THAT(track(picture, {{4}}), testing::IsEmpty());
        const auto expected = expected_at(0, {cv::Point2d(-3, -3), {9, -3}, {9, 9}, {-3, 9}});
        EXPECT_THAT(tracker_.track(GreyFrame(picture), {expected}, false), testing::IsEmpty());
    }
}

TEST_P(FiducialTracker, ReportsAMarkerInTheSameWayIfAnotherOneIsMissed) {
    const cv::Mat picture = picture_of({{tag(3), 100, pose_of(20, 10, 400, 20, 10, 30)}});
    ASSERT_EQ(tracker_.start(test_camera, {{3}}), ARHOST_STATUS_OK);
    const auto alone = tracker_.track(GreyFrame(picture));
    ASSERT_EQ(tracker_.start(test_camera, {{3}, {4}}), ARHOST_STATUS_OK); // takes closer looks for marker 4
    for (const std::uint64_t sequence : {0, 1}) {
        const auto seen = tracker_.track(GreyFrame(picture, ARHOST_TRANSFER_LINEAR, sequence));
        ASSERT_EQ(seen.size(), 1u);
        EXPECT_EQ(std::memcmp(seen.data(), alone.data(), sizeof seen[0]), 0);
    }
}

// The corners of the enlarged picture must not be shifted by a part of a pixel.
TEST_P(FiducialTracker, FindsCornersOfSmallMarkersWithoutBias) {
    Options options = GetParam().options;
    options["corner_refinement"] = "none";
    Tracker tracker(GetParam().plugin, options);
    ASSERT_EQ(tracker.start(test_camera, {{3}}), ARHOST_STATUS_OK);
    cv::Point2d bias;
    int found = 0;
    for (int i = 0; i < 40; ++i) {
        const Mt truth = pose_of(10 + 0.37 * i, 5 - 0.29 * i, 450 * 100 / 14.0, 30, 0, 9 * i);
        const auto seen = track_until_seen(tracker, picture_of({{tag(3), 100, truth}}));
        if (seen.empty())
            continue;
        const auto corners = corners_of(truth, test_camera, 100);
        for (int k = 0; k < 4; ++k)
            bias += cv::Point2d(seen[0].corners_px[k][0], seen[0].corners_px[k][1]) - corners[k];
        ++found;
    }
    EXPECT_GE(found, 20);
    EXPECT_LT(cv::norm(bias) / (4.0 * found), 0.15);
}

TEST_P(FiducialTracker, DoesNotModifyTheFrame) {
    const cv::Mat picture = picture_of({{tag(3), 100, pose_of(0, 0, 400)}});
    for (const std::vector<Listed> &listed : {std::vector<Listed>{{3}}, {{3}, {4}}}) { // closer looks for marker 4
        ASSERT_EQ(tracker_.start(test_camera, listed), ARHOST_STATUS_OK);
        for (const std::uint64_t sequence : {0, 1}) {
            const GreyFrame frame(picture, ARHOST_TRANSFER_LINEAR, sequence);
            const std::vector<uint8_t> before(frame.slot().data(), frame.slot().data() + frame.slot().size());
            EXPECT_EQ(tracker_.track(frame).size(), 1u);
            EXPECT_TRUE(std::equal(before.begin(), before.end(), frame.slot().data()));
            EXPECT_TRUE(frame.slot().intact());
        }
    }
}

} // namespace arhost::test
