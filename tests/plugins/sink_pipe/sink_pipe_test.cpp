// SPDX-License-Identifier: Apache-2.0
#include "fifo.hpp"
#include "sink_under_test.hpp"
#include "waiting.hpp"

#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <future>

namespace fs = std::filesystem;
using namespace arhost::test;
using testing::HasSubstr;
using testing::StartsWith;

namespace {

struct SinkPipe : testing::Test {
    SinkPipe() { std::signal(SIGPIPE, SIG_IGN); } // as arhost-launcher does for each worker

    ScratchFolder scratch;
    const fs::path fifo = make_fifo(scratch.path() / "fifo");
    const std::string path = fifo.string();

    static std::future<std::string> read_all(const fs::path &fifo) {
        return std::async(std::launch::async, [fifo] { return FifoReader(fifo).read_all(); });
    }
    static void wait_for_log(const SinkUnderTest &sink, const std::string &text) {
        EXPECT_TRUE(eventually([&] { return sink.log().find(text) != std::string::npos; })) << sink.log();
    }
    // The bytes that a reader receives for `frames` frames.
    std::string stream(const std::string &format, int width, int height, std::uint64_t frames, double fps = 30,
                       const std::string &matrix = "auto") {
        std::future<std::string> received = read_all(fifo);
        SinkUnderTest sink("sink_pipe", {{"path", path}, {"format", format}, {"matrix", matrix}});
        sink.run(width, height, 0, frames, fps);
        return received.get();
    }
};

// Y, Cb and Cr of limited range, by the formulas of BT.601 or BT.709.
std::array<double, 3> ycbcr_of(const std::uint8_t *bgr, double kr, double kb) {
    const double b = bgr[0], r = bgr[2], y = kr * r + (1 - kr - kb) * bgr[1] + kb * b;
    return {16 + y * 219 / 255, 128 + (b - y) / (2 * (1 - kb)) * 224 / 255,
            128 + (r - y) / (2 * (1 - kr)) * 224 / 255};
}

double byte(const std::string &bytes, std::size_t at) {
    return static_cast<std::uint8_t>(bytes.at(at));
}

// Checks each pixel of a frame with YUV 4:4:4 planes that begin at `at`.
void expect_yuv444(const std::string &stream, std::size_t at, const Picture &picture, double kr, double kb) {
    const std::size_t size = static_cast<std::size_t>(picture.width()) * static_cast<std::size_t>(picture.height());
    double greatest = 0;
    for (int y = 0; y < picture.height(); ++y)
        for (int x = 0; x < picture.width(); ++x) {
            const auto expected = ycbcr_of(picture.pixel(x, y), kr, kb);
            for (std::size_t plane = 0; plane < 3; ++plane)
                greatest = std::max(
                    greatest,
                    std::abs(byte(stream, at + plane * size + static_cast<std::size_t>(y * picture.width() + x)) -
                             expected[plane]));
        }
    constexpr double rounding = 2;
    EXPECT_LE(greatest, rounding);
}

} // namespace

TEST_F(SinkPipe, WritesPixelsExactly) {
    const Picture picture(13, 7, 1);
    for (const auto &[format, order] :
         {std::pair{"bgr", "012"}, std::pair{"rgb", "210"}, std::pair{"bgra", "012a"}, std::pair{"rgba", "210a"}}) {
        std::string expected;
        for (int y = 0; y < 7; ++y)
            for (int x = 0; x < 13; ++x)
                for (const char *c = order; *c; ++c)
                    expected += *c == 'a' ? '\xff' : static_cast<char>(picture.pixel(x, y)[*c - '0']);
        const std::string received = stream(format, 13, 7, 2);
        EXPECT_EQ(received.size(), 2 * expected.size()) << format;
        EXPECT_TRUE(received.ends_with(expected)) << format;
    }
}

TEST_F(SinkPipe, WritesTheOverlayAloneWithItsAlpha) {
    OverlayPicture overlay(13, 7);
    for (const auto &[format, order] : {std::pair{"rgba", "0123"}, std::pair{"bgra", "2103"}}) {
        std::string expected;
        for (std::uint32_t y = 0; y < 7; ++y)
            for (std::uint32_t x = 0; x < 13; ++x)
                for (const char *c = order; *c; ++c)
                    expected += static_cast<char>(overlay.pixel(x, y)[*c - '0']);
        std::future<std::string> received = read_all(fifo);
        SinkUnderTest sink("sink_pipe", {{"path", path}, {"format", format}, {"content", "overlay"}});
        EXPECT_EQ(sink.capabilities(), ARHOST_SINK_CAPABILITY_STANDARD_OUTPUT | ARHOST_SINK_CAPABILITY_OVERLAY_INPUT);
        ASSERT_EQ(sink.start(13, 7), ARHOST_STATUS_OK) << sink.log();
        EXPECT_EQ(sink.write(Picture(13, 7, 0), make_record(0), &overlay), ARHOST_STATUS_OK);
        EXPECT_EQ(sink.stop(), ARHOST_STATUS_OK);
        EXPECT_TRUE(received.get() == expected) << format;
    }
}

