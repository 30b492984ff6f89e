// SPDX-License-Identifier: Apache-2.0
#include <fiducial_common/marker_report.hpp>

#include "rendered_marker.hpp"

#include <arhost-cpp/plugin.hpp>

#include <gmock/gmock.h>

namespace {

using namespace arhost::test;
using arhost::fiducial::Detection;
using arhost::fiducial::MarkerReport;

const arhost_intrinsics camera = intrinsics_of({640, 480}, 600, 600, 319.5, 239.5);

MarkerReport report_of(const std::vector<Listed> &listed, std::size_t id_count = 10) {
    std::vector<arhost_marker_config> markers;
    for (const Listed &marker : listed)
        markers.push_back({sizeof(arhost_marker_config), marker.id, marker.side_mm});
    const arhost_tracker_setup setup{sizeof setup, static_cast<uint32_t>(markers.size()), nullptr, &camera,
                                     markers.data()};
    return MarkerReport(setup, "tag16h5", id_count);
}

std::string rejection(const std::vector<Listed> &listed) {
    try {
        report_of(listed);
    } catch (const arhost::Failure &failure) {
        EXPECT_EQ(failure.status(), ARHOST_STATUS_ERROR_CONFIGURATION);
        return failure.what();
    }
    return "";
}

std::vector<arhost_marker> write(const MarkerReport &report, const std::vector<Detection> &detections) {
    auto result = std::make_unique<arhost_tracker_result>();
    report.write(detections, *result);
    return {result->markers, result->markers + result->marker_count};
}

Detection detection(std::size_t listed, double x_mm, double quality = 0) {
    return {listed, corners_of(pose_of(x_mm, 0, 600, 20, 10, 5), camera, 100), quality};
}

TEST(MarkerReport, NamesAnUnknownIdAndTheValidRange) {
    EXPECT_EQ(rejection({{0}, {10}}), "marker id 10 is not in tag16h5, whose ids are 0 to 9");
    EXPECT_EQ(rejection({{-1}}), "marker id -1 is not in tag16h5, whose ids are 0 to 9");
    EXPECT_EQ(rejection({{0}, {9}}), "");
}

TEST(MarkerReport, RejectsInvalidLists) {
    EXPECT_EQ(rejection({{3}, {3}}), "marker id 3 is listed twice");
    EXPECT_THAT(rejection({{3, 0}}), testing::HasSubstr("side_mm"));
    EXPECT_THAT(rejection({{3, -5}}), testing::HasSubstr("side_mm"));
    EXPECT_EQ(rejection({}), "0 markers are listed under 'markers'; list 1 to 64");
    EXPECT_THAT(rejection(std::vector<Listed>(65)), testing::StartsWith("65 markers are listed"));
}

TEST(MarkerReport, WritesCompleteRecordsInTheListedOrder) {
    const auto markers = write(report_of({{7, 100}, {2, 100}, {5, 100}}), {detection(1, 50), detection(0, -50)});
    ASSERT_EQ(markers.size(), 2u);
    EXPECT_EQ(markers[0].id, 7);
    EXPECT_EQ(markers[1].id, 2);
    EXPECT_NEAR(markers[0].mt[12], -50, 1e-3);
    EXPECT_NEAR(markers[1].mt[12], 50, 1e-3);
    for (const arhost_marker &marker : markers) {
        EXPECT_EQ(marker.struct_size, sizeof marker);
        EXPECT_STREQ(marker.family, "tag16h5");
        EXPECT_EQ(marker.state, ARHOST_MARKER_DETECTED);
        EXPECT_EQ(marker.age_frames, 0u);
        EXPECT_EQ(marker.mt_alternative[15], 1);
    }
}

TEST(MarkerReport, KeepsTheBetterOfTwoDetectionsInAnyOrder) {
    const MarkerReport report = report_of({{4, 100}});
    Detection distorted = detection(0, 80);
    distorted.corners_px[1].x += 2;
    for (const auto &[good, bad] :
         {std::pair{detection(0, -80), distorted}, std::pair{detection(0, -80, 2), detection(0, 80, 1)}})
        for (const auto &both : {std::vector{good, bad}, std::vector{bad, good}}) {
            const auto markers = write(report, both);
            ASSERT_EQ(markers.size(), 1u);
            EXPECT_NEAR(markers[0].mt[12], -80, 1e-3);
        }
}

TEST(MarkerReport, OmitsDetectionsWithoutAPose) {
    const Detection flat{0, {{{10, 10}, {20, 20}, {30, 30}, {40, 40}}}, 9};
    EXPECT_TRUE(write(report_of({{4}}), {flat}).empty());
    EXPECT_EQ(write(report_of({{4}}), {flat, detection(0, 0)}).size(), 1u);
}

TEST(MarkerReport, OmitsCornersThatNoSquareHas) {
    const MarkerReport report = report_of({{4, 100}});
    for (const auto &[shift_px, count] : {std::pair{4, 1u}, {40, 0u}}) {
        Detection hidden = detection(0, 0);
        hidden.corners_px[1].x += shift_px;
        EXPECT_EQ(write(report, {hidden}).size(), count) << shift_px;
    }
}

TEST(MarkerReport, TruncatesALongFamilyName) {
    const arhost_marker_config marker{sizeof marker, 0, 50};
    const arhost_tracker_setup setup{sizeof setup, 1, nullptr, &camera, &marker};
    const MarkerReport report(setup, std::string(40, 'x'), 1);
    EXPECT_EQ(std::string(write(report, {detection(0, 0)}).at(0).family), std::string(ARHOST_MAX_FAMILY - 1, 'x'));
}

} // namespace
