// SPDX-License-Identifier: Apache-2.0
#include "camera/trajectory.hpp"
#include "log_sink_test.hpp"

#include <gmock/gmock.h>

#include <limits>
#include <numbers>
#include <random>

using namespace arhost::test;
using arhost::camera::read_trajectory;
using arhost::camera::Trajectory;
using testing::ElementsAreArray;
using testing::HasSubstr;

namespace {

// Returns a record with a random camera, whose numbers need many decimal digits. Every fourth frame has no camera.
arhost_record camera_record(std::uint64_t sequence) {
    arhost_record record = make_record(sequence);
    if (sequence % 4 == 3)
        return record;
    std::mt19937_64 random(sequence);
    std::uniform_real_distribution<double> numbers(-1000, 1000);
    record.has_camera = 1;
    for (int i = 0; i < 3; ++i) {
        record.camera.eye[i] = numbers(random);
        record.camera.look_at[i] = record.camera.eye[i] + numbers(random) / 3;
        record.camera.up[i] = numbers(random) * 1e-3;
    }
    return record;
}

TrackedRecord record_with_camera(std::uint64_t sequence) {
    return {camera_record(sequence), {}, {}};
}

class SinkTrajectory : public testing::Test {
protected:
    std::filesystem::path file() const { return folder_.path() / "run.trajectory"; }
    SinkUnderTest sink(const std::string &format) const {
        return SinkUnderTest("sink_trajectory", {{"path", file().string()}, {"format", format}});
    }
    static void write(SinkUnderTest &sink, std::uint64_t first, std::uint64_t end) {
        const Picture picture(8, 8, 0);
        for (; first < end; ++first)
            ASSERT_EQ(sink.write(picture, camera_record(first)), ARHOST_STATUS_OK) << sink.log();
    }
    // Writes only these frames, as if the others had been dropped.
    void write_frames(const std::string &format, const std::vector<std::uint64_t> &frames) const {
        SinkUnderTest s = sink(format);
        ASSERT_EQ(s.start(8, 8), ARHOST_STATUS_OK);
        for (const std::uint64_t frame : frames)
            write(s, frame, frame + 1);
        ASSERT_EQ(s.stop(), ARHOST_STATUS_OK);
    }

    ScratchFolder folder_;
};
class SinkTrajectoryInEachFormat : public SinkTrajectory, public testing::WithParamInterface<const char *> {};

std::vector<std::uint64_t> numbers_of(const Trajectory &trajectory) {
    std::vector<std::uint64_t> numbers;
    for (const auto &frame : trajectory.frames)
        if (frame.view)
            numbers.push_back(frame.frame);
    return numbers;
}

} // namespace

TEST_F(SinkTrajectory, WritesAHeaderAndOneLinePerFrame) {
    arhost_record record = make_record(0);
    record.has_camera = 1;
    record.camera.eye[2] = 500;
    record.camera.look_at[2] = 499;
    record.camera.up[1] = 1;
    SinkUnderTest s = sink("arhost");
    ASSERT_EQ(s.start(8, 6), ARHOST_STATUS_OK);
    ASSERT_EQ(s.write(Picture(8, 6, 0), record), ARHOST_STATUS_OK);
    ASSERT_EQ(s.write(Picture(8, 6, 0), make_record(1)), ARHOST_STATUS_OK);
    EXPECT_EQ(read_text(file()),
              R"({"format": "arhost-trajectory", "version": 1, "unit": "mm", "clock": "media", "fps": 30, )"
              R"("camera": {"width": 8, "height": 6, "fx": 333.3333333333333, "fy": 142.85714285714286, )"
              R"("cx": 3.8095238095238093, "cy": 3.1578947368421053, "distortion": )"
              R"({"model": "brown", "coefficients": [0.03333333333333333, -1e-17, 0, 0.002]}}})"
              "\n"
              R"({"frame": 0, "capture_ns": 0, "eye": [0, 0, 500], "look_at": [0, 0, 499], "up": [0, 1, 0]})"
              "\n"
              R"({"frame": 1, "capture_ns": 33333333, "eye": null, "look_at": null, "up": null})"
              "\n");
}