TEST_F(SinkPipe, AnOverlayNeedsAFormatWithAlpha) {
    for (const char *format : {"y4m", "y4m444", "rgb", "bgr"}) {
        const SinkUnderTest sink("sink_pipe", {{"path", path}, {"format", format}, {"content", "overlay"}});
        EXPECT_EQ(sink.created(), ARHOST_STATUS_ERROR_CONFIGURATION) << format;
        EXPECT_THAT(sink.log(), HasSubstr("needs 'format: rgba' or 'format: bgra'"));
    }
}

TEST_F(SinkPipe, WritesY4mWithOneHeader) {
    const std::string header = "YUV4MPEG2 W32 H16 F30:1 Ip A1:1 C420mpeg2 XYSCSS=420MPEG2 XCOLORRANGE=LIMITED\n";
    const std::string received = stream("y4m", 32, 16, 3);
    EXPECT_THAT(received, StartsWith(header + "FRAME\n"));
    EXPECT_EQ(received.size(), header.size() + 3 * (6 + 32 * 16 * 3 / 2));
}

TEST_F(SinkPipe, StatesTheRateOfTheSource) {
    EXPECT_THAT(stream("y4m", 2, 2, 1, 30000.0 / 1001), HasSubstr(" F30000:1001 "));
    EXPECT_THAT(stream("y4m", 2, 2, 1, 12.5), HasSubstr(" F25:2 "));
    EXPECT_THAT(stream("y4m", 2, 2, 1, 0), HasSubstr(" F30:1 "));
}

TEST_F(SinkPipe, OddSizesHaveNoPadding) {
    const std::string received = stream("y4m", 17, 9, 1);
    EXPECT_EQ(received.size(), received.find("FRAME\n") + 6 + 17 * 9 + 2 * 9 * 5);
}

TEST_F(SinkPipe, ConvertsColoursWithTheMatrix) {
    constexpr double kr601 = 0.299, kb601 = 0.114, kr709 = 0.2126, kb709 = 0.0722;
    const Picture small(90, 60, 0), large(20, 578, 0);
    const auto expect = [&](const Picture &picture, const char *matrix, double kr, double kb) {
        SCOPED_TRACE(matrix);
        const std::string received = stream("y4m444", picture.width(), picture.height(), 1, 30, matrix);
        expect_yuv444(received, received.find("FRAME\n") + 6, picture, kr, kb);
    };
    expect(small, "auto", kr601, kb601);
    expect(large, "auto", kr709, kb709);
    expect(small, "bt709", kr709, kb709);
    expect(large, "bt601", kr601, kb601);
}

TEST_F(SinkPipe, WaitsForAReader) {
    SinkUnderTest sink("sink_pipe", {{"path", path}, {"format", "bgr"}});
    ASSERT_EQ(sink.start(4, 4), ARHOST_STATUS_OK) << sink.log();
    auto written = std::async(std::launch::async, [&] { return sink.write(0, 2); });
    wait_for_log(sink, "waiting for a program to read '" + path + "'");
    const FifoReader reader(fifo);
    EXPECT_EQ(reader.read(96).size(), 96u);
    EXPECT_EQ(written.get(), ARHOST_STATUS_OK) << sink.log();
}

TEST_F(SinkPipe, StopsWaitingForAReaderWhenCancelled) {
    SinkUnderTest sink("sink_pipe", {{"path", path}});
    ASSERT_EQ(sink.start(4, 4), ARHOST_STATUS_OK) << sink.log();
    sink.cancel();
    EXPECT_EQ(sink.write(0), ARHOST_STATUS_ERROR_CANCELLED);
}

TEST_F(SinkPipe, StopsWaitingForAPausedReaderWhenCancelled) {
    auto reader = std::async(std::launch::async, [&] { return std::make_unique<FifoReader>(fifo); });
    SinkUnderTest sink("sink_pipe", {{"path", path}});
    ASSERT_EQ(sink.start(640, 480), ARHOST_STATUS_OK) << sink.log(); // larger than a pipe
    sink.cancel();
    arhost_status status = ARHOST_STATUS_ERROR_CANCELLED;
    EXPECT_EQ(sink.write(0), status) << sink.log();
    // If the write was cancelled before the reader had opened the FIFO, the reader still waits for a writer.
    const arhost::base::UniqueFd writer(open(path.c_str(), O_RDWR | O_CLOEXEC));
    reader.get();
}

