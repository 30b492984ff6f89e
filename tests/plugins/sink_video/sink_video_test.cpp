// SPDX-License-Identifier: Apache-2.0
#include "video.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <numeric>

using namespace arhost::test;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

namespace {

constexpr int width = 160, height = 96;

std::vector<std::uint64_t> numbers(std::uint64_t first, std::uint64_t end) {
    std::vector<std::uint64_t> all(end - first);
    std::iota(all.begin(), all.end(), first);
    return all;
}

struct Difference {
    double psnr_db, bias[3]; // bias: mean of (video − frame) for B, G and R
};

Difference compare(const VideoFrame &video, const Picture &frame) {
    double squares = 0, sums[3]{};
    for (int y = 0; y < frame.height(); ++y)
        for (int x = 0; x < frame.width(); ++x)
            for (int c = 0; c < 3; ++c) {
                const double d = video.pixel(x, y)[c] - frame.pixel(x, y)[c];
                squares += d * d;
                sums[c] += d;
            }
    const double count = static_cast<double>(frame.width()) * frame.height();
    return {10 * std::log10(255 * 255 / (squares / (3 * count))),
            {sums[0] / count, sums[1] / count, sums[2] / count}};
}

class SinkVideo : public testing::Test {
protected:
    std::filesystem::path path(const std::string &name = "demo.mp4") const { return folder_.path() / name; }
    std::map<std::string, std::string> with_path(std::map<std::string, std::string> options = {}) const {
        options.emplace("path", path().string());
        return options;
    }
    SinkUnderTest sink(std::map<std::string, std::string> options = {}) const {
        return SinkUnderTest("sink_video", with_path(std::move(options)));
    }
    // Starts the sink at frame `first`, writes the frames [first, end) and stops it.
    void run(SinkUnderTest &&s, std::uint64_t first, std::uint64_t end, double fps = 30) const {
        s.run(width, height, first, end, fps);
        EXPECT_EQ(s.log(), "");
    }
    // Starts the sink at frame `first`, writes the frames [first, end), then simulates a kill.
    void run_and_die(std::uint64_t first, std::uint64_t end) const {
        sink().start_and_write(width, height, first, end);
    }
    // Starts the sink at frame `first` and writes the frames [first, end), which are captured at these times.
    static void write_at(SinkUnderTest &s, std::uint64_t first, std::uint64_t end,
                         const std::function<std::int64_t(std::uint64_t)> &captured_ns, double fps = 30,
                         arhost_clock clock = ARHOST_CLOCK_MEDIA) {
        ASSERT_EQ(s.start(width, height, first, fps), ARHOST_STATUS_OK) << s.log();
        for (std::uint64_t i = first; i < end; ++i) {
            arhost_record record = make_record(i);
            record.clock = clock;
            record.capture_ns = captured_ns(i);
            ASSERT_EQ(s.write(Picture(width, height, i), record), ARHOST_STATUS_OK) << s.log();
        }
    }
    std::vector<std::string> names() const { return names_in(folder_.path()); }

    ScratchFolder folder_;
};

} // namespace

// ---- The video --------------------------------------------------------------------------------------

TEST_F(SinkVideo, HasEveryFrameOnceInOrder) {
    run(sink(), 0, 40);
    EXPECT_THAT(names(), ElementsAre("demo.mp4"));
    const Video video = read_video(path());
    EXPECT_EQ(video.codec, "h264");
    EXPECT_EQ(video.numbers(), numbers(0, 40));
    EXPECT_EQ(av_cmp_q(video.fps, {30, 1}), 0);
    EXPECT_NEAR(video.duration_s, 40 / 30.0, 1e-3);
}

TEST_F(SinkVideo, IsTaggedAsBt709LimitedRange) {
    for (const std::string name : {"a.mp4", "a.mkv", "a.mov"}) {
        run(sink({{"path", path(name).string()}}), 0, 1);
        const Video video = read_video(path(name));
        EXPECT_EQ(video.range, AVCOL_RANGE_MPEG) << name;
        EXPECT_EQ(video.matrix, AVCOL_SPC_BT709) << name;
        EXPECT_EQ(video.primaries, AVCOL_PRI_BT709) << name;
        EXPECT_EQ(video.transfer, AVCOL_TRC_BT709) << name;
    }
}

