// SPDX-License-Identifier: Apache-2.0
#include <tracker_pattern/printed_patterns.hpp>

#include <fiducial/artoolkit.hpp>
#include <fiducial/prints.hpp>

#include <gmock/gmock.h>

#include <random>

namespace {

using namespace arhost::test;
using testing::EndsWith;
using testing::HasSubstr;
using testing::IsEmpty;

TEST(PatternTracker, TellsHiroFromKanjiAtTiltsOfUpTo60Degrees) {
    ARHOST_REQUIRE_SHARED_DATA("markers/artoolkit");
    Tracker tracker("tracker_pattern", {}, camera, both());
    std::mt19937 random(1);
    double worst_px = 0;
    for (const double tilt : {0.0, 15.0, 30.0, 45.0, 60.0})
        for (int view = 0; view < 10; ++view) {
            const std::vector<Placed> placed = side_by_side(tilt, view % 2 == 0, random);
            const auto seen = tracker.track(GreyFrame(picture_of(placed, static_cast<std::uint64_t>(view) + 1)));
            ASSERT_EQ(seen.size(), 2u) << "tilt " << tilt << ", view " << view;
            for (int id = 0; id < 2; ++id) {
                ASSERT_EQ(seen[id].id, id) << "tilt " << tilt << ", view " << view;
                worst_px = std::max(worst_px, greatest_distance_px(seen[id], corners_of(placed[id].mt, camera, 80)));
                EXPECT_GT(seen[id].decision_margin, 60);
            }
        }
    EXPECT_LE(worst_px, 0.2);
}

TEST(PatternTracker, SearchesOnlyWherePatternsAreExpected) {
    ARHOST_REQUIRE_SHARED_DATA("markers/artoolkit");
    Tracker tracker("tracker_pattern", {}, camera, both());
    const Mt hiro = pose_of(-75, 0, 500, 20, 10, 5), kanji = pose_of(75, 0, 500);
    const GreyFrame frame(picture_of({{print_of("hiro"), 80, hiro}, {print_of("kanji"), 80, kanji}}));
    const auto corners = corners_of(hiro, camera, 80);
    const auto seen = tracker.track(frame, {expected_at(0, corners)}, false);
    ASSERT_EQ(seen.size(), 1u);
    EXPECT_EQ(seen[0].id, 0);
    EXPECT_LT(greatest_distance_px(seen[0], corners), 0.2);
}

TEST(PatternTracker, FindsNothingElse) {
    ARHOST_REQUIRE_SHARED_DATA("markers/artoolkit");
    Tracker tracker("tracker_pattern", {}, camera, {{0, 80, "pattern", file_of("hiro"), 0.5}});
    EXPECT_THAT(tracker.track(GreyFrame(picture_of({{print_of("kanji"), 80, pose_of(0, 0, 500, 20, 20, 30)}}))),
                IsEmpty());
    for (const cv::Size size : {cv::Size(1, 1), cv::Size(3, 200), cv::Size(640, 480)}) {
        auto other = camera;
        other.width = static_cast<std::uint32_t>(size.width);
        other.height = static_cast<std::uint32_t>(size.height);
        ASSERT_EQ(tracker.start(other, {{0, 80, "pattern", file_of("hiro"), 0.5}}), ARHOST_STATUS_OK);
        EXPECT_THAT(tracker.track(GreyFrame(cv::Mat(size, CV_8UC1, cv::Scalar(128)))), IsEmpty());
    }
}

// The print of a matrix code.
Print code(const char *family, int id) {
    const auto &type = *arhost::fiducial::find_matrix_family(family);
    const int side = 2 * type.side; // cells of half the size
    Print print{cv::Mat_<std::uint8_t>(2 * side, 2 * side, std::uint8_t{0}), 2 * side};
    const auto black = arhost::fiducial::matrix_cells(type, id);
    for (int y = 0; y < side; ++y)
        for (int x = 0; x < side; ++x)
            print.cells(side / 2 + y, side / 2 + x) =
                black[static_cast<std::size_t>(y / 2 * type.side + x / 2)] ? 0 : 255;
    return print.with_margin(4);
}

std::string log_after(const Listed &listed, const Print &print) {
    Tracker tracker("tracker_pattern");
    EXPECT_EQ(tracker.start(camera, {listed}), ARHOST_STATUS_OK) << tracker.log();
    tracker.track(GreyFrame(picture_of({{print, 80, pose_of(0, 0, 400, 20, 10, 30)}})));
    tracker.stop();
    return tracker.log();
}

TEST(PatternTracker, NamesOtherCodesAndMarkersIfNoListedOneAppears) {
    const Listed listed{5, 80, "artoolkit-4x4-bch-13-9-3"};
    EXPECT_EQ(log_after(listed, code("artoolkit-4x4-bch-13-9-3", 5)), "");
    for (const auto &[family, id] : {std::pair{"artoolkit-4x4-bch-13-9-3", 7},
                                     {"artoolkit-5x5", 2222222},
                                     {"artoolkit-5x5-bch-22-7-7", 42},
                                     {"artoolkit-3x3", 37},
                                     {"artoolkit-3x3-hamming63", 6}})
        EXPECT_THAT(log_after(listed, code(family, id)),
                    EndsWith("other markers were in view: " + std::string(family) + " " + std::to_string(id) + "\n"));
    for (int id = 0; id < 64; ++id)
        EXPECT_EQ(log_after({id, 80, "artoolkit-3x3"}, code("artoolkit-3x3", id)), "");
    EXPECT_THAT(log_after(listed, aruco_marker("DICT_5X5_100", 77)), EndsWith(": DICT_5X5_100 77\n"));
}

TEST(PatternTracker, DoesNotNameCodesIfOnlyPatternsAreListed) {
    ARHOST_REQUIRE_SHARED_DATA("markers/artoolkit");
    EXPECT_EQ(log_after(both()[0], print_of("kanji")), "");
    EXPECT_EQ(log_after(both()[0], code("artoolkit-4x4", 4896)), "");
}

TEST(PatternTracker, RejectsFamiliesOfMarkersAndBadFiles) {
    Tracker tracker("tracker_pattern");
    EXPECT_EQ(tracker.start(camera, {{0, 80, "tag36h11"}}), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(tracker.log(),
                HasSubstr("unknown family 'tag36h11': tracker_pattern finds targets with a 'pattern', "));
    ScratchFolder folder;
    const std::string file = (folder.path() / "short.patt").string();
    std::ofstream(file) << "1 2 3";
    EXPECT_EQ(tracker.start(camera, {{0, 80, "pattern", file, 0.5}}), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(tracker.log(), HasSubstr("short.patt' is not a pattern of ARToolKit: it has 3 numbers"));
}

} // namespace
