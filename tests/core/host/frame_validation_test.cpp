// SPDX-License-Identifier: Apache-2.0
#include "host/frame_validation.hpp"

#include "ipc/protocol.hpp"

#include <gmock/gmock.h>

#include <cstring>
#include <limits>

using namespace arhost;
using namespace arhost::host;

namespace {

constexpr std::int64_t now_ns = 100'000'000'000;

const char *problem_with(arhost_clock clock, std::int64_t capture_ns, std::int64_t previous_capture_ns = INT64_MIN) {
    arhost_frame_info info{};
    info.clock = clock;
    info.capture_ns = capture_ns;
    arhost_record record{};
    const char *problem = accept_frame_info(info, previous_capture_ns, now_ns, record);
    if (!problem) {
        EXPECT_EQ(record.clock, clock);
        EXPECT_EQ(record.capture_ns, capture_ns);
    }
    return problem;
}

const std::vector<model::Target> targets = {
    {"desk", {{23, "D", {}}}, ""}, {"cup", {{7, "D", {}}}, ""}, {"head", {}, "skull"}};

// The result of a tracker: "desk" was never seen, "cup" is detected, "head" is lost.
struct TrackerResult {
    TrackerResult() : bytes(layout.byte_size(0)) {
        header() = {.observation_count = 2,
                    .expected_count = 2,
                    .missed_count = 1,
                    .searched_everywhere = -1,
                    .candidate_count = 7};
        expected(0).margin_px = expected(1).margin_px = 4;
        expected(1).marker = 1;
        expected(1).corners_px[3][1] = 20;
        for (const int index : {1, 2}) {
            target(index).state = index == 1 ? ARHOST_TARGET_DETECTED : ARHOST_TARGET_LOST;
            for (const int diagonal : {0, 5, 10, 15})
                target(index).mt[diagonal] = 1;
            target(index).mt[14] = -500;
        }
        target(1).observation_count = 1;
        observation(0).id = 7;
        observation(1).id = 99;
    }
    ipc::TrackerSlot::Header &header() { return *reinterpret_cast<ipc::TrackerSlot::Header *>(bytes.data()); }
    arhost_target &target(int index) {
        return reinterpret_cast<arhost_target *>(bytes.data() + ipc::TrackerSlot::targets_offset)[index];
    }
    arhost_observation &observation(int index) {
        return reinterpret_cast<arhost_observation *>(bytes.data() + layout.observations_offset)[index];
    }
    arhost_expected_marker &expected(int index) {
        return reinterpret_cast<arhost_expected_marker *>(bytes.data() + layout.expected_offset)[index];
    }
    const char *problem() { return accept_tracker_result(bytes, targets, 1, frame); }

    const ipc::TrackerSlot layout{targets.size()};
    std::vector<std::byte> bytes;
    Frame frame{0};
};

} // namespace

TEST(TrackerResult, IsCopiedWithTheConfiguredNamesOfTheTargets) {
    TrackerResult result;
    std::strcpy(result.target(1).name, "a name from the worker");
    ASSERT_EQ(result.problem(), nullptr);
    ASSERT_EQ(result.frame.targets.size(), 2u) << "'desk' was never seen";
    EXPECT_STREQ(result.frame.targets[0].name, "cup");
    EXPECT_EQ(result.frame.targets[0].state, ARHOST_TARGET_DETECTED);
    EXPECT_EQ(result.frame.targets[0].struct_size, sizeof(arhost_target));
    EXPECT_STREQ(result.frame.targets[1].name, "head");
    ASSERT_EQ(result.frame.observations.size(), 2u);
    EXPECT_EQ(result.frame.observations[1].id, 99);
    EXPECT_EQ(result.frame.observations[1].struct_size, sizeof(arhost_observation));
    ASSERT_EQ(result.frame.expected.size(), 2u);
    EXPECT_EQ(result.frame.expected[1].marker, 1u);
    EXPECT_EQ(result.frame.expected[1].corners_px[3][1], 20);
    EXPECT_EQ(result.frame.expected[1].struct_size, sizeof(arhost_expected_marker));
    const arhost_search &search = result.frame.record.search;
    EXPECT_EQ(search.everywhere, 1);
    EXPECT_EQ(search.observation_count, 2u);
    EXPECT_EQ(search.expected_count, 2u);
    EXPECT_EQ(search.missed_count, 1u);
    EXPECT_EQ(search.candidate_count, 7);
}