TEST_F(SinkVideo, ColoursAreCorrect) {
    for (const std::string codec : {"h264", "mpeg4"}) {
        sink({{"codec", codec}}).run(320, 240, 0, 3);
        const Video video = read_video(path());
        ASSERT_EQ(video.frames.size(), 3u);
        for (std::uint64_t i = 0; i < 3; ++i) {
            const Difference d = compare(video.frames[i], Picture(320, 240, i));
            EXPECT_GE(d.psnr_db, 35) << codec;
            for (const double bias : d.bias)
                EXPECT_LT(std::abs(bias), 1.5) << codec;
        }
    }
}

TEST_F(SinkVideo, OddSizesArePaddedByRepeatingTheEdge) {
    for (const auto &[w, h] : {std::pair{131, 97}, {130, 97}, {131, 96}}) {
        const Picture picture(w, h, 5, 3 * w + 61);
        SinkUnderTest s = sink();
        ASSERT_EQ(s.start(w, h), ARHOST_STATUS_OK) << s.log();
        ASSERT_EQ(s.write(picture, make_record(0)), ARHOST_STATUS_OK);
        ASSERT_EQ(s.stop(), ARHOST_STATUS_OK);
        const Video video = read_video(path());
        ASSERT_EQ(video.frames.size(), 1u);
        const VideoFrame &frame = video.frames[0];
        EXPECT_EQ(frame.width, (w + 1) / 2 * 2);
        EXPECT_EQ(frame.height, (h + 1) / 2 * 2);
        EXPECT_GE(compare(frame, picture).psnr_db, 35);
        for (int y = 0; y < frame.height; ++y)
            for (int c = 0; c < 3; ++c)
                EXPECT_NEAR(frame.pixel(frame.width - 1, y)[c], picture.pixel(w - 1, std::min(y, h - 1))[c], 12);
        for (int x = 0; x < frame.width; ++x)
            for (int c = 0; c < 3; ++c)
                EXPECT_NEAR(frame.pixel(x, frame.height - 1)[c], picture.pixel(std::min(x, w - 1), h - 1)[c], 12);
    }
}

TEST_F(SinkVideo, ReadsNoByteOutsideTheFrame) { // reading past the end of a Picture crashes
    for (const int w : {64, 128, 336, 1024})
        for (const int h : {16, 64})
            sink({{"preset", "ultrafast"}}).start_and_write(w, h, 0, 2);
}

TEST_F(SinkVideo, KeepsTheFrameRate) {
    for (const auto &[fps, wanted] : {std::pair{25.0, AVRational{25, 1}},
                                      {30000 / 1001.0, AVRational{30000, 1001}},
                                      {59.94, AVRational{2997, 50}},
                                      {0.0, AVRational{30, 1}},
                                      {std::nan(""), AVRational{30, 1}}}) {
        run(sink(), 0, 4, fps);
        const Video video = read_video(path());
        EXPECT_EQ(av_cmp_q(video.fps, wanted), 0) << fps << " became " << video.fps.num << "/" << video.fps.den;
        EXPECT_EQ(video.numbers(), numbers(0, 4));
    }
}

TEST_F(SinkVideo, FrameNumbersAreRecoveredAtHighAndLowRates) {
    for (const double fps : {500.0, 499.7, 240.0, 0.5}) {
        sink().run(width, height, 0, 50, fps);
        const Video video = read_video(path());
        EXPECT_EQ(video.numbers(), numbers(0, 50)) << fps;
        EXPECT_NEAR(video.duration_s, 50 / fps, 1.01e-3) << fps; // MP4 stores the duration in whole milliseconds
    }
}

TEST_F(SinkVideo, AnInvalidFrameRateIsRejected) {
    for (const double fps : {1e-6, 501.0, std::numeric_limits<double>::infinity()}) {
        SinkUnderTest s = sink();
        EXPECT_EQ(s.start(width, height, 0, fps), ARHOST_STATUS_ERROR_CONFIGURATION) << fps;
        EXPECT_THAT(s.log(), HasSubstr("set 'fps' of the source"));
    }
}

