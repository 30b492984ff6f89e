// SPDX-License-Identifier: Apache-2.0
#include <fiducial/clutter.hpp>
#include <fiducial/fiducial_tracker_test.hpp>
#include <fiducial/real_photos.hpp>

namespace {

using namespace arhost::test;
using testing::EndsWith;
using testing::HasSubstr;

const std::vector<TrackerCase> cases{
    {"Defaults", "tracker_apriltag", {}, {{"threads", "5"}}},
    {"TwoThirdsOfTheResolution", "tracker_apriltag", {{"quad_decimate", "1.5"}}, {{"threads", "4"}}},
    {"HalfResolution", "tracker_apriltag", {{"quad_decimate", "2"}}, {{"threads", "3"}}},
    {"BlurredFullResolution",
     "tracker_apriltag",
     {{"quad_decimate", "1"}, {"quad_sigma", "0.8"}},
     {{"threads", "2"}}},
};
INSTANTIATE_TEST_SUITE_P(AprilTag, FiducialTracker, testing::ValuesIn(cases), case_name);

class AprilTagFamily : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(Families, AprilTagFamily,
                         testing::Values("tag36h11", "tag36h10", "tag25h9", "tag16h5", "tagCircle21h7",
                                         "tagCircle49h12", "tagCustom48h12", "tagStandard41h12", "tagStandard52h13"),
                         [](const auto &info) { return info.param; });

TEST_P(AprilTagFamily, FindsTheTagUprightWithTheSideBetweenItsCorners) {
    Tracker tracker("tracker_apriltag");
    for (const Mt &truth : {pose_of(10, 5, 400), pose_of(-20, 10, 450, 25, -20, 160)}) {
        ASSERT_EQ(tracker.start(test_camera, {{0, 80, GetParam()}, {20, 80, GetParam()}}), ARHOST_STATUS_OK)
            << tracker.log();
        const Print print = april_tag(GetParam(), 20).with_margin(1);
        const auto seen = tracker.track(GreyFrame(picture_of({{print, 80, truth}})));
        ASSERT_EQ(seen.size(), 1u);
        EXPECT_EQ(seen[0].id, 20);
        EXPECT_EQ(tracker.family(seen[0]), GetParam());
        EXPECT_LT(greatest_distance_px(seen[0], corners_of(truth, test_camera, 80)), 0.3);
    }
}

TEST_P(AprilTagFamily, RefinesBlurredTagsByTheWholePrint) {
    expect_refined_if_blurred("tracker_apriltag", {20, 80, GetParam()}, april_tag(GetParam(), 20).with_margin(1),
                              0.35, 0.15);
}

TEST_P(AprilTagFamily, FindsUnlistedTagsWithoutWrongBits) {
    Tracker tracker("tracker_apriltag", {{"max_hamming", "2"}}, test_camera, {{0, 80, GetParam()}});
    const Mt truth = pose_of(10, 5, 400, 10, -20, 160);
    for (const auto &[wrong_bits, count] : {std::pair{0, 1u}, {1, 0u}}) {
        const Print print = with_wrong_bits(april_tag(GetParam(), 20), wrong_bits).with_margin(1);
        const auto seen = tracker.track(GreyFrame(picture_of({{print, 80, truth}})));
        ASSERT_EQ(seen.size(), count) << wrong_bits;
        if (count > 0) {
            EXPECT_EQ(seen[0].id, 20);
            EXPECT_LT(greatest_distance_px(seen[0], corners_of(truth, test_camera, 80)), 1);
        }
    }
}

TEST(AprilTagTracker, FindsTagsOfAllFamiliesInOneRun) {
    std::vector<Placed> placed;
    std::vector<Listed> listed;
    for (const auto &type : arhost::apriltag::family_types) {
        const int i = static_cast<int>(listed.size());
        placed.push_back({april_tag(type.name, 20 + i).with_margin(1), 45,
                          pose_of(150 * (i % 3 - 1), 120 * (i / 3 - 1), 500, 10, 5 * i - 20, 40 * i)});
        listed.push_back({20 + i, 45, type.name});
    }
    Tracker tracker("tracker_apriltag", {}, test_camera, listed);
    const auto seen = tracker.track(GreyFrame(picture_of(placed)));
    ASSERT_EQ(seen.size(), listed.size());
    for (std::size_t i = 0; i < seen.size(); ++i) {
        EXPECT_EQ(seen[i].family, i);
        EXPECT_EQ(seen[i].id, listed[i].id);
        const auto &type = arhost::apriltag::family_types[i];
        const std::unique_ptr<apriltag_family_t, void (*)(apriltag_family_t *)> tags(type.create(), type.destroy);
        EXPECT_EQ(seen[i].false_positive_rate, std::ldexp(4, -static_cast<int>(tags->nbits)));
        EXPECT_LT(greatest_distance_px(seen[i], corners_of(placed[i].mt, test_camera, 45)), 0.3) << listed[i].family;
    }
}

ClutterCounts find_tags_in_clutter(const std::string &family, const Options &options) {
    Tracker tracker("tracker_apriltag", options);
    return find_in_clutter(tracker, family, [&](int id) { return april_tag(family, id).with_margin(1); });
}

TEST_P(AprilTagFamily, IsNamedIfTagsOfAnotherOneAreListed) {
    const std::string listed = GetParam() == "tag36h11" ? "tag25h9" : "tag36h11";
    EXPECT_THAT(log_after("tracker_apriltag", listed, april_tag(GetParam(), 20).with_margin(1)),
                EndsWith("other markers were in view: " + GetParam() + " 20\n"));
}

TEST(AprilTagTracker, NamesMarkersOfTheDictionariesOfOpenCv) {
    EXPECT_THAT(log_after("tracker_apriltag", "tag36h11", aruco_marker("DICT_5X5_100", 77)),
                EndsWith("other markers were in view: DICT_5X5_100 77\n"));
}

TEST_P(AprilTagFamily, DefaultsFindTagsAndNoFalseOnesInClutter) {
    const ClutterCounts counts = find_tags_in_clutter(GetParam(), {});
    EXPECT_EQ(counts.false_positives, 0);
    EXPECT_EQ(counts.unlisted, 0);
    EXPECT_EQ(counts.found, counts.pictures);
}

TEST(AprilTagTracker, CorrectionOfBitsInASmallFamilyFindsFalseTagsInClutter) {
    EXPECT_GT(find_tags_in_clutter("tag16h5", {{"max_hamming", "2"}}).false_positives, 20);
}

TEST_P(AprilTagFamily, NamesTheValidIdRange) {
    Tracker tracker("tracker_apriltag");
    EXPECT_EQ(tracker.start(test_camera, {{100000, 100, GetParam()}}), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(tracker.log(), HasSubstr("marker id 100000 is not in " + GetParam() + ", whose ids are 0"));
}

TEST(AprilTagTracker, NamesTheTrackerThatKnowsADictionaryOfOpenCv) {
    Tracker tracker("tracker_apriltag");
    EXPECT_EQ(tracker.start(test_camera, {{0, 100, "tag99h9"}}), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(tracker.log(), testing::Not(HasSubstr("tracker_aruco")));
    EXPECT_EQ(tracker.start(test_camera, {{0, 100, "DICT_6X6_250"}}), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(tracker.log(), HasSubstr("unknown family 'DICT_6X6_250': tracker_apriltag has tag36h11, tag36h10, "));
    EXPECT_THAT(tracker.log(), HasSubstr("tagStandard52h13; tracker_aruco has OpenCV's dictionaries"));
}

TEST(AprilTagTracker, NamesTheTrackersOfPatternsAndPictures) {
    Tracker tracker("tracker_apriltag");
    EXPECT_EQ(tracker.start(test_camera, {{0, 100, "pattern"}}), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(tracker.log(),
                HasSubstr("tracker_apriltag finds no targets with 'pattern'; use the plugin tracker_pattern"));
    EXPECT_EQ(tracker.start(test_camera, {{0, 100, "image"}}), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(tracker.log(),
                HasSubstr("tracker_apriltag finds no targets with 'image'; use the plugin tracker_image"));
}

TEST(AprilTagTracker, RejectsADecimationThatTheLibraryMishandles) {
    Tracker tracker("tracker_apriltag", {{"quad_decimate", "2.5"}});
    EXPECT_EQ(tracker.created(), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(tracker.log(), HasSubstr("quad_decimate: must be 1, 1.5 or an integer"));
}

TEST(AprilTagTracker, FindsEveryTagOf28PxByDefault) {
    const TagPictures pictures({"sharp", 28}, 112);
    Tracker tracker("tracker_apriltag");
    EXPECT_EQ(pictures.show_to(tracker).found, pictures.shown());
}

TEST(AprilTagTracker, FindsABlurredTagInACloserLook) {
    expect_found_in_closer_look("tracker_apriltag", {"blurred", 60, 30, 4.2});
}

TEST(AprilTagTracker, FindsATagWithAHiddenCornerInACloserLook) {
    const cv::Size size(480, 360);
    const auto camera = intrinsics_of(size, 450, 450, 239.5, 179.5), fine = enlarged(camera, 4);
    // One of few poses in which more than ten places of the outline look like corners.
    const Mt truth = {0.541612,  -0.780395, -0.312473, 0, 0.822179, 0.41432, 0.390334, 0,
                      -0.175151, -0.468319, 0.866025,  0, 44.9377,  16.3027, -750,     1};
    cv::Mat picture = render(fine, {{april_tag("tag36h11", 0).with_margin(1), 100, truth}});
    hide_corner(picture, fine, truth, 100, 0.3, 120);
    cv::GaussianBlur(picture, picture, {}, 4 * 0.6);
    cv::resize(picture, picture, size, 0, 0, cv::INTER_AREA);
    add_noise(picture, 1.5, 252);
    for (const auto &[closer_look, count] : {std::pair{"false", 0u}, {"true", 1u}}) {
        Tracker tracker("tracker_apriltag", {{"closer_look", closer_look}}, camera, {{0}});
        const auto seen = track_until_seen(tracker, picture);
        ASSERT_EQ(seen.size(), count) << closer_look;
        for (const arhost_observation &one : seen)
            EXPECT_LT(greatest_distance_px(one, corners_of(truth, camera, 100)), 0.05);
    }
}

TEST(AprilTagTracker, IgnoresTagsBelowTheDecisionMargin) {
    const GreyFrame frame(picture_of({{tag(3), 100, pose_of(0, 0, 400)}}));
    for (const auto &[margin, count] : {std::pair{"20", 1u}, std::pair{"200", 0u}}) {
        Tracker tracker("tracker_apriltag", {{"min_decision_margin", margin}}, test_camera, {{3, 100}});
        EXPECT_EQ(tracker.track(frame).size(), count);
    }
}

TEST(AprilTagTracker, CorrectsTheConfiguredNumberOfWrongBits) {
    const Print damaged = with_wrong_bits(april_tag("tag36h11", 3), 2);
    const GreyFrame frame(picture_of({{damaged.with_margin(1), 100, pose_of(0, 0, 400)}}));
    for (const auto &[bits, count] : {std::pair{"1", 0u}, std::pair{"2", 1u}}) {
        Tracker tracker("tracker_apriltag", {{"max_hamming", bits}}, test_camera, {{3, 100}});
        EXPECT_EQ(tracker.track(frame).size(), count) << bits;
    }
}

TEST(AprilTagTracker, CorrectsByDefaultAsManyWrongBitsAsTheFamilyAllows) {
    for (const auto &[family, wrong_bits, count] :
         {std::tuple{"tag16h5", 1, 0u}, {"tag25h9", 1, 1u}, {"tag25h9", 2, 0u}, {"tag36h11", 2, 1u}}) {
        const Print damaged = with_wrong_bits(april_tag(family, 3), wrong_bits);
        Tracker tracker("tracker_apriltag", {}, test_camera, {{3, 100, family}});
        EXPECT_EQ(tracker.track(GreyFrame(picture_of({{damaged.with_margin(1), 100, pose_of(0, 0, 400)}}))).size(),
                  count)
            << family << ", " << wrong_bits;
    }
}

TEST(AprilTagTracker, AcceptsChangesOfOptionsWhileItTracks) {
    const Print damaged = with_wrong_bits(april_tag("tag36h11", 3), 1);
    const GreyFrame frame(picture_of({{damaged.with_margin(1), 100, pose_of(0, 0, 400)}}));
    Tracker tracker("tracker_apriltag", {}, test_camera, {{3, 100}});
    const auto corners = [&] {
        const auto found = tracker.track(frame);
        return found.empty() ? std::vector<double>()
                             : std::vector<double>(&found[0].corners_px[0][0], &found[0].corners_px[0][0] + 8);
    };
    const auto fitted = corners();
    EXPECT_FALSE(fitted.empty());
    for (const auto &[key, other, initial] :
         {std::tuple{"max_hamming", "0", "-1"}, {"min_decision_margin", "255", "0"}}) {
        EXPECT_EQ(tracker.set(key, other), ARHOST_STATUS_OK) << tracker.log();
        EXPECT_TRUE(corners().empty()) << key;
        EXPECT_EQ(tracker.set(key, initial), ARHOST_STATUS_OK) << tracker.log();
        EXPECT_EQ(corners(), fitted) << key;
    }
    // Without arhost's refinement, the corners show a change of the detection.
    EXPECT_EQ(tracker.set("corner_refinement", "none"), ARHOST_STATUS_OK) << tracker.log();
    const auto library = corners();
    EXPECT_NE(library, fitted);
    for (const auto &[key, other, initial] :
         {std::tuple{"quad_decimate", "4", "1"}, {"quad_sigma", "1.5", "0"}, {"refine_edges", "false", "true"}}) {
        EXPECT_EQ(tracker.set(key, other), ARHOST_STATUS_OK) << tracker.log();
        EXPECT_NE(corners(), library) << key;
        EXPECT_EQ(tracker.set(key, initial), ARHOST_STATUS_OK) << tracker.log();
        EXPECT_EQ(corners(), library) << key;
    }
    EXPECT_EQ(tracker.set("decode_sharpening", "1"), ARHOST_STATUS_OK) << tracker.log();
    EXPECT_EQ(corners(), library);
}

TEST(AprilTagTracker, KeepsItsDecimationIfTheNewOneIsInvalid) {
    const GreyFrame frame(picture_of({{tag(3), 100, pose_of(0, 0, 400)}}));
    Tracker tracker("tracker_apriltag", {}, test_camera, {{3, 100}});
    EXPECT_EQ(tracker.set("quad_decimate", "2.5"), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(tracker.log(), HasSubstr("quad_decimate: must be 1, 1.5 or an integer"));
    EXPECT_EQ(tracker.track(frame).size(), 1u);
}

TEST(AprilTagTracker, LibraryCornersUseTheSamePixelCentres) {
    Tracker tracker("tracker_apriltag", {{"corner_refinement", "none"}, {"quad_decimate", "1"}}, test_camera,
                    {{3, 100}});
    cv::Point2d bias;
    for (int i = 0; i < 6; ++i) {
        const Mt truth = pose_of(7 * i, -5 * i, 450, 10 * i - 25, 20 - 8 * i, 60 * i);
        const auto markers = tracker.track(GreyFrame(picture_of({{tag(3), 100, truth}})));
        ASSERT_EQ(markers.size(), 1u);
        for (int k = 0; k < 4; ++k)
            bias += cv::Point2d(markers[0].corners_px[k][0], markers[0].corners_px[k][1]) -
                    corners_of(truth, test_camera, 100)[k];
    }
    EXPECT_LT(cv::norm(bias) / 24, 0.06);
}

TEST(AprilTagTracker, FindsTheTagsOfTheVispPhoto) {
    ARHOST_REQUIRE_SHARED_DATA("markers/apriltag_photo");
    Tracker tracker("tracker_apriltag");
    expect_april_tag_photo(tracker);
}

TEST(AprilTagTracker, FindsTheTagsOfTheJuliaPhoto) {
    ARHOST_REQUIRE_SHARED_DATA("markers/julia");
    Tracker tracker("tracker_apriltag");
    expect_julia_photo(tracker);
}

TEST(AprilTagTracker, FindsTheTagsOfTheSwatboticsPhotos) {
    ARHOST_REQUIRE_SHARED_DATA("markers/swatbotics");
    Tracker tracker("tracker_apriltag");
    expect_swatbotics_photos(tracker);
}

} // namespace