TEST_F(SinkTrajectory, EveryNumberReadsBackAsTheSameDouble) {
    constexpr std::uint64_t frames = 200;
    SinkUnderTest s = sink("arhost");
    ASSERT_EQ(s.start(8, 8), ARHOST_STATUS_OK);
    write(s, 0, frames);
    const Trajectory trajectory = read_trajectory(file());
    EXPECT_EQ(trajectory.warning, "");
    ASSERT_EQ(trajectory.frames.size(), frames);
    for (std::uint64_t i = 0; i < frames; ++i) {
        const arhost_record record = camera_record(i);
        const auto &read = trajectory.frames[i];
        EXPECT_EQ(read.frame, i);
        EXPECT_EQ(read.capture_ns, record.capture_ns);
        ASSERT_EQ(read.view.has_value(), record.has_camera != 0);
        if (!read.view)
            continue;
        EXPECT_THAT(read.view->eye_mm, ElementsAreArray(record.camera.eye));
        EXPECT_THAT(read.view->look_at_mm, ElementsAreArray(record.camera.look_at));
        EXPECT_THAT(read.view->up, ElementsAreArray(record.camera.up));
    }
    const arhost_intrinsics expected = make_intrinsics(8, 8), read = trajectory.intrinsics.value();
    EXPECT_EQ(std::memcmp(&read, &expected, sizeof read), 0);
    EXPECT_EQ(trajectory.clock, ARHOST_CLOCK_MEDIA);
    EXPECT_EQ(trajectory.fps, 30);
}

TEST_F(SinkTrajectory, WritesTheDissertationsNineNumbersOfSixDigits) {
    arhost_record record = make_record(0);
    record.has_camera = 1;
    const double eye[] = {7.394861234, -721.14812, 500.6371}, look_at[] = {1e-7, 1234567, 0}, up[] = {0, 1, 1.0 / 3};
    std::ranges::copy(eye, record.camera.eye);
    std::ranges::copy(look_at, record.camera.look_at);
    std::ranges::copy(up, record.camera.up);
    SinkUnderTest s = sink("dissertation");
    ASSERT_EQ(s.start(8, 6), ARHOST_STATUS_OK);
    ASSERT_EQ(s.write(Picture(8, 6, 0), record), ARHOST_STATUS_OK);
    ASSERT_EQ(s.write(Picture(8, 6, 0), make_record(1)), ARHOST_STATUS_OK);
    EXPECT_EQ(read_text(file()), "7.39486 -721.148 500.637 1e-07 1.23457e+06 0 0 1 0.333333 \n\n");
}

TEST_F(SinkTrajectory, LineNumbersOfFormatDissertationAreFrameNumbers) {
    write_frames("dissertation", {1, 2, 3, 6, 9});
    const Trajectory trajectory = read_trajectory(file());
    EXPECT_EQ(trajectory.end(), 10u);
    EXPECT_THAT(numbers_of(trajectory), testing::ElementsAre(1, 2, 6, 9)); // frame 3 has no camera
    EXPECT_NEAR(trajectory.frames[6].view->eye_mm[0], camera_record(6).camera.eye[0], 1e-3);
}

TEST_F(SinkTrajectory, FramesDroppedInLiveModeHaveNoLine) {
    write_frames("arhost", {1, 2, 6, 9});
    EXPECT_EQ(read_trajectory(file()).frames.size(), 4u);
    EXPECT_THAT(numbers_of(read_trajectory(file())), testing::ElementsAre(1, 2, 6, 9));
}

TEST_F(SinkTrajectory, ANonFiniteCameraIsTreatedAsMissing) {
    arhost_record record = camera_record(0);
    record.camera.up[1] = std::numeric_limits<double>::quiet_NaN();
    for (const char *format : {"arhost", "dissertation"}) {
        SinkUnderTest s = sink(format);
        ASSERT_EQ(s.start(8, 8), ARHOST_STATUS_OK);
        ASSERT_EQ(s.write(Picture(8, 8, 0), record), ARHOST_STATUS_OK);
        EXPECT_FALSE(read_trajectory(file()).frames.at(0).view);
    }
}

TEST_F(SinkTrajectory, ARunWithoutACameraIsRejected) {
    SinkUnderTest s = sink("arhost");
    s.knows_camera = false;
    EXPECT_EQ(s.start(8, 8), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(s.log(), HasSubstr("there is no camera to record; add a tracker"));
    EXPECT_FALSE(std::filesystem::exists(file()));
}

TEST_P(SinkTrajectoryInEachFormat, ARestartWithoutTheOldFileGivesAWarningAndAReadableFile) {
    SinkUnderTest s = sink(GetParam());
    ASSERT_EQ(s.start(8, 8, 5), ARHOST_STATUS_OK);
    EXPECT_THAT(s.log(), HasSubstr("has no frame before 5"));
    write(s, 5, 7);
    EXPECT_THAT(numbers_of(read_trajectory(file())), testing::ElementsAre(5, 6));
}

INSTANTIATE_TEST_SUITE_P(Formats, SinkTrajectoryInEachFormat, testing::Values("arhost", "dissertation"),
                         [](const auto &info) { return std::string(info.param); });
INSTANTIATE_TEST_SUITE_P(
    Formats, LogSink,
    testing::Values(LogSinkCase{"arhost", "sink_trajectory", record_with_camera, {{"format", "arhost"}}},
                    LogSinkCase{"dissertation", "sink_trajectory", record_with_camera, {{"format", "dissertation"}}}),
    [](const auto &info) { return info.param.name; });