TEST_F(SinkVideo, DroppedFramesKeepTheirDuration) {
    SinkUnderTest s = sink();
    ASSERT_EQ(s.start(width, height), ARHOST_STATUS_OK);
    for (const std::uint64_t i : {3, 4, 9, 10, 20})
        ASSERT_EQ(s.write(i), ARHOST_STATUS_OK);
    ASSERT_EQ(s.stop(), ARHOST_STATUS_OK);
    const Video video = read_video(path());
    EXPECT_THAT(video.numbers(), ElementsAre(3, 4, 9, 10, 20));
    EXPECT_NEAR(video.duration_s, 18 / 30.0, 1e-3); // the video starts with the first frame
}

// A camera's frames, numbered without gaps: some were skipped, and each is up to 4 ms off the nominal time. The clock
// shows ten days.
std::vector<std::int64_t> live_times_ns(std::size_t count) {
    std::vector<std::int64_t> times;
    std::int64_t slot = 0;
    for (std::size_t i = 0; i < count; ++i, slot += i % 7 == 0 ? 4 : 1)
        times.push_back(864'000'000'000'000 + slot * 33'333'333 + static_cast<std::int64_t>(i * 37 % 9) * 500'000);
    return times;
}

TEST_F(SinkVideo, FramesAreShownAtTheirCaptureTimes) {
    const std::vector<std::int64_t> captured_ns = live_times_ns(40);
    for (const std::string name : {"a.mp4", "a.mkv", "a.mov"})
        for (const std::string codec : {"h264", "mpeg4"})
            for (const std::uint64_t restart : {40, 15}) { // 40: none
                const auto write = [&](std::uint64_t first, std::uint64_t end, bool stops) {
                    SinkUnderTest s = sink({{"path", path(name).string()}, {"codec", codec}});
                    write_at(
                        s, first, end, [&](std::uint64_t i) { return captured_ns[i]; }, 30, ARHOST_CLOCK_MONOTONIC);
                    if (stops) {
                        ASSERT_EQ(s.stop(), ARHOST_STATUS_OK) << s.log();
                    }
                };
                write(0, restart, restart == 40);
                if (restart < 40)
                    write(restart - 2, 40, true); // the host repeats two frames
                const Video video = read_video(path(name));
                ASSERT_EQ(video.numbers(), numbers(0, 40)) << name << " " << codec << " " << restart;
                for (std::size_t i = 0; i < 40; ++i)
                    ASSERT_NEAR(video.times_s()[i], 1e-9 * static_cast<double>(captured_ns[i] - captured_ns[0]),
                                2.1e-3)
                        << name << " " << codec << ", frame " << i;
                EXPECT_NEAR(video.duration_s, video.times_s().back() + 1 / 30.0, 2e-3) << name << " " << codec;
            }
}

TEST_F(SinkVideo, AConstantRateRemainsConstant) {
    const AVRational rate{30000, 1001};
    SinkUnderTest s = sink();
    const auto captured_ns = [&](std::uint64_t i) {
        return 1'234'567 + std::llround(static_cast<double>(i) * 1e9 / av_q2d(rate));
    };
    write_at(s, 0, 100, captured_ns, av_q2d(rate));
    ASSERT_EQ(s.stop(), ARHOST_STATUS_OK);
    const Video video = read_video(path());
    EXPECT_EQ(av_cmp_q(video.fps, rate), 0);
    for (std::size_t i = 0; i < video.frames.size(); ++i)
        ASSERT_NEAR(video.times_s()[i], static_cast<double>(i) / av_q2d(rate), 1e-6);
}

TEST_F(SinkVideo, FramesWithEqualCaptureTimesAreKept) {
    for (const std::uint64_t first : {0, 3}) { // the second is a restart
        SinkUnderTest s = sink();
        write_at(s, first, first + 5, [](std::uint64_t) { return 0; });
        if (first > 0) {
            ASSERT_EQ(s.stop(), ARHOST_STATUS_OK);
        }
    }
    EXPECT_EQ(read_video(path()).numbers(), numbers(0, 8));
}

TEST_F(SinkVideo, TheSameFramesGiveTheSameBytesWithAnyNumberOfThreads) {
    for (const std::string threads : {"1", "3"}) {
        run(sink({{"threads", threads}}), 0, 10);
        run(sink({{"threads", threads}, {"path", path("again.mp4").string()}}), 0, 10);
        EXPECT_EQ(read_text(path()), read_text(path("again.mp4"))) << threads;
        EXPECT_EQ(read_video(path()).numbers(), numbers(0, 10)) << threads;
    }
}

TEST_F(SinkVideo, AHigherCrfGivesASmallerVideo) {
    for (const std::string codec : {"h264", "mpeg4"}) {
        run(sink({{"codec", codec}, {"path", path("fine.mp4").string()}}), 0, 5);
        run(sink({{"codec", codec}, {"crf", "40"}, {"path", path("coarse.mp4").string()}}), 0, 5);
        EXPECT_LT(read_text(path("coarse.mp4")).size() * 3, read_text(path("fine.mp4")).size() * 2) << codec;
    }
}

TEST_F(SinkVideo, TheIndexIsAtTheStartForStreaming) {
    run(sink(), 0, 5);
    const std::string video = read_text(path());
    EXPECT_LT(video.find("moov"), video.find("mdat"));
}

// ---- Kills and restarts ----------------------------------------------------------------------------

TEST_F(SinkVideo, ARestartGivesTheSameFramesAsARunWithoutOne) {
    for (const auto &[restart, end] : {std::pair{1, 15}, {2, 15}, {7, 15}, {10, 15}, {10, 10}}) {
        run_and_die(0, 10);
        run(sink(), restart, end); // the last one has no further frames
        EXPECT_EQ(read_video(path()).numbers(), numbers(0, end)) << "restarted at " << restart;
        EXPECT_THAT(names(), ElementsAre("demo.mp4"));
    }
}

TEST_F(SinkVideo, ManyRestartsGiveOneVideo) {
    run_and_die(0, 1);
    run_and_die(1, 2);
    run_and_die(2, 2); // the sink was killed before it wrote a frame
    run_and_die(2, 9);
    run_and_die(5, 6); // the host repeats frames from 5 on
    run_and_die(6, 6);
    run(sink(), 6, 12);
    const Video video = read_video(path());
    EXPECT_EQ(video.numbers(), numbers(0, 12));
    for (std::size_t i = 0; i < video.frames.size(); ++i)
        EXPECT_NEAR(video.times_s()[i], static_cast<double>(i) / 30, 1e-6);
    EXPECT_THAT(names(), ElementsAre("demo.mp4"));
}

TEST_F(SinkVideo, SurvivesAKillAtAnyMoment) {
    std::uint64_t next = 0;
    for (const std::uint64_t frames : {1, 12, 3, 5})
        next = write_until_killed("sink_video", with_path(), width, height, next, frames);
    run(sink(), next, next + 2);
    EXPECT_EQ(read_video(path()).numbers(), numbers(0, next + 2));
    EXPECT_THAT(names(), ElementsAre("demo.mp4"));
}

TEST_F(SinkVideo, ATruncatedSegmentIsPlayable) {
    run_and_die(0, 6);
    const auto segment = path(".demo.mp4.from0.mkv");
    EXPECT_THAT(names(), ElementsAre(".demo.mp4.from0.mkv"));
    EXPECT_EQ(read_video(segment).numbers(), numbers(0, 6));
    const std::string bytes = read_text(segment);
    const std::size_t last_frame = bytes.rfind("\x1f\x43\xb6\x75"); // a Matroska cluster's id
    for (std::size_t size = last_frame; size < bytes.size(); size += 1 + (bytes.size() - last_frame) / 40) {
        std::ofstream(segment, std::ios::binary | std::ios::trunc) << bytes.substr(0, size);
        run(sink(), 5, 7);
        EXPECT_EQ(read_video(path()).numbers(), numbers(0, 7)) << "cut at " << size - last_frame;
    }
}

TEST_F(SinkVideo, AnEmptySegmentHasNoFrames) {
    run_and_die(0, 3);
    std::ofstream(path(".demo.mp4.from3.mkv")) << "";
    SinkUnderTest s = sink();
    s.run(width, height, 4, 6);
    EXPECT_THAT(s.log(), HasSubstr("4 cannot read a frame from '" + path(".demo.mp4.from3.mkv").string()));
    EXPECT_THAT(read_video(path()).numbers(), ElementsAre(0, 1, 2, 4, 5));
}

TEST_F(SinkVideo, AKillWhileFinishingLeavesAWholeVideo) {
    run_and_die(0, 5);
    run_and_die(5, 8);
    const std::string first = read_text(path(".demo.mp4.from0.mkv")), second = read_text(path(".demo.mp4.from5.mkv"));
    run(sink(), 8, 8);
    const std::string video = read_text(path());

    // Simulates a kill after the video was written, but before its segments were deleted.
    std::ofstream(path(".demo.mp4.from0.mkv")) << first;
    std::ofstream(path(".demo.mp4.from5.mkv")) << second;
    run(sink(), 8, 8);
    EXPECT_EQ(read_text(path()), video);

    // Simulates a kill after the first segment was deleted.
    std::ofstream(path(".demo.mp4.from5.mkv")) << second;
    run(sink(), 8, 8);
    EXPECT_EQ(read_text(path()), video);

    // Simulates a kill after all segments were deleted.
    run(sink(), 8, 8);
    EXPECT_EQ(read_text(path()), video);
    EXPECT_THAT(names(), ElementsAre("demo.mp4"));
}

TEST_F(SinkVideo, AFreshStartRecoversTheFramesOfAnEarlierRun) {
    run_and_die(0, 5);
    run_and_die(5, 9);
    std::ofstream(path(".demo.mp4.partial")) << "x";
    std::ofstream(path(".demo.mp4.from7.txt")) << "unrelated";
    std::ofstream(path("demo.recovered-1.mp4")) << "an earlier one";
    SinkUnderTest s = sink();
    s.run(width, height, 0, 3);
    EXPECT_THAT(s.log(), HasSubstr("4 an earlier recording of '" + path().string() +
                                   "' was interrupted; its 9 frames are now in '" +
                                   path("demo.recovered-2.mp4").string() + "'"));
    EXPECT_EQ(read_video(path()).numbers(), numbers(0, 3));
    EXPECT_EQ(read_video(path("demo.recovered-2.mp4")).numbers(), numbers(0, 9));
    EXPECT_THAT(names(), UnorderedElementsAre(".demo.mp4.from7.txt", "demo.mp4", "demo.recovered-1.mp4",
                                              "demo.recovered-2.mp4"));
}

TEST_F(SinkVideo, FramesThatCannotBeRecoveredStayAndTheHostDoesNotRetry) {
    run_and_die(0, 5);
    const FileSizeLimit limit(100);
    SinkUnderTest s = sink();
    EXPECT_EQ(s.start(width, height), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(s.log(), HasSubstr("an earlier recording of '" + path().string() +
                                   "' was interrupted, and its frames cannot be recovered: cannot write '" +
                                   path(".demo.mp4.partial").string() + "': File too large"));
    EXPECT_THAT(s.log(), HasSubstr("; correct that, or move '" + path(".demo.mp4.from*.mkv").string() +
                                   "' to another folder"));
    EXPECT_THAT(names(), ElementsAre(".demo.mp4.from0.mkv"));
}

TEST_F(SinkVideo, AnOlderVideoStaysUntilTheNewOneIsComplete) {
    run(sink(), 0, 3);
    const std::string old = read_text(path());
    run_and_die(0, 5);
    EXPECT_EQ(read_text(path()), old);
    run(sink(), 5, 6);
    EXPECT_EQ(read_video(path()).numbers(), numbers(0, 6));
}

TEST_F(SinkVideo, ARestartWithoutItsFirstSegmentWarnsAndKeepsTheRest) {
    SinkUnderTest s = sink();
    s.run(width, height, 5, 8);
    EXPECT_THAT(s.log(), HasSubstr("4 the part of the video before frame 5 is lost"));
    EXPECT_EQ(read_video(path()).numbers(), numbers(5, 8));
}

TEST_F(SinkVideo, SegmentsWithOtherOptionsAreNotJoined) {
    run_and_die(0, 3);
    SinkUnderTest s = sink({{"preset", "ultrafast"}});
    s.start_and_write(width, height, 3, 5);
    EXPECT_EQ(s.stop(), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(s.log(), HasSubstr("encoded with different options"));
    EXPECT_THAT(names(), ElementsAre(".demo.mp4.from0.mkv", ".demo.mp4.from3.mkv")); // the segments are kept
}

TEST_F(SinkVideo, NoFramesGiveAWarningAndNoVideo) {
    SinkUnderTest s = sink();
    s.run(width, height, 0, 0);
    EXPECT_THAT(names(), IsEmpty());
    EXPECT_THAT(s.log(), HasSubstr("4 '" + path().string() + "' was not written, because there were no frames"));
}

// ---- Errors ----------------------------------------------------------------------------------------

TEST_F(SinkVideo, AnUnknownExtensionIsRejected) {
    for (const char *name : {"demo.avi", "demo", "demo.mp4.txt"}) {
        SinkUnderTest s = sink({{"path", path(name).string()}});
        EXPECT_EQ(s.created(), ARHOST_STATUS_ERROR_CONFIGURATION);
        EXPECT_THAT(s.log(), HasSubstr(".mp4, .mkv or .mov"));
    }
}

TEST_F(SinkVideo, AFullDiskIsAnIoErrorAndEarlierFramesAreKept) {
    {
        SinkUnderTest s = sink();
        s.start_and_write(width, height, 0, 3);
        const FileSizeLimit limit(std::filesystem::file_size(path(".demo.mp4.from0.mkv")) + 50);
        EXPECT_EQ(s.write(3), ARHOST_STATUS_ERROR_IO);
        EXPECT_THAT(s.log(), HasSubstr("File too large"));
        EXPECT_THAT(s.log(), HasSubstr(".demo.mp4.from0.mkv"));
    }
    run(sink(), 3, 6);
    EXPECT_EQ(read_video(path()).numbers(), numbers(0, 6));
}

TEST_F(SinkVideo, AFullDiskWhileFinishingKeepsTheFramesAndTheOlderVideo) {
    run(sink(), 0, 2);
    const std::string old = read_text(path());
    {
        SinkUnderTest s = sink();
        s.start_and_write(width, height, 0, 8);
        const FileSizeLimit limit(1500);
        EXPECT_EQ(s.stop(), ARHOST_STATUS_ERROR_IO);
        EXPECT_THAT(s.log(), HasSubstr("the frames are kept in"));
    }
    EXPECT_EQ(read_text(path()), old);
    EXPECT_THAT(names(), ElementsAre(".demo.mp4.from0.mkv", "demo.mp4"));
    run(sink(), 8, 8); // when the disk has free space, a restart finishes the video
    EXPECT_EQ(read_video(path()).numbers(), numbers(0, 8));
}

TEST_F(SinkVideo, AnUnwritableFolderFailsAtTheStart) {
    const UnwritableFolder locked(path("locked"));
    SinkUnderTest s = sink({{"path", path("locked/demo.mp4").string()}});
    EXPECT_EQ(s.start(width, height), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(s.log(), HasSubstr("locked/.demo.mp4.partial': Permission denied"));
}

TEST_F(SinkVideo, ThePathIsNotParsedAsAUrlOrPattern) {
    const auto odd = path("a:b %d, c'd.mp4");
    run(sink({{"path", odd.string()}}), 0, 2);
    EXPECT_THAT(names(), ElementsAre("a:b %d, c'd.mp4"));
    EXPECT_EQ(read_video(odd).numbers(), numbers(0, 2));
}

TEST_F(SinkVideo, MissingFoldersAreCreated) {
    run(sink({{"path", path("a/b/demo.mp4").string()}}), 0, 2);
    EXPECT_EQ(read_video(path("a/b/demo.mp4")).numbers(), numbers(0, 2));
}

TEST_F(SinkVideo, AFolderAsPathIsRejected) {
    std::filesystem::create_directory(path());
    SinkUnderTest s = sink();
    EXPECT_EQ(s.start(width, height), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(s.log(), HasSubstr("is a folder"));
}

TEST_F(SinkVideo, AFrameOfAnotherSizeIsRejected) {
    SinkUnderTest s = sink();
    ASSERT_EQ(s.start(width, height), ARHOST_STATUS_OK);
    EXPECT_EQ(s.write(Picture(width - 2, height, 0), make_record(0)), ARHOST_STATUS_ERROR_INVALID_ARGUMENT);
}
