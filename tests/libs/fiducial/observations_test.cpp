// SPDX-License-Identifier: Apache-2.0
#include <fiducial/observations.hpp>

#include "tracker_support.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <limits>

namespace {

using arhost::fiducial::april_tag_name;
using arhost::fiducial::Corners;
using arhost::fiducial::false_positive_rate;
using arhost::fiducial::Family;
using testing::ElementsAre;
using testing::Pair;

struct Marker {
    std::uint32_t family;
    int id;
};

// Each marker belongs to the target "cup". The families have 10 markers, "empty" is unknown.
std::vector<Family> families_of(const std::vector<const char *> &names, const std::vector<Marker> &markers) {
    const arhost_target_config target{.struct_size = sizeof target, .reserved = 0, .name = "cup", .body = nullptr};
    std::vector<arhost_marker_config> configured;
    for (const auto &[family, id] : markers)
        configured.push_back(arhost::test::marker_config(id, family));
    const arhost_tracker_setup setup{.struct_size = sizeof setup,
                                     .target_count = 1,
                                     .format = nullptr,
                                     .intrinsics = nullptr,
                                     .targets = &target,
                                     .markers = configured.data(),
                                     .marker_count = static_cast<std::uint32_t>(configured.size()),
                                     .family_count = static_cast<std::uint32_t>(names.size()),
                                     .families = names.data()};
    return arhost::fiducial::families_of(setup, [](const std::string &name) {
        if (name == "empty")
            throw arhost::Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "unknown");
        return 10;
    });
}

std::string rejection(const std::vector<const char *> &names, const std::vector<Marker> &markers) {
    try {
        families_of(names, markers);
    } catch (const arhost::Failure &failure) {
        EXPECT_EQ(failure.status(), ARHOST_STATUS_ERROR_CONFIGURATION);
        return failure.what();
    }
    return "";
}

TEST(Families, HaveTheirListedIds) {
    const auto families = families_of({"tag25h9", "DICT_4X4_50"}, {{0, 3}, {1, 3}, {0, 9}});
    ASSERT_EQ(families.size(), 2u);
    EXPECT_EQ(families[0].name, "tag25h9");
    EXPECT_THAT(families[0].listed, ElementsAre(Pair(3, 0u), Pair(9, 0u)));
    EXPECT_EQ(families[1].name, "DICT_4X4_50");
    EXPECT_THAT(families[1].listed, ElementsAre(Pair(3, 1u)));
}

TEST(Families, AreUsedOnceUnderBothNamesOfAprilTag) {
    const auto families = families_of({"DICT_4X4_50", "DICT_APRILTAG_36h11", "tag36h11"}, {{0, 1}, {1, 3}, {2, 4}});
    ASSERT_EQ(families.size(), 2u);
    const Family &tags = families[1];
    EXPECT_EQ(tags.name, "tag36h11");
    EXPECT_THAT(tags.listed, ElementsAre(Pair(3, 1u), Pair(4, 2u)));
    EXPECT_EQ(tags.observation(4, {}).family, 2u);
    EXPECT_EQ(tags.observation(5, {}).family, 1u) << "an unlisted id has the family's first name";
}

TEST(Families, OnlyThoseOfAprilTagHaveTwoNames) {
    EXPECT_EQ(april_tag_name("DICT_APRILTAG_16h5"), "tag16h5");
    EXPECT_EQ(april_tag_name("DICT_APRILTAG_25h9"), "tag25h9");
    EXPECT_EQ(april_tag_name("DICT_APRILTAG_36h10"), "tag36h10");
    EXPECT_EQ(april_tag_name("DICT_APRILTAG_36h11"), "tag36h11");
    for (const char *name : {"tag36h11", "DICT_APRILTAG_36h12", "DICT_6X6_250", ""})
        EXPECT_EQ(april_tag_name(name), name);
}

TEST(Families, RejectAnUnknownIdAndNameTheRange) {
    EXPECT_EQ(rejection({"tag16h5"}, {{0, 0}, {0, 10}}),
              "target 'cup': marker id 10 is not in tag16h5, whose ids are 0 to 9");
    EXPECT_EQ(rejection({"DICT_APRILTAG_16h5"}, {{0, -1}}),
              "target 'cup': marker id -1 is not in DICT_APRILTAG_16h5, whose ids are 0 to 9");
    EXPECT_EQ(rejection({"tag16h5"}, {{0, 0}, {0, 9}}), "");
}

TEST(Families, RejectAMarkerThatIsListedUnderBothNames) {
    EXPECT_EQ(rejection({"tag16h5", "DICT_APRILTAG_16h5"}, {{0, 3}, {1, 3}}),
              "target 'cup': marker id 3 of DICT_APRILTAG_16h5 is also listed as a marker of tag16h5; both are names "
              "of the same family");
}

TEST(Families, PassOnTheErrorOfAnUnknownOne) {
    EXPECT_EQ(rejection({"tag16h5", "empty"}, {{0, 3}}), "unknown");
}

