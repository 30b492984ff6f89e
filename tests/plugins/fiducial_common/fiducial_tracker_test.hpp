// SPDX-License-Identifier: Apache-2.0
//
// Tests for every fiducial tracker, with the family tag36h11. Each tracker's test program includes this file and
// instantiates the suite FiducialTracker with the tracker's configurations.
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
    std::vector<arhost_marker> track(const cv::Mat &picture, const std::vector<Listed> &listed) {
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

TEST_P(FiducialTracker, RecoversTheRenderedPose) {
    cv::Point2d bias;
    const std::vector<Mt> poses{pose_of(0, 0, 500), pose_of(60, 40, 450, 30, 20, 15),
                                pose_of(-70, 30, 600, -35, 25, 90), pose_of(40, -50, 550, 20, -45, 180),
                                pose_of(-30, -40, 700, -20, -30, -100)};
    for (const Mt &truth : poses) {
        const auto markers = track(picture_of({{tag(17), 100, truth}}), {{17, 100}});
        ASSERT_EQ(markers.size(), 1u);
        const arhost_marker &found = markers[0];
        EXPECT_EQ(found.id, 17);
        EXPECT_STREQ(found.family, "tag36h11");
        EXPECT_LT(angle_degrees(found.mt, truth), 0.7);
        for (int i = 12; i < 15; ++i)
            EXPECT_NEAR(found.mt[i], truth[i], -0.003 * truth[14]);
        EXPECT_LT(found.reprojection_px, 0.1);
        const auto corners = corners_of(truth, test_camera, 100);
        for (int k = 0; k < 4; ++k) {
            EXPECT_LT(corner_distance_px(found, k, corners[k]), 0.2);
            bias += cv::Point2d(found.corners_px[k][0], found.corners_px[k][1]) - corners[k];
        }
    }
    // Fails if the tracker does not put pixel centres at integers: the bias would then be half a pixel.
    EXPECT_LT(cv::norm(bias) / (4.0 * static_cast<double>(poses.size())), 0.03);
}

TEST_P(FiducialTracker, FacingTagHasXRightYUpAndZTowardsTheViewer) {
    const auto upright = track(picture_of({{tag(3), 100, pose_of(20, 30, 400)}}), {{3, 100}});
    ASSERT_EQ(upright.size(), 1u);
    EXPECT_LT(angle_degrees(upright[0].mt, pose_of(0, 0, 1)), 1);
    EXPECT_NEAR(upright[0].mt[12], 20, 1);
    EXPECT_NEAR(upright[0].mt[13], 30, 1);
    EXPECT_NEAR(upright[0].mt[14], -400, 2);
    EXPECT_LT(upright[0].corners_px[0][0], upright[0].corners_px[1][0]); // top-left is left of top-right
    EXPECT_LT(upright[0].corners_px[0][1], upright[0].corners_px[3][1]); // top-left is above bottom-left

    for (const double turn : {90.0, 180.0, 270.0}) {
        const auto turned = track(picture_of({{tag(3), 100, pose_of(0, 0, 400, 0, 0, turn)}}), {{3, 100}});
        ASSERT_EQ(turned.size(), 1u);
        EXPECT_LT(angle_degrees(turned[0].mt, pose_of(0, 0, 1, 0, 0, turn)), 1);
    }
}

TEST_P(FiducialTracker, CorrectsLensDistortion) {
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

    ASSERT_EQ(tracker_.start(lens, {{8, 110}}), ARHOST_STATUS_OK);
    const auto markers = tracker_.track(GreyFrame(bent));
    ASSERT_EQ(markers.size(), 1u);
    EXPECT_GT(corner_distance_px(markers[0], 1, corners_of(truth, test_camera, 110)[1]), 5);
    for (int k = 0; k < 4; ++k)
        EXPECT_LT(corner_distance_px(markers[0], k, corners_of(truth, lens, 110)[k]), 0.1);
    EXPECT_LT(angle_degrees(markers[0].mt, truth), 0.5);
    for (int i = 12; i < 15; ++i)
        EXPECT_NEAR(markers[0].mt[i], truth[i], 0.002 * 450);
}

TEST_P(FiducialTracker, ReportsOnlyListedMarkersInTheirListedOrder) {
    const cv::Mat picture = picture_of({{tag(5), 60, pose_of(-100, 60, 500)},
                                        {tag(2), 80, pose_of(100, 60, 500)},
                                        {tag(586), 70, pose_of(0, -60, 500)}});
    const auto ids = [&](const std::vector<Listed> &listed) {
        std::vector<int> found;
        for (const auto &marker : track(picture, listed))
            found.push_back(marker.id);
        return found;
    };
    EXPECT_THAT(ids({{5, 60}, {2, 80}}), testing::ElementsAre(5, 2));
    EXPECT_THAT(ids({{586, 70}, {7}, {2, 80}}), testing::ElementsAre(586, 2));
    EXPECT_THAT(ids({{7}, {9}}), testing::IsEmpty());
    for (const auto &marker : track(picture, {{2, 80}, {5, 60}, {586, 70}}))
        EXPECT_NEAR(marker.mt[14], -500,
                    2); // correct only if the tracker uses the side length listed for this marker
}

TEST_P(FiducialTracker, ReportsAMarkerOnceIfItIsSeenTwice) {
    const cv::Mat picture = picture_of({{tag(5), 80, pose_of(-90, 20, 500)}, {tag(5), 80, pose_of(90, -20, 500)}});
    const auto first = track(picture, {{5, 80}});
    ASSERT_EQ(first.size(), 1u);
    EXPECT_NEAR(std::abs(first[0].mt[12]), 90, 2);
    const auto second = track(picture, {{5, 80}});
    ASSERT_EQ(second.size(), 1u);
    EXPECT_EQ(std::memcmp(first.data(), second.data(), sizeof(arhost_marker)), 0);
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
    EXPECT_THAT(tracker_.log(), testing::HasSubstr("marker id 587 is not in tag36h11, whose ids are 0 to 586"));
    EXPECT_EQ(tracker_.start(test_camera, {{0}, {586}}), ARHOST_STATUS_OK);
}

TEST_P(FiducialTracker, ReportsNoWrongPoseWithAHiddenCorner) {
    const Mt truth = pose_of(10, 5, 450, 25, -20, 30);
    const cv::Mat whole = picture_of({{tag(17), 100, truth}});
    const auto corners = corners_of(truth, test_camera, 100);
    for (int hidden = 0; hidden < 4; ++hidden)
        for (const int radius_px : {4, 8, 14, 22, 30})
            for (const int grey : {20, 120, 230}) {
                cv::Mat picture = whole.clone();
                cv::circle(picture, corners[hidden], radius_px, cv::Scalar(grey), cv::FILLED);
                for (const arhost_marker &marker : track(picture, {{17, 100}})) {
                    EXPECT_LT(angle_degrees(marker.mt, truth), 5)
                        << "corner " << hidden << " radius " << radius_px << " grey " << grey;
                    EXPECT_NEAR(marker.mt[14] / truth[14], 1, 0.02)
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
        EXPECT_EQ(refined.found, plain.found);
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
        EXPECT_EQ(std::memcmp(several.data(), single.data(), single.size() * sizeof(arhost_marker)), 0);
    }
    EXPECT_EQ(single.size(), 12u);
    cv::setNumThreads(threads);
}

TEST_P(FiducialTracker, DoesNotModifyTheFrame) {
    const GreyFrame frame(picture_of({{tag(3), 100, pose_of(0, 0, 400)}}));
    const std::vector<uint8_t> before(frame.slot().data(), frame.slot().data() + frame.slot().size());
    ASSERT_EQ(tracker_.start(test_camera, {{3, 100}}), ARHOST_STATUS_OK);
    EXPECT_EQ(tracker_.track(frame).size(), 1u);
    EXPECT_TRUE(std::equal(before.begin(), before.end(), frame.slot().data()));
    EXPECT_TRUE(frame.slot().intact());
}

} // namespace arhost::test
