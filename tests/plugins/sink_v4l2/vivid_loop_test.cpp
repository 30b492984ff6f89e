// SPDX-License-Identifier: Apache-2.0
//
// Writes to the output node of vivid, the kernel's virtual video device, which loops the pictures to its capture
// node. To be run in a virtual machine; see CMakeLists.txt for the parameters of the module.
#include "../../support/waiting.hpp"
#include "../../system/arhost_run.hpp"
#include "sink_common/sink_under_test.hpp"
#include "source_file/source_under_test.hpp"
#include "source_v4l2/frame_colours.hpp"

#include <gmock/gmock.h>

#include <fcntl.h>
#include <linux/v4l2-dv-timings.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <atomic>
#include <thread>

using namespace arhost::test;
using testing::HasSubstr;

namespace {

constexpr int width = 640, height = 480;

// A node of vivid.
class Node {
public:
    explicit Node(std::uint32_t capability) {
        for (int i = 0; i < 8; ++i) {
            path_ = "/dev/video" + std::to_string(i);
            fd_ = open(path_.c_str(), O_RDWR | O_CLOEXEC);
            v4l2_capability found{};
            if (fd_ >= 0 && ioctl(fd_, VIDIOC_QUERYCAP, &found) == 0 && found.device_caps & capability)
                return;
            close(fd_);
        }
        throw std::runtime_error("vivid has no such node; run this program with tools/vm/run-in-vm");
    }
    ~Node() { release(); }
    void release() { close(std::exchange(fd_, -1)); }
    Node(const Node &) = delete;
    Node &operator=(const Node &) = delete;

    const std::string &path() const { return path_; }
    // vivid's header with the ids of its controls is not installed.
    void set(const std::string &name, int value) const {
        v4l2_queryctrl query{};
        query.id = V4L2_CTRL_FLAG_NEXT_CTRL;
        for (; ioctl(fd_, VIDIOC_QUERYCTRL, &query) == 0; query.id |= V4L2_CTRL_FLAG_NEXT_CTRL)
            if (name == reinterpret_cast<const char *>(query.name)) {
                v4l2_control control{query.id, value};
                ASSERT_EQ(ioctl(fd_, VIDIOC_S_CTRL, &control), 0) << name;
                return;
            }
        FAIL() << path_ << " has no control '" << name << "'";
    }
    void set_size() const {
        v4l2_dv_timings timings = V4L2_DV_BT_DMT_640X480P60;
        ASSERT_EQ(ioctl(fd_, VIDIOC_S_DV_TIMINGS, &timings), 0) << path_;
    }

private:
    std::string path_;
    int fd_;
};

// Without `io: write`: vivid of Linux 6.1 rejects write(2), because the kernel passes it an image of 0 bytes.
class VividLoop : public testing::Test {
protected:
    void SetUp() override {
        capture_.set_size();
        output_.set_size();
        capture_.set("Loop Video", 1);
        capture_.set("OSD Text Mode", 2); // none
    }

    Node capture_{V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_VIDEO_CAPTURE_MPLANE};
    Node output_{V4L2_CAP_VIDEO_OUTPUT | V4L2_CAP_VIDEO_OUTPUT_MPLANE};
};

// Writes the same picture again and again until it is destroyed.
class Writer {
public:
    Writer(SinkUnderTest &sink, const Picture &picture)
        : thread_([this, &sink, &picture] {
              for (std::uint64_t n = 0; !stop_; ++n)
                  if ((status = sink.write(picture, make_record(n))) != ARHOST_STATUS_OK)
                      return;
          }) {}
    ~Writer() {
        stop_ = true;
        thread_.join();
    }
    Writer(const Writer &) = delete;
    Writer &operator=(const Writer &) = delete;

    std::atomic<arhost_status> status = ARHOST_STATUS_OK;

private:
    std::atomic<bool> stop_ = false;
    std::thread thread_;
};

// Returns the greatest difference to the picture, without the sharp squares at its top.
double difference(const arhost_frame_format &format, const SourceFrame &frame, const Picture &picture) {
    double greatest = 0;
    for (int y = 2 * Picture::square_px; y < height; y += 3)
        for (int x = 0; x < width; ++x) {
            const auto rgb = colour_at(format, frame.bytes, static_cast<std::size_t>(x), static_cast<std::size_t>(y));
            for (int i = 0; i < 3; ++i)
                greatest =
                    std::max(greatest, std::abs(rgb[static_cast<std::size_t>(i)] - picture.pixel(x, y)[2 - i]));
        }
    return greatest;
}

class VividLoopFormats : public VividLoop, public testing::WithParamInterface<std::string> {};

} // namespace

