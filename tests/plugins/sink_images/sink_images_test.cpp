// SPDX-License-Identifier: Apache-2.0
#include "sink_under_test.hpp"

#include <gmock/gmock.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

using namespace arhost::test;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

namespace {

constexpr int width = 160, height = 90;

cv::Mat as_mat(const Picture &picture) {
    return cv::Mat(picture.height(), picture.width(), CV_8UC3, const_cast<std::uint8_t *>(picture.bgr()),
                   static_cast<std::size_t>(picture.stride()))
        .clone();
}

cv::Mat read_image(const std::filesystem::path &file) {
    return cv::imread(file.string(), cv::IMREAD_COLOR);
}

bool shows(const std::filesystem::path &file, std::uint64_t frame) {
    const cv::Mat image = read_image(file);
    return !image.empty() && image.size() == cv::Size(width, height) &&
           cv::norm(image, as_mat(Picture(width, height, frame)), cv::NORM_INF) == 0;
}

class SinkImages : public testing::Test {
protected:
    std::filesystem::path path(const std::string &name) const { return folder_.path() / name; }
    SinkUnderTest sink(const std::string &name, std::map<std::string, std::string> options = {}) const {
        options["path"] = path(name).string();
        return SinkUnderTest("sink_images", options);
    }
    // Starts the sink at frame `first`, writes the frames [first, end) and stops it.
    void run(SinkUnderTest &&s, std::uint64_t first, std::uint64_t end) const {
        s.run(width, height, first, end);
        EXPECT_EQ(s.log(), "");
    }
    // Writes the frames [0, end), then simulates a kill.
    void run_and_die(SinkUnderTest &&s, std::uint64_t end) const { s.start_and_write(width, height, 0, end); }
    std::vector<std::string> names() const { return names_in(folder_.path()); }

    ScratchFolder folder_;
};

} // namespace

// ---- Other contents --------------------------------------------------------------------------------

TEST_F(SinkImages, AnOverlayKeepsItsAlpha) {
    OverlayPicture overlay(width, height);
    for (const std::string name : {"%d.png", "last.png"}) { // written at once; kept until the end
        SinkUnderTest s = sink(name, {{"content", "overlay"}});
        EXPECT_EQ(s.capabilities(), ARHOST_SINK_CAPABILITY_NUMBERED_FILES | ARHOST_SINK_CAPABILITY_OVERLAY_INPUT);
        ASSERT_EQ(s.start(width, height), ARHOST_STATUS_OK) << s.log();
        ASSERT_EQ(s.write(Picture(width, height, 0), make_record(0), &overlay), ARHOST_STATUS_OK) << s.log();
        ASSERT_EQ(s.stop(), ARHOST_STATUS_OK) << s.log();
    }
    for (const char *name : {"0.png", "last.png"}) {
        const cv::Mat image = cv::imread(path(name).string(), cv::IMREAD_UNCHANGED);
        ASSERT_EQ(image.type(), CV_8UC4) << name;
        ASSERT_EQ(image.size(), cv::Size(width, height));
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) {
                const std::uint8_t *p = overlay.pixel(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y));
                ASSERT_EQ(image.at<cv::Vec4b>(y, x), cv::Vec4b(p[2], p[1], p[0], p[3])) << x << ", " << y;
            }
    }
}

TEST_F(SinkImages, DepthIsWrittenWith16Bits) {
    SinkUnderTest s = sink("depth_%d.png", {{"content", "depth"}});
    EXPECT_EQ(s.capabilities(), ARHOST_SINK_CAPABILITY_NUMBERED_FILES | ARHOST_SINK_CAPABILITY_VIDEO_INPUT);
    s.has_depth = true;
    ASSERT_EQ(s.start(width, height), ARHOST_STATUS_OK) << s.log();
    const std::size_t stride = s.video_format().depth_stride / 2;
    std::vector<std::uint16_t> depth_mm(stride * height, 0xdead);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            depth_mm[static_cast<std::size_t>(y) * stride + static_cast<std::size_t>(x)] =
                static_cast<std::uint16_t>(400 * x + 7 * y);
    ASSERT_EQ(s.write(Picture(width, height, 0), make_record(0), nullptr, depth_mm.data()), ARHOST_STATUS_OK);
    const cv::Mat image = cv::imread(path("depth_0.png").string(), cv::IMREAD_UNCHANGED);
    ASSERT_EQ(image.type(), CV_16UC1);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            ASSERT_EQ(image.at<std::uint16_t>(y, x), static_cast<std::uint16_t>(400 * x + 7 * y)) << x << ", " << y;
}