TEST(TrackerResult, IsRejectedIfItsNumbersAreInvalid) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    const auto expect = [](void (*alter)(TrackerResult &), const char *problem) {
        TrackerResult result;
        alter(result);
        EXPECT_STREQ(result.problem(), problem);
        EXPECT_TRUE(result.frame.targets.empty());
        EXPECT_TRUE(result.frame.observations.empty());
        EXPECT_TRUE(result.frame.expected.empty());
        EXPECT_EQ(result.frame.record.search.expected_count, 0u);
    };
    expect([](TrackerResult &r) { r.header().observation_count = ARHOST_MAX_OBSERVATIONS + 1; },
           "the tracker reports more observations than ARHOST_MAX_OBSERVATIONS");
    for (const auto alter : {+[](TrackerResult &r) { r.header().expected_count = ARHOST_MAX_MARKERS + 1; },
                             +[](TrackerResult &r) { r.header().expected_count = UINT32_MAX; },
                             +[](TrackerResult &r) { r.header().missed_count = 3; }})
        expect(alter, "the number of expected or missed markers is out of range");
    expect([](TrackerResult &r) { r.header().candidate_count = -2; }, "the number of candidates is less than -1");
    for (const auto alter : {+[](TrackerResult &r) { r.expected(0).marker = 2; },
                             +[](TrackerResult &r) { r.expected(1).marker = UINT32_MAX; }})
        expect(alter, "an expected marker's index is out of range");
    for (const double number : {nan, std::numeric_limits<double>::infinity()}) {
        TrackerResult result;
        result.expected(1).corners_px[0][1] = number;
        EXPECT_STREQ(result.problem(), "a coordinate of an expected marker's corner is not finite");
    }
    for (const auto alter : {+[](TrackerResult &r) { r.expected(0).margin_px = nan; },
                             +[](TrackerResult &r) { r.expected(1).margin_px = -1; }})
        expect(alter, "an expected marker's margin is negative or not finite");
    expect([](TrackerResult &r) { r.target(1).state = 4; }, "a target's state is out of range");
    expect([](TrackerResult &r) { r.target(0).state = -1; }, "a target's state is out of range");
    for (const auto alter : {+[](TrackerResult &r) { r.target(1).first_observation = 3; },
                             +[](TrackerResult &r) { r.target(1).observation_count = 3; },
                             +[](TrackerResult &r) { r.target(1).first_observation = 2; },
                             +[](TrackerResult &r) { r.target(1).observation_count = UINT32_MAX; }})
        expect(alter, "a target's observations are out of range");
    for (const auto alter : {+[](TrackerResult &r) { r.target(1).covariance[35] = nan; },
                             +[](TrackerResult &r) { r.target(1).ambiguity = nan; },
                             +[](TrackerResult &r) { r.target(1).mt_alternative[15] = nan; },
                             +[](TrackerResult &r) { r.target(1).reprojection_px = nan; }})
        expect(alter, "a target's alternative pose, covariance, reprojection error or ambiguity is not finite");
    expect([](TrackerResult &r) { r.target(2).mt[0] = nan; }, "the pose is not finite");
    expect([](TrackerResult &r) { r.target(2).mt[0] = 2; }, "the pose's rotation is not orthonormal");
    expect([](TrackerResult &r) { r.observation(1).family = 1; }, "an observation's family is out of range");
    for (const auto alter : {+[](TrackerResult &r) { r.observation(1).corners_px[3][1] = nan; },
                             +[](TrackerResult &r) { r.observation(0).projected_px[0][0] = nan; }})
        expect(alter, "a coordinate of an observation's corner is not finite");
    for (const auto alter : {+[](TrackerResult &r) { r.observation(0).decision_margin = -1; },
                             +[](TrackerResult &r) { r.observation(0).corner_sigma_px = -0.1; },
                             +[](TrackerResult &r) { r.observation(0).false_positive_rate = 1.1; },
                             +[](TrackerResult &r) { r.observation(0).decision_margin = nan; },
                             +[](TrackerResult &r) { r.observation(1).corner_sigma_px = nan; },
                             +[](TrackerResult &r) { r.observation(1).false_positive_rate = nan; }})
        expect(alter, "an observation's decision margin, corner noise or false positive rate is out of range");
}

TEST(DeviceTime, IsIgnoredIfLongerThanTheRenderCall) {
    using namespace std::chrono_literals;
    const auto accepted = [](std::uint64_t ns, std::chrono::nanoseconds busy) {
        arhost_render_info info{};
        info.device_time_ns = ns;
        return device_time(info, busy);
    };
    EXPECT_EQ(accepted(3'000'000, 5ms), 3ms);
    EXPECT_EQ(accepted(5'000'000, 5ms), 5ms);
    EXPECT_EQ(accepted(5'000'001, 5ms), 0ns);
    EXPECT_EQ(accepted(0, 5ms), 0ns);
    EXPECT_EQ(accepted(UINT64_MAX, 5ms), 0ns) << "UINT64_MAX is -1 as a signed number";
    EXPECT_EQ(accepted(1, -5ms), 0ns) << "the worker also reports the duration, which may be negative";
    EXPECT_EQ(accepted(UINT64_MAX, -1ns), 0ns);
}

TEST(FrameInfo, IsRejectedWithoutAClock) {
    EXPECT_STREQ(problem_with(0, now_ns), "a frame's clock is not set");
    EXPECT_STREQ(problem_with(3, now_ns), "a frame's clock is not set");
}

TEST(FrameInfo, IsRejectedIfItsTimeRunsBackwards) {
    EXPECT_EQ(problem_with(ARHOST_CLOCK_MONOTONIC, now_ns - 5, now_ns - 5), nullptr);
    EXPECT_STREQ(problem_with(ARHOST_CLOCK_MONOTONIC, now_ns - 6, now_ns - 5),
                 "a frame's capture time is before that of the previous frame");
}

TEST(FrameInfo, IsRejectedIfALiveTimeIsFarInTheFuture) {
    EXPECT_EQ(problem_with(ARHOST_CLOCK_MONOTONIC, INT64_MIN), nullptr) << "any age is accepted";
    EXPECT_EQ(problem_with(ARHOST_CLOCK_MONOTONIC, now_ns + 1'000'000'000), nullptr);
    const char *problem = "a frame's capture time is more than a second ahead of the clock";
    EXPECT_STREQ(problem_with(ARHOST_CLOCK_MONOTONIC, now_ns + 1'000'000'001), problem);
    EXPECT_STREQ(problem_with(ARHOST_CLOCK_MONOTONIC, INT64_MAX), problem);
    EXPECT_EQ(problem_with(ARHOST_CLOCK_MEDIA, INT64_MAX), nullptr) << "media time is unrelated to the current time";
}