TEST_P(VividLoopFormats, TheCaptureNodeDeliversTheWrittenPicture) {
    SinkUnderTest sink("sink_v4l2", {{"device", output_.path()}, {"format", GetParam()}});
    ASSERT_EQ(sink.start(width, height), ARHOST_STATUS_OK) << sink.log();
    const Picture picture(width, height, 5);
    const Writer writer(sink, picture);
    SourceUnderTest source("source_v4l2");
    ASSERT_EQ(source.start({{"device", capture_.path()},
                            {"format", GetParam()},
                            {"width", std::to_string(width)},
                            {"height", std::to_string(height)}}),
              ARHOST_STATUS_OK)
        << source.log();
    double least = 255;
    constexpr double rounding = 6; // of YUV, and of the interpolation of chroma
    for (std::uint64_t n = 0; n < 100 && least > rounding; ++n) {
        const SourceFrame frame = source.read_frame(n);
        least = std::min(least, difference(source.format(), frame, picture));
    }
    EXPECT_LE(least, GetParam().ends_with("24") ? 0 : rounding) << sink.log();
    EXPECT_EQ(writer.status, ARHOST_STATUS_OK) << sink.log();
}

INSTANTIATE_TEST_SUITE_P(All, VividLoopFormats, testing::Values("yuyv", "nv12", "yuv420", "bgr24", "rgb24"),
                         [](const auto &info) { return info.param; });

TEST_F(VividLoop, RejectsASizeThatTheDeviceDoesNotTake) {
    SinkUnderTest sink("sink_v4l2", {{"device", output_.path()}});
    EXPECT_EQ(sink.start(20'000, 20'000), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(sink.log(), HasSubstr("does not take frames of 20000×20000 (it would take "));
}

TEST_F(VividLoop, RejectsACaptureNode) {
    SinkUnderTest sink("sink_v4l2", {{"device", capture_.path()}});
    EXPECT_EQ(sink.start(width, height), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(sink.log(), HasSubstr("does not accept pictures"));
}

TEST_F(VividLoop, ReportsADeviceInUse) {
    SinkUnderTest first("sink_v4l2", {{"device", output_.path()}});
    ASSERT_EQ(first.start(width, height), ARHOST_STATUS_OK) << first.log();
    SinkUnderTest second("sink_v4l2", {{"device", output_.path()}});
    EXPECT_EQ(second.start(width, height), ARHOST_STATUS_ERROR_IO);
    EXPECT_THAT(second.log(), HasSubstr("is in use by another program"));
}

TEST_F(VividLoop, ReportsALostDevice) {
    SinkUnderTest sink("sink_v4l2", {{"device", output_.path()}});
    ASSERT_EQ(sink.start(width, height), ARHOST_STATUS_OK) << sink.log();
    ASSERT_EQ(sink.write(0), ARHOST_STATUS_OK) << sink.log();
    output_.set("Disconnect", 1);
    arhost_status status = ARHOST_STATUS_OK;
    for (std::uint64_t n = 1; n < 10 && status == ARHOST_STATUS_OK; ++n)
        status = sink.write(n);
    EXPECT_EQ(status, ARHOST_STATUS_ERROR_DEVICE_LOST);
    EXPECT_THAT(sink.log(), HasSubstr("has disappeared"));
}

// With the sandbox, which shows only the nodes.
TEST_F(VividLoop, ARunWritesEveryFrame) {
    ArhostRun run("version: 1\nsource: {plugin: source_synthetic, options: {width: 640, height: 480, frames: 6}}\n"
                  "outputs: [{plugin: sink_v4l2, allow: [video], options: {device: " +
                  output_.path() + "}}]\nstats: stats.json\n");
    ASSERT_EQ(run.run(), 0) << run.output();
    EXPECT_EQ(run.stats()["frames"]["composited"], 6) << run.output();
}

TEST_F(VividLoop, ARunContinuesWhenALostDeviceIsBack) {
    ArhostRun run("version: 1\nsource: {plugin: source_synthetic, options: {width: 640, height: 480, frames: 20}}\n"
                  "outputs: [{plugin: sink_v4l2, allow: [video], options: {device: " +
                  output_.path() + "}}, {plugin: sink_poses, path: out/poses.jsonl}]\nstats: stats.json\n");
    run.start();
    EXPECT_TRUE(run.eventually([&] { return run.exists("out/poses.jsonl"); })) << run.output();
    output_.set("Disconnect", 1);
    output_.release(); // vivid connects again when all programs have closed it
    capture_.release();
    EXPECT_EQ(run.wait(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("has disappeared"));
    EXPECT_GE(run.stats()["restarts"]["sink_v4l2"], 1) << run.output();
}

TEST_F(VividLoop, ARunMeasuresTheLatencyFromTheOutputToTheCamera) {
    ArhostRun run("version: 1\nsource: {plugin: source_v4l2, allow: [video], options: {device: " + capture_.path() +
                  ", width: 640, height: 480}}\noutputs: [{plugin: sink_v4l2, allow: [video], options: {device: " +
                  output_.path() + "}}]\nlive: {max_latency_ms: 60000}\nstats: stats.json\n");
    ASSERT_EQ(run.run({"latency", "run.yaml", "--frames", "150"}), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("glass to glass: p50 "));
    const auto stats = run.stats();
    EXPECT_GE(stats["stages"]["glass_to_glass"]["count"], 3) << stats.dump(1) << run.output();
    // The light travels for no time, but each picture passes through the camera, the host and the output.
    EXPECT_GT(stats["stages"]["glass_to_glass"]["p50_ms"], stats["stages"]["latency"]["p50_ms"]) << run.output();
}