TEST_F(SinkImages, ContentsThatCannotBeWrittenAreRejected) {
    const SinkUnderTest jpeg = sink("%d.jpg", {{"content", "overlay"}});
    EXPECT_EQ(jpeg.created(), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(jpeg.log(), HasSubstr("content: JPEG stores neither transparent pixels nor depth"));
    SinkUnderTest depth = sink("%d.png", {{"content", "depth"}});
    EXPECT_EQ(depth.start(width, height), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(depth.log(), HasSubstr("content: the source delivers no depth"));
}

TEST_F(SinkImages, FramesNeedNoFurtherInputs) {
    EXPECT_EQ(sink("%d.png").capabilities(), ARHOST_SINK_CAPABILITY_NUMBERED_FILES);
}

// ---- Numbered images -------------------------------------------------------------------------------

TEST_F(SinkImages, EachAcknowledgedFrameIsANumberedPngOfTheSamePixels) {
    SinkUnderTest s = sink("f_%03d.png");
    ASSERT_EQ(s.start(width, height), ARHOST_STATUS_OK);
    for (std::uint64_t i = 0; i < 3; ++i) {
        ASSERT_EQ(s.write(i), ARHOST_STATUS_OK);
        EXPECT_TRUE(shows(path("f_00" + std::to_string(i) + ".png"), i)) << i;
    }
    EXPECT_EQ(s.stop(), ARHOST_STATUS_OK);
    EXPECT_EQ(s.log(), "");
    EXPECT_THAT(names(), ElementsAre("f_000.png", "f_001.png", "f_002.png"));
}

TEST_F(SinkImages, EveryNthFrameIsWritten) {
    run(sink("%d.png", {{"every", "3"}}), 0, 8);
    EXPECT_THAT(names(), ElementsAre("0.png", "3.png", "6.png"));
}

TEST_F(SinkImages, ARestartGivesTheSameBytesAsARunWithoutOne) {
    run_and_die(sink("%d.png"), 5);
    run(sink("%d.png"), 4, 8); // repeats frame 4, whose acknowledgement was lost
    run(sink("whole_%d.png"), 0, 8);
    for (int i = 0; i < 8; ++i)
        EXPECT_EQ(read_text(path(std::to_string(i) + ".png")),
                  read_text(path("whole_" + std::to_string(i) + ".png")));
    EXPECT_EQ(names().size(), 16u);
}

TEST_F(SinkImages, SurvivesAKillAtAnyMoment) {
    std::uint64_t next = 0;
    for (const std::uint64_t frames : {1, 5, 2})
        next = write_until_killed("sink_images", {{"path", path("%d.png").string()}}, width, height, next, frames);
    run(sink("%d.png"), next, next + 1);
    EXPECT_EQ(names().size(), next + 1); // no temporary file is left
    for (std::uint64_t i = 0; i <= next; ++i)
        EXPECT_TRUE(shows(path(std::to_string(i) + ".png"), i)) << i;
}

TEST_F(SinkImages, ImagesOfAnEarlierRunAreReportedAndKept) {
    run(sink("%d.png"), 0, 4);
    SinkUnderTest s = sink("%d.png");
    ASSERT_EQ(s.start(width, height), ARHOST_STATUS_OK);
    EXPECT_THAT(s.log(), HasSubstr("already contains 4 images whose names match the pattern"));
    EXPECT_EQ(names().size(), 4u);
}

TEST_F(SinkImages, JpegsAreCloseToTheFrame) {
    run(sink("%d.jpg"), 0, 1);
    run(sink("small_%d.JPEG", {{"quality", "50"}}), 0, 1);
    const cv::Mat frame = as_mat(Picture(width, height, 0));
    EXPECT_GT(cv::PSNR(read_image(path("0.jpg")), frame), 40);
    EXPECT_GT(cv::PSNR(read_image(path("small_0.JPEG")), frame), 25);
    EXPECT_LT(read_text(path("small_0.JPEG")).size() * 2, read_text(path("0.jpg")).size());
}

TEST_F(SinkImages, APngIsSmallerWithMoreCompressionAndHasTheSamePixels) {
    run(sink("fast_%d.png"), 0, 1);
    run(sink("small_%d.png", {{"compression", "12"}}), 0, 1);
    EXPECT_TRUE(shows(path("small_0.png"), 0));
    EXPECT_LT(read_text(path("small_0.png")).size(), read_text(path("fast_0.png")).size());
}

TEST_F(SinkImages, AcceptsOddSizesAndPaddedRowsWithoutTouchingOtherBytes) {
    for (const auto &[w, h] : {std::pair{1, 1}, {7, 5}, {33, 17}, {129, 3}}) {
        const Picture picture(w, h, 1, 3 * w + 64);
        for (const std::string name : {"odd_%d.png", "odd_%d.jpg"}) {
            SinkUnderTest s = sink(name);
            ASSERT_EQ(s.start(w, h), ARHOST_STATUS_OK);
            ASSERT_EQ(s.write(picture, make_record(0)), ARHOST_STATUS_OK) << s.log();
        }
        EXPECT_EQ(cv::norm(read_image(path("odd_0.png")), as_mat(picture), cv::NORM_INF), 0) << w << "×" << h;
        EXPECT_GT(cv::PSNR(read_image(path("odd_0.jpg")), as_mat(picture)), 25) << w << "×" << h;
    }
}

// ---- One image -------------------------------------------------------------------------------------

TEST_F(SinkImages, APathWithoutNumberHoldsTheLastFrameAlsoIfKilledAfterTheEnd) {
    for (const std::uint64_t first : {0, 5}) { // the second is a restart without further frames
        run(sink("demo.png"), first, 5);
        EXPECT_THAT(names(), ElementsAre("demo.png"));
        EXPECT_TRUE(shows(path("demo.png"), 4));
    }
}

TEST_F(SinkImages, TheLastFrameSurvivesAKillWithoutBeingSentAgain) {
    for (std::uint64_t frames = 1; frames < 4; ++frames) {
        run_and_die(sink("demo.png"), frames);
        run(sink("demo.png"), frames, frames); // restarted without further frames
        EXPECT_THAT(names(), ElementsAre("demo.png"));
        EXPECT_TRUE(shows(path("demo.png"), frames - 1)) << frames;
    }
}

TEST_F(SinkImages, TheLastFrameAfterAKillAtAnyMomentIsTheLastAcknowledgedOne) {
    std::uint64_t next = 0;
    for (const std::uint64_t frames : {1, 7, 4})
        next = write_until_killed("sink_images", {{"path", path("demo.png").string()}}, width, height, next, frames);
    run(sink("demo.png"), next, next);
    EXPECT_TRUE(shows(path("demo.png"), next - 1));
}

TEST_F(SinkImages, AKeptButUnacknowledgedFrameIsNotTheLast) {
    run_and_die(sink("demo.png"), 4);
    run(sink("demo.png"), 3, 3);
    EXPECT_TRUE(shows(path("demo.png"), 2));
}

TEST_F(SinkImages, OnlyTheChosenFrameIsWritten) {
    run(sink("demo.png", {{"frame", "2"}}), 0, 5);
    EXPECT_THAT(names(), ElementsAre("demo.png"));
    EXPECT_TRUE(shows(path("demo.png"), 2));
}

TEST_F(SinkImages, TheNextFrameReplacesADroppedChosenFrame) {
    SinkUnderTest s = sink("demo.png", {{"frame", "2"}});
    s.start_and_write(width, height, 0, 2);
    ASSERT_EQ(s.write(4, 6), ARHOST_STATUS_OK);
    EXPECT_TRUE(shows(path("demo.png"), 4));
}

TEST_F(SinkImages, TheChosenFrameSurvivesARestartBeforeAndAfterIt) {
    for (const std::uint64_t restart : {1, 2, 3, 4}) {
        run_and_die(sink("demo.png", {{"frame", "2"}}), restart);
        run(sink("demo.png", {{"frame", "2"}}), restart, 5);
        EXPECT_TRUE(shows(path("demo.png"), 2)) << restart;
    }
}

TEST_F(SinkImages, AnImageOfAnEarlierRunIsDeletedAtTheFirstFrame) {
    for (const char *frame : {"-1", "9"}) {
        std::ofstream(path("demo.png")) << "old";
        SinkUnderTest s = sink("demo.png", {{"frame", frame}});
        ASSERT_EQ(s.start(width, height), ARHOST_STATUS_OK);
        EXPECT_EQ(read_text(path("demo.png")), "old")
            << "start must not change the file, because the run may still fail to start";
        ASSERT_EQ(s.write(0, 1), ARHOST_STATUS_OK);
        if (frame == std::string("-1")) {
            ASSERT_EQ(s.stop(), ARHOST_STATUS_OK);
            EXPECT_NE(read_text(path("demo.png")), "old");
            continue;
        }
        EXPECT_EQ(s.stop(), ARHOST_STATUS_OK);
        EXPECT_THAT(names(), IsEmpty());
        EXPECT_THAT(s.log(), HasSubstr("4 '" + path("demo.png").string() + "' was not written"));
    }
}

// ---- Errors ----------------------------------------------------------------------------------------

TEST_F(SinkImages, ConflictingOptionsAreRejected) {
    struct Case {
        std::string path;
        std::map<std::string, std::string> options;
        std::string message;
    };
    for (const Case &c :
         {Case{"a.bmp", {}, "must end in .png, .jpg or .jpeg"}, Case{"a", {}, "must end in .png, .jpg or .jpeg"},
          Case{"%s.png", {}, "%05d"}, Case{"%d.png", {{"frame", "3"}}, "frame: is only allowed if"},
          Case{"a.png", {{"every", "2"}}, "every: is only allowed if"}}) {
        SinkUnderTest s = sink(c.path, c.options);
        EXPECT_EQ(s.created(), ARHOST_STATUS_ERROR_CONFIGURATION) << c.path;
        EXPECT_THAT(s.log(), HasSubstr(c.message));
    }
}

TEST_F(SinkImages, AFullDiskLeavesNoPartialImage) {
    SinkUnderTest s = sink("%d.png");
    s.start_and_write(width, height, 0, 1);
    {
        const FileSizeLimit limit(1000);
        EXPECT_EQ(s.write(1), ARHOST_STATUS_ERROR_IO);
    }
    EXPECT_THAT(names(), ElementsAre("0.png"));
    EXPECT_THAT(s.log(), HasSubstr("File too large"));
    EXPECT_EQ(s.write(1), ARHOST_STATUS_OK);
    EXPECT_TRUE(shows(path("1.png"), 1));
}

TEST_F(SinkImages, AFullDiskFailsWhenKeepingTheLastFrame) {
    SinkUnderTest s = sink("demo.png");
    ASSERT_EQ(s.start(width, height), ARHOST_STATUS_OK);
    {
        const FileSizeLimit limit(1000);
        EXPECT_EQ(s.write(0), ARHOST_STATUS_ERROR_IO);
    }
    ASSERT_EQ(s.write(0), ARHOST_STATUS_OK);
    {
        const FileSizeLimit limit(1000);
        EXPECT_EQ(s.stop(), ARHOST_STATUS_ERROR_IO);
    }
    EXPECT_FALSE(std::filesystem::exists(path("demo.png")));
    run(sink("demo.png"), 1, 1); // when the disk has free space, a restart finishes the image
    EXPECT_TRUE(shows(path("demo.png"), 0));
    EXPECT_THAT(names(), ElementsAre("demo.png"));
}

TEST_F(SinkImages, AnUnwritableFolderFailsAtTheStart) {
    const UnwritableFolder locked(path("locked"));
    for (const std::string name : {"locked/%d.png", "locked/demo.png"}) {
        SinkUnderTest s = sink(name);
        EXPECT_EQ(s.start(width, height), ARHOST_STATUS_ERROR_CONFIGURATION);
        EXPECT_THAT(s.log(), HasSubstr("Permission denied"));
    }
}

TEST_F(SinkImages, MissingFoldersAreCreated) {
    run(sink("a/b/%d.png"), 0, 1);
    EXPECT_TRUE(shows(path("a/b/0.png"), 0));
}

TEST_F(SinkImages, AFolderAsPathIsRejected) {
    std::filesystem::create_directory(path("sub.png"));
    SinkUnderTest s = sink("sub.png");
    EXPECT_EQ(s.start(width, height), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(s.log(), HasSubstr("is a folder"));
}