TEST_F(SinkPipe, EndsWhenTheReaderClosesTheFifo) {
    auto reader = std::async(std::launch::async, [&] { return FifoReader(fifo).read(100).size(); });
    SinkUnderTest sink("sink_pipe", {{"path", path}});
    ASSERT_EQ(sink.start(640, 480), ARHOST_STATUS_OK) << sink.log();
    EXPECT_EQ(sink.write(0, 3), ARHOST_STATUS_END);
    EXPECT_EQ(reader.get(), 100u);
    EXPECT_EQ(sink.stop(), ARHOST_STATUS_OK);
    EXPECT_THAT(sink.log(), HasSubstr("has closed it"));
}

TEST_F(SinkPipe, BeginsAnotherStreamForTheNextReader) {
    SinkUnderTest sink("sink_pipe", {{"path", path}, {"reopen", "true"}});
    ASSERT_EQ(sink.start(640, 480), ARHOST_STATUS_OK) << sink.log();
    auto first = std::async(std::launch::async, [&] { return FifoReader(fifo).read(100); });
    auto written = std::async(std::launch::async, [&] { return sink.write(0, 1); });
    EXPECT_THAT(first.get(), StartsWith("YUV4MPEG2 "));
    wait_for_log(sink, "has closed it");
    auto second = read_all(fifo);
    EXPECT_EQ(written.get(), ARHOST_STATUS_OK) << sink.log();
    EXPECT_EQ(sink.stop(), ARHOST_STATUS_OK);
    const std::string received = second.get();
    EXPECT_THAT(received, StartsWith("YUV4MPEG2 "));
    EXPECT_EQ(received.size(), received.find("FRAME\n") + 6 + 640 * 480 * 3 / 2);
}

// The bytes of the first stream must not precede the header of the second.
TEST_F(SinkPipe, WaitsForTheEndOfAnEarlierStream) {
    arhost::base::UniqueFd earlier(open(path.c_str(), O_RDWR | O_CLOEXEC));
    ASSERT_EQ(::write(earlier.get(), "earlier", 7), 7);
    const arhost::base::UniqueFd reader(open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
    earlier.reset();
    SinkUnderTest sink("sink_pipe", {{"path", path}, {"format", "bgr"}});
    ASSERT_EQ(sink.start(4, 4), ARHOST_STATUS_OK) << sink.log();
    auto written = std::async(std::launch::async, [&] { return sink.write(0); });
    wait_for_log(sink, "has seen the end of an earlier stream");
    char bytes[100];
    EXPECT_EQ(::read(reader.get(), bytes, sizeof bytes), 7);
    EXPECT_EQ(::read(reader.get(), bytes, sizeof bytes), 0) << "the sink has the FIFO open, which hides its end";
    EXPECT_EQ(written.get(), ARHOST_STATUS_OK) << sink.log();
    EXPECT_EQ(::read(reader.get(), bytes, sizeof bytes), 48);
}

TEST_F(SinkPipe, DoesNotContinueAStreamAfterARestart) {
    SinkUnderTest sink("sink_pipe", {{"path", path}});
    ASSERT_EQ(sink.start(4, 4, 7), ARHOST_STATUS_OK) << sink.log();
    EXPECT_EQ(sink.write(7), ARHOST_STATUS_ERROR_IO);
    EXPECT_THAT(sink.log(), HasSubstr("was cut when this output was restarted"));
}

TEST_F(SinkPipe, RejectsPathsThatAreNotFifos) {
    std::ofstream(scratch.path() / "file") << "x";
    for (const auto &[name, message] :
         {std::pair{"missing", "does not exist; create it with 'mkfifo "}, std::pair{"file", "is not a FIFO"}}) {
        SinkUnderTest sink("sink_pipe", {{"path", scratch.path() / name}});
        EXPECT_EQ(sink.start(4, 4), ARHOST_STATUS_ERROR_CONFIGURATION);
        EXPECT_THAT(sink.log(), HasSubstr(message));
    }
}

TEST_F(SinkPipe, StandardOutputCannotBeReopened) {
    SinkUnderTest sink("sink_pipe", {{"path", "-"}, {"reopen", "true"}});
    EXPECT_EQ(sink.created(), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(sink.log(), HasSubstr("reopen: standard output cannot be opened again"));
}