std::vector<arhost_observation> report(const std::vector<arhost_observation> &seen) {
    arhost_observation empty{};
    empty.struct_size = sizeof empty;
    std::vector<arhost_observation> buffer(ARHOST_MAX_OBSERVATIONS, empty);
    arhost_tracker_result result{.struct_size = sizeof result,
                                 .observation_count = 0,
                                 .observations = buffer.data(),
                                 .poses = nullptr,
                                 .pose_count = 0,
                                 .candidate_count = -1};
    arhost::Observations observations(result);
    arhost::fiducial::report(seen, observations);
    buffer.resize(result.observation_count);
    return buffer;
}

const Family tags{"tag16h5", 1, 30, {{7, 0}}};

arhost_observation at(int id, double x_px) {
    return tags.observation(id, {{{{x_px, 80}, {x_px + 60, 80}, {x_px + 60, 140}, {x_px, 140}}}});
}

TEST(Report, IsOrderedByFamilyThenIdThenPlace) {
    std::vector<arhost_observation> seen{at(7, 10), at(2, 10), at(2, 200), at(5, 30)};
    const auto is_before = [](const arhost_observation &a, const arhost_observation &b) {
        return std::pair(a.id, a.corners_px[0][0]) < std::pair(b.id, b.corners_px[0][0]);
    };
    std::ranges::sort(seen, is_before);
    do {
        const auto reported = report(seen);
        ASSERT_EQ(reported.size(), 4u);
        const auto is = [&](std::size_t i, std::uint32_t family, int id, double x_px) {
            return reported[i].family == family && reported[i].id == id && reported[i].corners_px[0][0] == x_px &&
                   reported[i].struct_size == sizeof(arhost_observation);
        };
        EXPECT_TRUE(is(0, 0, 7, 10) && is(1, 1, 2, 10) && is(2, 1, 2, 200) && is(3, 1, 5, 30));
    } while (std::next_permutation(seen.begin(), seen.end(), is_before));
}

TEST(Report, LeavesOutCornersThatNoFrontHas) {
    const double nan = std::numeric_limits<double>::quiet_NaN(), infinite = std::numeric_limits<double>::infinity();
    const Corners wrong[] = {
        {{{10, 10}, {20, 20}, {30, 30}, {40, 40}}},       // collinear
        {{{10, 10}, {50, 10}, {30, 10}, {10, 50}}},       // three corners are collinear
        {{{10, 10}, {10, 10}, {10, 10}, {10, 10}}},       // all corners coincide
        {{{10, 10}, {50, 50}, {50, 10}, {10, 50}}},       // self-intersecting
        {{{10, 10}, {50, 10}, {20, 20}, {10, 50}}},       // not convex
        {{{nan, 10}, {50, 10}, {50, 50}, {10, 50}}},      //
        {{{10, 10}, {50, infinite}, {50, 50}, {10, 50}}}, //
        {{{50, 10}, {10, 10}, {10, 50}, {50, 50}}},       // wrong orientation: shows the back face
    };
    for (const Corners &corners : wrong)
        EXPECT_EQ(report({tags.observation(3, {corners}), at(4, 10)}).size(), 1u);
}

TEST(Report, HasOverlappingDetectionsOfAMarkerOnce) {
    arhost_observation first = at(4, 10), second = at(4, 12);
    first.decision_margin = 50;
    second.decision_margin = 60;
    EXPECT_EQ(report({first, second}).size(), 1u);
    EXPECT_EQ(report({first, second})[0].decision_margin, 60);
    EXPECT_EQ(report({second, first})[0].decision_margin, 60);
    first.corner_sigma_px = 0.05;
    EXPECT_EQ(report({first, second})[0].decision_margin, 50) << "the corners of only the first one were refined";
    first.corner_sigma_px = 0;
    second.hamming = 1;
    EXPECT_EQ(report({first, second})[0].decision_margin, 50);
    EXPECT_EQ(report({at(4, 10), at(5, 10), at(4, 80)}).size(), 3u) << "another marker, and a copy beside the first";
    const arhost_observation inner = tags.observation(4, {{{{12, 82}, {22, 82}, {22, 92}, {12, 92}}}});
    EXPECT_EQ(report({inner, at(4, 10)}).size(), 1u);
    EXPECT_EQ(report({at(4, 10), inner}).size(), 1u);
}

TEST(Report, EndsAtTheGreatestNumberOfObservations) {
    std::vector<arhost_observation> seen;
    for (int id = 0; id < ARHOST_MAX_OBSERVATIONS + 5; ++id)
        seen.push_back(at(id, 10));
    const auto reported = report(seen);
    ASSERT_EQ(reported.size(), static_cast<std::size_t>(ARHOST_MAX_OBSERVATIONS));
    EXPECT_EQ(reported[7].id, 6) << "id 7 is in another family";
}

TEST(Observations, FalsePositiveRateIsTheShareOfWordsThatReadAsTheCode) {
    EXPECT_DOUBLE_EQ(false_positive_rate(16, 0), 4.0 / 65536);
    EXPECT_DOUBLE_EQ(false_positive_rate(16, 2), 4.0 * (1 + 16 + 120) / 65536);
    EXPECT_DOUBLE_EQ(false_positive_rate(9, 9), 1) << "at most";
}

} // namespace
