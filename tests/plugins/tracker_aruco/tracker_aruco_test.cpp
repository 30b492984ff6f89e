// SPDX-License-Identifier: Apache-2.0
#include <fiducial/clutter.hpp>
#include <fiducial/fiducial_tracker_test.hpp>
#include <fiducial/real_photos.hpp>
#include <fiducial/tag_sheet.hpp>

#include <nlohmann/json.hpp>

namespace {

using namespace arhost::test;
using testing::EndsWith;
using testing::HasSubstr;

const std::vector<TrackerCase> cases{{"Defaults", "tracker_aruco", {}, {}}};
INSTANTIATE_TEST_SUITE_P(Aruco, FiducialTracker, testing::ValuesIn(cases), case_name);

// Returns the AprilTag library's name of the dictionary, or "" if it is not an AprilTag family.
std::string april_tag_family(const std::string &dictionary) {
    const std::string prefix = "DICT_APRILTAG_";
    return dictionary.starts_with(prefix) ? "tag" + dictionary.substr(prefix.size()) : "";
}

// Markers of AprilTag families are drawn by the AprilTag library, other markers by OpenCV.
Print print_of(const std::string &dictionary, int id) {
    const std::string family = april_tag_family(dictionary);
    return family.empty() ? aruco_marker(dictionary, id) : april_tag(family, id).with_margin(1);
}

std::vector<std::string> dictionary_names() {
    std::vector<std::string> names;
    for (const auto &type : arhost::aruco::dictionary_types)
        names.emplace_back(type.option);
    return names;
}

class ArucoDictionary : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(Dictionaries, ArucoDictionary, testing::ValuesIn(dictionary_names()),
                         [](const auto &info) { return info.param; });

TEST_P(ArucoDictionary, FindsTheMarkerUpright) {
    const std::string dictionary = GetParam();
    Tracker tracker("tracker_aruco", {}, test_camera, {{7, 80, dictionary}, {21, 80, dictionary}});
    const Print print = print_of(dictionary, 21);
    for (const Mt &truth : {pose_of(10, 5, 400), pose_of(-20, 10, 450, 25, -20, 110)}) {
        const auto seen = tracker.track(GreyFrame(picture_of({{print, 80, truth}})));
        ASSERT_EQ(seen.size(), 1u);
        EXPECT_EQ(seen[0].id, 21);
        EXPECT_EQ(tracker.family(seen[0]), dictionary);
        EXPECT_EQ(seen[0].hamming, 0u);
        EXPECT_LT(greatest_distance_px(seen[0], corners_of(truth, test_camera, 80)), 0.2);
    }
}

TEST_P(ArucoDictionary, RefinesBlurredMarkersByTheWholePrint) {
    const std::string dictionary = GetParam();
    expect_refined_if_blurred("tracker_aruco", {21, 80, dictionary}, print_of(dictionary, 21), 0.3, 0.1);
}

TEST_P(ArucoDictionary, FindsUnlistedMarkers) {
    const std::string dictionary = GetParam();
    Tracker tracker("tracker_aruco", {}, test_camera, {{7, 80, dictionary}});
    const Print print = print_of(dictionary, 21);
    const Mt truth = pose_of(10, 5, 400, 10, -20, 160);
    const auto seen = tracker.track(GreyFrame(picture_of({{print, 80, truth}})));
    ASSERT_EQ(seen.size(), 1u);
    EXPECT_EQ(seen[0].id, 21);
    EXPECT_EQ(seen[0].hamming, 0u);
    const int bits = (print.corner_cells - 2) * (print.corner_cells - 2);
    EXPECT_EQ(seen[0].false_positive_rate, std::ldexp(4, -bits));
    EXPECT_LT(greatest_distance_px(seen[0], corners_of(truth, test_camera, 80)), 2.5);
}

TEST_P(ArucoDictionary, IsNamedIfMarkersOfAnotherOneAreListed) {
    const std::string dictionary = GetParam(), family = april_tag_family(dictionary);
    const std::string listed = family == "tag36h11" ? "tag25h9" : "tag36h11";
    const Print print = print_of(dictionary, 21);
    // All of DICT_4X4_50, DICT_4X4_100 and so on have the marker 21.
    const std::string count = dictionary.substr(dictionary.rfind('_') + 1);
    const bool is_of_series = dictionary[6] == 'X';
    const std::string named = !family.empty() ? family
                              : is_of_series  ? dictionary.substr(0, dictionary.size() - count.size()) + "50"
                                              : dictionary;
    EXPECT_THAT(log_after("tracker_aruco", listed, print),
                EndsWith("other markers were in view: " + named + " 21\n"));
}

TEST(TrackerAruco, NamesTheSmallestDictionaryWithAllMarkersOfASeries) {
    EXPECT_THAT(log_after("tracker_aruco", "DICT_6X6_50", aruco_marker("DICT_6X6_1000", 249)),
                EndsWith("other markers were in view: DICT_6X6_250 249\n"));
    EXPECT_EQ(log_after("tracker_aruco", "DICT_6X6_50", aruco_marker("DICT_6X6_1000", 49)), "")
        << "it is a marker of the listed dictionary";
}

TEST(TrackerAruco, NamesTagsThatOpenCvDoesNotKnow) {
    EXPECT_THAT(log_after("tracker_aruco", "DICT_6X6_50", april_tag("tagStandard41h12", 20).with_margin(1)),
                EndsWith("other markers were in view: tagStandard41h12 20\n"));
}

// Expected markers are read at their places before they are searched for.
TEST_P(ArucoDictionary, IsReportedInTheSameWayWhereverAndHoweverItIsExpected) {
    const std::string dictionary = GetParam();
    const Mt truth = pose_of(10, 5, 400, 10, -20, 160);
    const GreyFrame frame(picture_of({{print_of(dictionary, 21), 80, truth}}));
    Tracker tracker("tracker_aruco", {}, test_camera, {{21, 80, dictionary}, {7, 80, dictionary}});
    const auto corners = corners_of(truth, test_camera, 80);
    const cv::Point2d cell_px = (corners[1] - corners[0]) / print_of(dictionary, 21).corner_cells;
    for (const std::uint32_t marker : {0U, 1U}) // 1: where it is, marker 7 is expected
        for (const double cells : {0.0, 0.3, 0.6, 1.5})
            for (const auto &[turn, everywhere] :
                 {std::pair(0, false), {1, false}, {2, false}, {3, false}, {0, true}, {1, true}}) {
                auto expected_corners = corners;
                for (int i = 0; i < 4; ++i)
                    expected_corners[i] = corners[(i + turn) % 4] + cells * cell_px;
                auto expected = expected_at(marker, expected_corners);
                expected.margin_px = 2 * cv::norm(cell_px);
                const auto seen = tracker.track(frame, {expected}, everywhere);
                ASSERT_EQ(seen.size(), 1u) << marker << ' ' << cells << ' ' << turn << ' ' << everywhere;
                EXPECT_EQ(seen[0].id, 21);
                EXPECT_EQ(seen[0].hamming, 0u);
                EXPECT_LT(greatest_distance_px(seen[0], corners), 0.1) << marker << ' ' << cells << ' ' << turn;
            }
}

TEST(TrackerAruco, AnExpectedMarkerIsReadAlsoIfItIsNotDetected) {
    const Mt truth = pose_of(10, 5, 400);
    Tracker tracker("tracker_aruco", {{"closer_look", "false"}}, test_camera, {{5}});
    cv::Mat dim;
    picture_of({{tag(5), 80, truth}}).convertTo(dim, -1, 0.04, 100); // below OpenCV's threshold of contrast
    const GreyFrame frame(dim);
    EXPECT_TRUE(tracker.track(frame).empty());
    for (const bool everywhere : {false, true}) {
        const auto seen = tracker.track(frame, {expected_at(0, corners_of(truth, test_camera, 80))}, everywhere);
        ASSERT_EQ(seen.size(), 1u) << everywhere;
        EXPECT_LT(greatest_distance_px(seen[0], corners_of(truth, test_camera, 80)), 0.2);
    }
}

TEST(TrackerAruco, AnExpectedMarkerWithAWrongCellIsNotReadButDetected) {
    const Mt truth = pose_of(10, 5, 400);
    Tracker tracker("tracker_aruco", {}, test_camera, {{5}});
    const auto expected = expected_at(0, corners_of(truth, test_camera, 80));
    const GreyFrame frame(picture_of({{with_wrong_bits(tag(5), 1), 80, truth}}));
    const auto seen = tracker.track(frame, {expected}, false);
    ASSERT_EQ(seen.size(), 1u);
    EXPECT_EQ(seen[0].hamming, 1u);
    const double nan = std::numeric_limits<double>::quiet_NaN();
    for (const double outside : {-50.0, 1e9, nan}) {
        auto moved = expected;
        moved.corners_px[2][0] = outside;
        EXPECT_LE(tracker.track(frame, {moved}, false).size(), 1u);
    }
}

// A dot in a cell does not change the bit, but squares in clutter have such cells, and prints have not.
TEST(TrackerAruco, SmallMarkersWithSpottedCellsAreNoEvidence) {
    const Mt truth = pose_of(10, 5, 400);
    const auto rate_with_dot = [&](const std::string &dictionary, int cells) {
        cv::Mat picture = picture_of({{aruco_marker(dictionary, 21), 80, truth}});
        const auto corners = corners_of(truth, test_camera, 80);
        const double cell_px = cv::norm(corners[1] - corners[0]) / cells;
        const cv::Point2d dot = corners[0] + (corners[2] - corners[0]) * (0.375 / cells); // in the border
        cv::circle(picture, dot, static_cast<int>(0.2 * cell_px), cv::Scalar(255), cv::FILLED);
        Tracker tracker("tracker_aruco");
        EXPECT_EQ(tracker.start(test_camera, {{21, 80, dictionary}}), ARHOST_STATUS_OK) << tracker.log();
        const auto seen = tracker.track(GreyFrame(picture));
        return seen.size() == 1 ? seen[0].false_positive_rate : -1;
    };
    EXPECT_EQ(rate_with_dot("DICT_4X4_50", 6), 1);
    EXPECT_EQ(rate_with_dot("DICT_6X6_50", 8), std::ldexp(4, -36));
}

ClutterCounts find_markers_in_clutter(const std::string &dictionary, const Options &options) {
    const std::string family = april_tag_family(dictionary);
    Tracker tracker("tracker_aruco", options);
    return find_in_clutter(tracker, dictionary, [&](int id) {
        return family.empty() ? aruco_marker(dictionary, id) : april_tag(family, id).with_margin(1);
    });
}

TEST_P(ArucoDictionary, DefaultsFindMarkersAndNoFalseOnesInClutter) {
    const ClutterCounts counts = find_markers_in_clutter(GetParam(), {});
    EXPECT_EQ(counts.false_positives, 0);
    // 6 % of all patterns of 16 bits are a marker of DICT_4X4_1000.
    EXPECT_LE(counts.unlisted, GetParam() == "DICT_4X4_1000" ? 10 : 0);
    EXPECT_EQ(counts.found, counts.pictures);
}

TEST(ArucoTracker, CorrectionOfBitsInASmallDictionaryFindsFalseMarkersInClutter) {
    EXPECT_GT(find_markers_in_clutter("DICT_APRILTAG_16h5", {{"error_correction_rate", "1"}}).false_positives, 2);
}

struct Refinement {
    const char *name;
    double mean_px, bias_px; // upper bounds of the mean error and the bias
};

void PrintTo(const Refinement &refinement, std::ostream *out) {
    *out << refinement.name;
}

class ArucoRefinement : public testing::TestWithParam<Refinement> {};
INSTANTIATE_TEST_SUITE_P(Refinements, ArucoRefinement,
                         testing::Values(Refinement{"edges", 0.05, 0.02}, Refinement{"none", 1.0, 0.2},
                                         Refinement{"subpix", 0.4, 0.1}, Refinement{"contour", 0.9, 0.1},
                                         Refinement{"apriltag", 0.2, 0.12}),
                         [](const auto &info) { return std::string(info.param.name); });

TEST_P(ArucoRefinement, PlacesPixelCentresAtIntegers) {
    Tracker tracker("tracker_aruco", {{"corner_refinement", GetParam().name}}, test_camera, {{3, 100}});
    cv::Point2d bias;
    double error = 0;
    for (int i = 0; i < 6; ++i) {
        const Mt truth = pose_of(7 * i, -5 * i, 450, 10 * i - 25, 20 - 8 * i, 60 * i);
        const auto seen = tracker.track(GreyFrame(picture_of({{tag(3), 100, truth}})));
        ASSERT_EQ(seen.size(), 1u);
        const auto corners = corners_of(truth, test_camera, 100);
        for (int k = 0; k < 4; ++k) {
            bias += cv::Point2d(seen[0].corners_px[k][0], seen[0].corners_px[k][1]) - corners[k];
            error += corner_distance_px(seen[0], k, corners[k]);
        }
    }
    EXPECT_LT(cv::norm(bias) / 24, GetParam().bias_px);
    EXPECT_LT(error / 24, GetParam().mean_px);
}

TEST(ArucoTracker, ReadsADictionaryFile) {
    const ScratchFolder scratch;
    const auto file = scratch.path() / "mine.yml";
    std::ofstream(file) << "%YAML:1.0\nnmarkers: 2\nmarkersize: 4\nmaxCorrectionBits: 1\n"
                           "marker_0: \"1011010011100010\"\nmarker_1: \"0100111010011101\"\n";
    Print print{cv::Mat_<uint8_t>(6, 6, uint8_t{0}), 6};
    const std::string bits = "0100111010011101";
    for (int i = 0; i < 16; ++i)
        print.cells(1 + i / 4, 1 + i % 4) = bits[i] == '1' ? 255 : 0;
    Tracker tracker("tracker_aruco", {{"dictionary_file", file.string()}}, test_camera,
                    {{0, 80, "mine"}, {1, 80, "mine"}, {3, 60}});
    const Mt truth = pose_of(10, 20, 400, 20, 20, 30), other = pose_of(-110, -60, 450);
    const auto seen = tracker.track(GreyFrame(picture_of({{print.with_margin(1), 80, truth}, {tag(3), 60, other}})));
    ASSERT_EQ(seen.size(), 2u);
    EXPECT_EQ(seen[0].id, 1);
    EXPECT_EQ(tracker.family(seen[0]), "mine");
    EXPECT_LT(greatest_distance_px(seen[0], corners_of(truth, test_camera, 80)), 0.2);
    EXPECT_EQ(seen[1].id, 3);
    EXPECT_EQ(tracker.family(seen[1]), "tag36h11");
    EXPECT_EQ(tracker.start(test_camera, {{2, 80, "mine"}}), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(tracker.log(), HasSubstr("marker id 2 is not in mine, whose ids are 0 to 1"));
    EXPECT_EQ(tracker.start(test_camera, {{2, 80, "yours"}}), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(tracker.log(), HasSubstr("unknown dictionary 'yours': tracker_aruco has mine (dictionary_file), "));
}

TEST(ArucoTracker, TakesADictionaryFromTheFileOfItsName) {
    const ScratchFolder scratch;
    const auto file = scratch.path() / "DICT_4X4_50.yml"; // has the marker 7 of DICT_5X5_50 as its only marker
    const auto table = arhost::aruco::predefined(cv::aruco::DICT_5X5_50);
    const cv::Mat bits = cv::aruco::Dictionary::getBitsFromByteList(table.bytesList.row(7), 5);
    std::string text;
    for (const uint8_t bit : cv::Mat_<uint8_t>(bits))
        text += bit ? '1' : '0';
    std::ofstream(file) << "%YAML:1.0\nnmarkers: 1\nmarkersize: 5\nmaxCorrectionBits: 1\nmarker_0: \"" << text
                        << "\"\n";
    Tracker tracker("tracker_aruco", {{"dictionary_file", file.string()}}, test_camera, {{0, 80, "DICT_4X4_50"}});
    const auto seen =
        tracker.track(GreyFrame(picture_of({{aruco_marker("DICT_5X5_50", 7), 80, pose_of(0, 0, 400)}})));
    ASSERT_EQ(seen.size(), 1u);
    EXPECT_EQ(seen[0].id, 0);
}

TEST(ArucoTracker, NamesTheTrackerThatKnowsMoreFamiliesOfAprilTag) {
    Tracker tracker("tracker_aruco");
    EXPECT_EQ(tracker.start(test_camera, {{0, 100, "DICT_9X9_9"}}), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(tracker.log(), testing::Not(HasSubstr("tracker_apriltag")));
    EXPECT_THAT(tracker.log(), HasSubstr("'dictionary_file' loads others"));
    EXPECT_EQ(tracker.start(test_camera, {{0, 100, "tagStandard41h12"}}), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(tracker.log(),
                testing::AllOf(HasSubstr("unknown dictionary 'tagStandard41h12': tracker_aruco has tag36h11, "),
                               HasSubstr("DICT_6X6_250"), HasSubstr("; tracker_apriltag has more families")));
}

// Each begins with the markers of the smaller one, so a print may be a marker of both.
TEST(ArucoTracker, HasExaminedAtLeastAsManyCandidatesAsItReports) {
    Tracker tracker("tracker_aruco", {}, test_camera, {{3, 100, "DICT_6X6_50"}, {3, 100, "DICT_6X6_100"}});
    const cv::Mat picture =
        render(test_camera, {{aruco_marker("DICT_6X6_50", 3).with_margin(2), 100, pose_of(0, 0, 400, 20, 10, 30)}});
    const auto seen = tracker.track(GreyFrame(picture));
    EXPECT_EQ(seen.size(), 2u);
    EXPECT_GE(tracker.candidate_count(), 2);
    EXPECT_TRUE(tracker.track(GreyFrame(cv::Mat(480, 640, CV_8U, cv::Scalar(128)))).empty());
    EXPECT_EQ(tracker.candidate_count(), 0);
}

TEST(ArucoTracker, NamesTheTrackersOfPatternsAndPictures) {
    Tracker tracker("tracker_aruco");
    EXPECT_EQ(tracker.start(test_camera, {{0, 100, "image"}}), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(tracker.log(),
                HasSubstr("tracker_aruco finds no targets with 'image'; use the plugin tracker_image"));
}

TEST(ArucoTracker, CorrectsAtMostThreeWrongBitsOf36ByDefault) {
    const ScratchFolder scratch;
    const auto file = scratch.path() / "mine.yml"; // like that of DICT_ARUCO_MIP_36h12, which allows 12 wrong bits
    const std::string bits = "101100111000110101001011100110010110";
    std::ofstream(file) << "%YAML:1.0\nnmarkers: 1\nmarkersize: 6\nmaxCorrectionBits: 12\nmarker_0: \"" << bits
                        << "\"\n";
    Tracker tracker("tracker_aruco", {{"dictionary_file", file.string()}}, test_camera, {{0, 100, "mine"}});
    for (const auto &[wrong_bits, count] : {std::pair{0, 1u}, {3, 1u}, {4, 0u}}) {
        Print print{cv::Mat_<uint8_t>(8, 8, uint8_t{0}), 8};
        for (int i = 0; i < 36; ++i)
            print.cells(1 + i / 6, 1 + i % 6) = (bits[i] == '1') != (i < wrong_bits) ? 255 : 0;
        EXPECT_EQ(tracker.track(GreyFrame(picture_of({{print.with_margin(1), 100, pose_of(0, 0, 400)}}))).size(),
                  count)
            << wrong_bits;
    }
}

TEST(ArucoTracker, RejectsAFileThatIsNotADictionary) {
    const ScratchFolder scratch;
    const auto file = scratch.path() / "bad.yml";
    const std::string header = "%YAML:1.0\n";
    for (const std::string &text : {std::string(), std::string("not yaml at all {"), header + "nmarkers: 2\n",
                                    header + "nmarkers: 0\nmarkersize: 4\n",
                                    header + "nmarkers: 2\nmarkersize: 4\nmarker_0: \"1011010011100010\"\n",
                                    header + "nmarkers: 1\nmarkersize: 4\nmarker_0: \"101\"\n",
                                    header + "nmarkers: 1\nmarkersize: 4\nmarker_0: \"101101001110001x\"\n",
                                    header + "nmarkers: -1\nmarkersize: -4\nmarker_0: \"1\"\n",
                                    header + "nmarkers: 2000000000\nmarkersize: 1000\nmarker_0: \"1\"\n"}) {
        std::ofstream(file) << text;
        Tracker tracker("tracker_aruco", {{"dictionary_file", file.string()}});
        EXPECT_EQ(tracker.created(), ARHOST_STATUS_ERROR_CONFIGURATION) << text;
        EXPECT_THAT(tracker.log(), HasSubstr("dictionary_file: '" + file.string() + "' is not a dictionary")) << text;
    }
    Tracker absent("tracker_aruco", {{"dictionary_file", (scratch.path() / "absent.yml").string()}});
    EXPECT_EQ(absent.created(), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(absent.log(), HasSubstr("absent.yml' cannot be read"));
}

TEST(ArucoTracker, FindsADimMarkerInACloserLook) {
    expect_found_in_closer_look("tracker_aruco", {"dim", 60, 30, 0.6, 0.06});
}

TEST(ArucoTracker, FindsSmallMarkersInACloserLook) {
    expect_found_in_closer_look("tracker_aruco", {"small", 13});
}

// A closer look takes a part of the budget for the refinement of prints, but only one, however many families it
// searches.
TEST(ArucoTracker, RefinesFewerPrintsIfItLooksCloser) {
    const TagSheet &sheet = few_tags;
    const GreyFrame frame = sheet.frame(exposures[2]);
    std::vector<Listed> listed;
    for (int id = 0; id < sheet.count(); ++id)
        listed.push_back({id});
    const auto seen = [&](const std::vector<Listed> &missed, const Options &options = {}) {
        std::vector<Listed> all = listed;
        all.insert(all.end(), missed.begin(), missed.end());
        return Tracker("tracker_aruco", options, plain_camera(sheet.size), all).track(frame);
    };
    const auto all = seen({}), some = seen({{100}}), of_two_families = seen({{100}, {100, 100, "tag36h10"}});
    const auto same = [](const auto &a, const auto &b) {
        return std::ranges::count_if(a, [&](const arhost_observation &one) {
            return std::ranges::any_of(b, [&](const arhost_observation &other) {
                return other.id == one.id &&
                       std::memcmp(other.corners_px, one.corners_px, sizeof one.corners_px) == 0;
            });
        });
    };
    ASSERT_EQ(all.size(), listed.size());
    EXPECT_GE(same(all, some), 2);
    EXPECT_LT(same(all, some), std::ssize(all));
    EXPECT_EQ(same(some, of_two_families), std::ssize(some));
    EXPECT_EQ(same(all, seen({{100}}, {{"closer_look", "false"}})), std::ssize(all));
}

TEST(ArucoTracker, LooksCloserAtTinyFramesWithEachRefinement) {
    for (const std::string refinement : {"edges", "none", "subpix", "contour", "apriltag"}) {
        Tracker tracker("tracker_aruco", {{"corner_refinement", refinement}});
        for (const cv::Size size :
             {cv::Size(1, 1), cv::Size(2, 3), cv::Size(7, 7), cv::Size(1, 200), cv::Size(33, 9)}) {
            cv::Mat picture(size, CV_8U, cv::Scalar(128));
            add_noise(picture, 60, 4);
            ASSERT_EQ(tracker.start(plain_camera(size), {{3}}), ARHOST_STATUS_OK) << tracker.log();
            const auto expected = expected_at(0, {cv::Point2d(-3, -3), {9, -3}, {9, 9}, {-3, 9}});
            EXPECT_TRUE(tracker.track(GreyFrame(picture), {expected}, true).empty()) << refinement << ' ' << size;
            EXPECT_TRUE(track_until_seen(tracker, picture).empty()) << refinement << ' ' << size;
        }
    }
}

// By chance, clutter looks like a marker of a small family more often the closer the tracker looks.
TEST(ArucoTracker, TakesNoCloserLookForASmallFamily) {
    Tracker tracker("tracker_aruco", {}, test_camera, {{3, 100, "DICT_5X5_50"}});
    const Difficult dim{"dim", 60, 30, 0.6, 0.06};
    EXPECT_TRUE(track_until_seen(tracker, dim.picture(aruco_marker("DICT_5X5_50", 3))).empty());
}

TEST(ArucoTracker, RejectsContradictoryThresholdWindows) {
    Tracker tracker("tracker_aruco", {{"threshold_window_min_px", "31"}, {"threshold_window_max_px", "23"}});
    EXPECT_EQ(tracker.created(), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(tracker.log(), HasSubstr("threshold_window_max_px: must not be less than threshold_window_min_px"));
}

TEST(ArucoTracker, FindsInvertedMarkersOnlyIfEnabled) {
    const GreyFrame frame(255 -
                          picture_of({{aruco_marker("DICT_5X5_50", 9).with_margin(2), 80, pose_of(0, 0, 400)}}));
    for (const auto &[inverted, count] : {std::pair{"false", 0u}, std::pair{"true", 1u}}) {
        Tracker tracker("tracker_aruco", {{"inverted", inverted}}, test_camera, {{9, 80, "DICT_5X5_50"}});
        const auto seen = tracker.track(frame);
        ASSERT_EQ(seen.size(), count) << inverted;
        if (count) {
            EXPECT_LT(greatest_distance_px(seen[0], corners_of(pose_of(0, 0, 400), test_camera, 80)), 0.2);
            EXPECT_EQ(seen[0].hamming, 0u);
            EXPECT_GT(seen[0].decision_margin, 30);
        }
    }
}

TEST(ArucoTracker, ReadsMarkersWithAWideBorder) {
    Tracker tracker("tracker_aruco", {{"border_bits", "2"}}, test_camera, {{9, 80, "DICT_4X4_50"}});
    const auto seen =
        tracker.track(GreyFrame(picture_of({{aruco_marker("DICT_4X4_50", 9, 2), 80, pose_of(0, 0, 400)}})));
    ASSERT_EQ(seen.size(), 1u);
    EXPECT_LT(greatest_distance_px(seen[0], corners_of(pose_of(0, 0, 400), test_camera, 80)), 0.2);
    EXPECT_EQ(seen[0].hamming, 0u);
}

TEST(ArucoTracker, CorrectsWrongBitsOfAprilTags) {
    const Print damaged = with_wrong_bits(april_tag("tag36h11", 3), 2);
    const GreyFrame frame(picture_of({{damaged.with_margin(1), 100, pose_of(0, 0, 400)}}));
    for (const auto &[rate, count] : {std::pair{"0", 0u}, std::pair{"0.6", 1u}}) {
        Tracker tracker("tracker_aruco", {{"error_correction_rate", rate}}, test_camera, {{3, 100}});
        EXPECT_EQ(tracker.track(frame).size(), count) << rate;
    }
}

TEST(ArucoTracker, CorrectsByDefaultAsManyWrongBitsAsTheDictionaryAllows) {
    for (const auto &[family, wrong_bits, count] :
         {std::tuple{"16h5", 1, 0u}, {"25h9", 1, 1u}, {"25h9", 2, 0u}, {"36h11", 2, 1u}}) {
        const Print damaged = with_wrong_bits(april_tag("tag" + std::string(family), 3), wrong_bits);
        Tracker tracker("tracker_aruco", {}, test_camera, {{3, 100, "tag" + std::string(family)}});
        EXPECT_EQ(tracker.track(GreyFrame(picture_of({{damaged.with_margin(1), 100, pose_of(0, 0, 400)}}))).size(),
                  count)
            << family << ", " << wrong_bits;
    }
}

TEST(ArucoTracker, FindsTheMarkerOfTheUbiquityPhotoAndItsDistance) {
    ARHOST_REQUIRE_SHARED_DATA("markers/ubiquity");
    const auto folder = shared_data("markers/ubiquity");
    const auto golden = nlohmann::json::parse(std::ifstream(folder / "golden.json"));
    const auto &k = golden["camera"]["K"];
    const std::vector<double> d = golden["camera"]["D"];
    const auto camera = intrinsics_of({1280, 960}, k[0], k[4], k[2], k[5], ARHOST_DISTORTION_BROWN, d);
    Tracker tracker("tracker_aruco", {{"corner_refinement", "subpix"}}, camera, {{1, 145, "DICT_5X5_1000"}});
    const GreyFrame photo(read_grey(folder / "tag_01_d7_14cm.png"), ARHOST_TRANSFER_SRGB);
    const auto seen = tracker.track(photo);
    ASSERT_EQ(seen.size(), 1u);
    const std::vector<double> expected = golden["corners"]["tag_01_d7_14cm.png"]["1"];
    for (int corner = 0; corner < 4; ++corner)
        EXPECT_LT(corner_distance_px(seen[0], corner, {expected[2 * corner], expected[2 * corner + 1]}), 0.1);
    EXPECT_NEAR(solved_pose(seen[0], camera, 145).value().mt[14], -700, 35); // "d7": 70 cm
}

// Compares the corners with OpenCV's reference corners, which are unrefined and rounded to whole pixels.
void expect_opencv_corners(const std::string &photo, const std::string &dictionary, Options options,
                           const std::string &refinement, double tolerance_px) {
    options["corner_refinement"] = refinement;
    const auto folder = shared_data("markers/opencv_doc");
    const auto golden = nlohmann::json::parse(std::ifstream(folder / "golden.json"));
    Tracker tracker("tracker_aruco", options);
    ASSERT_EQ(tracker.created(), ARHOST_STATUS_OK) << tracker.log();
    std::vector<Listed> listed;
    for (const auto &[id, corners] : golden[photo]["corners"].items())
        listed.push_back({std::stoi(id), 100, dictionary});
    const auto found = markers_in(tracker, folder / photo, listed);
    EXPECT_EQ(found.size(), listed.size());
    for (const auto &[id, marker] : found)
        for (int k = 0; k < 4; ++k) {
            const auto &expected = golden[photo]["corners"][std::to_string(id)];
            for (int axis = 0; axis < 2; ++axis)
                EXPECT_NEAR(marker.corners_px[k][axis], expected[2 * k + axis].get<double>(), tolerance_px) << id;
        }
}

TEST(ArucoTracker, FindsTheMarkersOfOpenCvsDocumentation) {
    ARHOST_REQUIRE_SHARED_DATA("markers/opencv_doc");
    const std::string file = shared_data("markers/opencv_doc/tutorial_dict.yml");
    for (const auto &[refinement, tolerance_px] : {std::pair{"none", 1.0}, std::pair{"edges", 2.0}}) {
        expect_opencv_corners("singlemarkersoriginal.jpg", "DICT_6X6_250", {}, refinement, tolerance_px);
        expect_opencv_corners("choriginal.jpg", "DICT_6X6_250", {}, refinement, tolerance_px);
        expect_opencv_corners("gboriginal.png", "tutorial_dict", {{"dictionary_file", file}}, refinement,
                              tolerance_px);
    }

    Tracker tracker("tracker_aruco", {{"dictionary_file", file}});
    std::vector<int> ids; // several ids occur more than once
    for (const auto &[id, marker] :
         markers_in(tracker, shared_data("markers/opencv_doc/diamondmarkers.png"), ids_to(35, "tutorial_dict")))
        ids.push_back(id);
    EXPECT_THAT(ids, testing::ElementsAre(2, 3, 4, 10, 11, 12));
}

TEST(ArucoTracker, FindsTheTagsOfTheVispPhoto) {
    ARHOST_REQUIRE_SHARED_DATA("markers/apriltag_photo");
    Tracker tracker("tracker_aruco");
    expect_april_tag_photo(tracker);
}

TEST(ArucoTracker, FindsTheTagsOfTheJuliaPhoto) {
    ARHOST_REQUIRE_SHARED_DATA("markers/julia");
    Tracker tracker("tracker_aruco");
    expect_julia_photo(tracker);
}

TEST(ArucoTracker, FindsTheTagsOfTheSwatboticsPhotos) {
    ARHOST_REQUIRE_SHARED_DATA("markers/swatbotics");
    Tracker tracker("tracker_aruco");
    expect_swatbotics_photos(tracker);
}

} // namespace
