// SPDX-License-Identifier: Apache-2.0
//
// The host's checks of a log that a compromised worker has packed. tests/core/cli/recorded_session_test.cpp tests
// what users can write into a log.
#include "session/log_reader.hpp"

#include "errors.hpp"
#include "log_samples.hpp"
#include "plugin_under_test.hpp"

#include <gmock/gmock.h>

#include <cstring>
#include <fstream>
#include <limits>

namespace arhost::session {
namespace {

using test::full_log;
using testing::HasSubstr;
using testing::StartsWith;

std::vector<std::byte> packed(const Log &log) {
    std::vector<std::byte> memory(packed_size(log));
    pack(log, memory);
    return memory;
}

// Returns why the host rejects the packed form of full_log() after a change.
std::string rejection(const std::function<void(Log &)> &change) {
    Log log = full_log();
    change(log);
    return arhost::test::error_of<std::runtime_error>([&] { (void)unpack(packed(log)); });
}

TEST(PackedLog, HasAllThatTheLogHas) {
    const Log log = unpack(packed(full_log()));
    EXPECT_EQ(log.lacking, 3u);
    EXPECT_TRUE(log.is_complete);
    ASSERT_EQ(log.frames.size(), 2u);
    const RecordedFrame &frame = log.frames[1], expected = full_log().frames[1];
    EXPECT_EQ(frame.number, 6u);
    EXPECT_EQ(frame.samples, 16u);
    EXPECT_EQ(frame.shading_px, 2u);
    ASSERT_EQ(frame.targets.size(), 2u);
    EXPECT_EQ(std::memcmp(frame.targets.data(), expected.targets.data(), 2 * sizeof(arhost_target)), 0);
    ASSERT_EQ(frame.observations.size(), 1u);
    EXPECT_EQ(std::memcmp(frame.observations.data(), expected.observations.data(), sizeof(arhost_observation)), 0);
    EXPECT_EQ(frame.search.candidate_count, 6);
    ASSERT_TRUE(frame.view && frame.truth);
    EXPECT_EQ(frame.view->eye_mm[2], 3.5);
    EXPECT_EQ(frame.truth, expected.truth);
    EXPECT_EQ(packed(log), packed(full_log()));
}

TEST(PackedLog, IsRejectedIfItEndsWithinAFrame) {
    const std::vector<std::byte> memory = packed(full_log());
    Log first = full_log();
    first.frames.resize(1);
    for (std::size_t size = 0; size < memory.size(); ++size) {
        const std::vector<std::byte> part(memory.begin(), memory.begin() + static_cast<std::ptrdiff_t>(size));
        if (size != packed_size(first)) {
            EXPECT_EQ(arhost::test::error_of<std::runtime_error>([&] { (void)unpack(part); }),
                      "it ends in the middle of a frame")
                << size;
        }
    }
}

TEST(PackedLog, HasNoMoreFramesThanItsLogCanHave) {
    const std::vector<std::byte> memory = packed(full_log());
    EXPECT_EQ(unpack(memory, 2).frames.size(), 2u);
    EXPECT_EQ(arhost::test::error_of<std::runtime_error>([&] { (void)unpack(memory, 1); }),
              "it has more frames than a log of this size can have");
}

TEST(PackedLog, CountsOfTheSearchAreChecked) {
    const std::string message = "its frame 6 is invalid: search: has a count that is out of range";
    EXPECT_EQ(rejection([](Log &log) { log.frames[1].search.candidate_count = -2; }), message);
    EXPECT_EQ(rejection([](Log &log) { log.frames[1].search.missed_count = 1000; }), message);
}

TEST(PackedLog, CountsAreChecked) {
    EXPECT_EQ(rejection([](Log &log) { log.frames[1].targets.resize(ARHOST_MAX_TARGETS + 1); }),
              "it has an array of 1025 elements; the maximum is 1024");
    EXPECT_EQ(rejection([](Log &log) { log.frames[1].observations.resize(ARHOST_MAX_OBSERVATIONS + 1); }),
              "it has an array of 1025 elements; the maximum is 1024");
    // Whatever field these bytes hit: a count, a length, an enumerator, a number.
    const std::vector<std::byte> memory = packed(full_log());
    for (std::size_t at = 0; at + 8 <= memory.size(); ++at) {
        std::vector<std::byte> changed = memory;
        std::fill_n(changed.begin() + static_cast<std::ptrdiff_t>(at), 8, std::byte{0xff});
        try {
            EXPECT_LE(unpack(changed).frames.size(), 2u);
        } catch (const std::runtime_error &) {
        }
    }
}

TEST(PackedLog, ValuesAreChecked) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN(),
                     infinite = std::numeric_limits<double>::infinity();
    const std::pair<std::function<void(RecordedFrame &)>, const char *> cases[] = {
        {[](auto &frame) { frame.number = 4; }, "frame: must be greater than in the line before, 4"},
        {[](auto &frame) { frame.capture_ns = 999; }, "capture_ns: must not be less than in the line before"},
        {[](auto &frame) { frame.clock = 9; }, "clock: is out of range"},
        {[](auto &frame) { frame.overlay = 0; }, "overlay: is out of range"},
        {[](auto &frame) { frame.scale = nan; }, "overlay_scale: must be 0.01 to 1"},
        {[](auto &frame) { frame.scale = 1.01; }, "overlay_scale: must be 0.01 to 1"},
        {[](auto &frame) { frame.shading_px = 0; }, "overlay_shading_px: must be 1 or 2"},
        {[](auto &frame) { frame.shading_px = 3; }, "overlay_shading_px: must be 1 or 2"},
        {[](auto &frame) { std::ranges::fill(frame.targets[1].name, 'x'); }, "name: must have 1 to 63 bytes"},
        {[](auto &frame) { frame.targets[1].name[0] = 0; }, "name: must have 1 to 63 bytes"},
        {[](auto &frame) { frame.targets[1].name[0] = '\xff'; }, "name: must be UTF-8"},
        {[](auto &frame) { frame.targets[1].state = 0; }, "state: is out of range"},
        {[](auto &frame) { frame.targets[1].mt[15] = nan; }, "targets: has a number that is not finite"},
        {[](auto &frame) { frame.targets[1].covariance[35] = infinite; }, "targets: has a number that is not finite"},
        {[](auto &frame) { frame.targets[1].ambiguity = nan; }, "targets: has a number that is not finite"},
        {[](auto &frame) { frame.targets[1].observation_count = 1; }, "observations: are out of range"},
        {[](auto &frame) { frame.targets[1].first_observation = 0xffffffff; }, "observations: are out of range"},
        {[](auto &frame) { frame.observations[0].corners_px[3][1] = nan; },
         "observations: has a number that is not finite"},
        {[](auto &frame) { frame.observations[0].decision_margin = infinite; },
         "observations: has a number that is not finite"},
        {[](auto &frame) { frame.view->eye_mm[0] = nan; }, "camera: look_at must differ from eye"},
        {[](auto &frame) { frame.view.reset(); }, "camera: is null, but the frame has an overlay"},
        {[](auto &frame) { frame.truth->first = "\xff"; }, "truth: is not UTF-8, or has a number that is not finite"},
        {[](auto &frame) { frame.truth->second[0] = nan; },
         "truth: is not UTF-8, or has a number that is not finite"},
    };
    for (const auto &[change, problem] : cases) {
        const std::string why = rejection([&](Log &log) { change(log.frames[1]); });
        EXPECT_THAT(why, StartsWith("its frame "));
        EXPECT_THAT(why, HasSubstr(std::string(" is invalid: ") + problem));
    }
}

// The host indexes families with the field `family`, and the log has none.
TEST(PackedLog, FieldsThatALogDoesNotHaveAreZero) {
    Log log = full_log();
    arhost_observation &observation = log.frames[1].observations[0];
    observation.family = 9;
    observation.false_positive_rate = std::numeric_limits<double>::quiet_NaN();
    const Log read = unpack(packed(log));
    EXPECT_EQ(read.frames[1].observations[0].family, 0u);
    EXPECT_EQ(read.frames[1].observations[0].false_positive_rate, 0);
}

class LogReader : public testing::Test {
protected:
    std::filesystem::path file() const { return scratch_.path() / "frames.jsonl"; }
    arhost::test::ScratchFolder scratch_;
};

TEST_F(LogReader, ReportsAFileThatCannotBeRead) {
    EXPECT_EQ(arhost::test::error_of([&] { (void)read_log(file(), 0, [] {}); }),
              file().string() + ": cannot be read: No such file or directory");
}

TEST_F(LogReader, APackedLogIsAtMostEightTimesAsLargeAsTheFile) {
    std::string targets, observations;
    for (int i = 0; i < ARHOST_MAX_OBSERVATIONS; ++i)
        observations += std::string(i ? "," : "") + R"({"id":0,"hamming":0,"decision_margin":0,"corners_px":)"
                                                    "[[0,0],[0,0],[0,0],[0,0]]}";
    for (int i = 0; i < ARHOST_MAX_TARGETS; ++i)
        targets += std::string(i ? "," : "") +
                   R"({"name":"a","state":"lost","age_frames":0,"mt":)"
                   "[0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0]" +
                   (i == 0 ? ",\"observations\":[" + observations + "]}" : "}");
    for (const std::string &some : {targets, std::string()}) {
        std::ofstream(file())
            << R"({"frame":0,"capture_ns":0,"clock":"media","overlay":"none","camera":null,"targets":[)" << some
            << "],\"video_end\":1}\n";
        const Log log = read_log(file(), 1, [] {});
        EXPECT_EQ(log.frames.at(0).targets.size(), some.empty() ? 0u : 1024u);
        EXPECT_LE(packed_size(log), max_expansion * std::filesystem::file_size(file()));
    }
}

} // namespace
} // namespace arhost::session
