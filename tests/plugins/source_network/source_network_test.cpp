// SPDX-License-Identifier: Apache-2.0
#include "camera_server.hpp"
#include "source_under_test.hpp"

#include <gmock/gmock.h>

#include <chrono>
#include <cmath>
#include <numeric>
#include <thread>

using namespace arhost::test;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

namespace {

constexpr const char *id = "source_network";

std::int64_t now_ns() {
    return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// The number of the picture, from its mean luma; −1 if it is none of the pictures.
int number_of(const SourceFrame &frame, const SourceUnderTest &source) {
    const std::size_t count = std::size_t{source.format().width} * source.format().height;
    const double luma =
        std::accumulate(frame.bytes.begin(), frame.bytes.begin() + static_cast<std::ptrdiff_t>(count), 0.0) /
        static_cast<double>(count);
    const int number = static_cast<int>(std::lround((luma - 40) / 12));
    return std::abs(luma - 40 - 12 * number) < 3 && number < picture_count ? number : -1;
}

arhost_source_setup live() {
    arhost_source_setup setup{};
    setup.paced = 1;
    return setup;
}

// Reads `count` frames and checks that they are the camera's pictures in order, with ascending times.
void expect_pictures(SourceUnderTest &source, int count) {
    int last = -1;
    std::int64_t last_ns = 0;
    for (int n = 0; n < count; ++n) {
        const SourceFrame frame = source.read(static_cast<std::uint64_t>(n));
        ASSERT_EQ(frame.status, ARHOST_STATUS_OK) << source.log();
        EXPECT_EQ(frame.info.clock, ARHOST_CLOCK_MONOTONIC);
        EXPECT_GT(frame.info.capture_ns, last_ns) << "frame " << n;
        EXPECT_LE(frame.info.capture_ns, now_ns());
        EXPECT_GT(frame.info.capture_ns, now_ns() - 20'000'000'000);
        const int number = number_of(frame, source);
        ASSERT_NE(number, -1) << "frame " << n;
        if (last >= 0) {
            EXPECT_EQ(number, (last + 1 + static_cast<int>(frame.info.skipped)) % picture_count) << "frame " << n;
        }
        last = number;
        last_ns = frame.info.capture_ns;
    }
}

// Returns the error message of a start that must fail.
std::string error_of(const std::map<std::string, std::string> &options) {
    SourceUnderTest source(id);
    EXPECT_EQ(source.start(options, live()), ARHOST_STATUS_ERROR_CONFIGURATION) << source.log();
    const std::string log = source.log();
    EXPECT_THAT(log, AllOf(Not(HasSubstr("s3cr")), Not(HasSubstr("camera:")))) << "shows the password";
    return source.log(ARHOST_SEVERITY_ERROR);
}

class Rtsp : public testing::TestWithParam<std::map<std::string, std::string>> {};

} // namespace

// ---- RTSP ------------------------------------------------------------------------------------------

TEST_P(Rtsp, DeliversThePicturesOfTheCamera) {
    ARHOST_REQUIRE_RTSP_SERVER();
    const Media media;
    const CameraServer server("rtsp", media);
    std::map<std::string, std::string> options = GetParam();
    options["url"] = server.url(options["url"], user_and_password);
    SourceUnderTest source(id);
    ASSERT_EQ(source.start(options, live()), ARHOST_STATUS_OK) << source.log();
    EXPECT_EQ(source.format().width, 160u);
    EXPECT_EQ(source.format().height, 120u);
    EXPECT_EQ(source.format().pixel_format, ARHOST_PIXEL_FORMAT_I420);
    // RTP with JPEG does not tell the rate.
    EXPECT_NEAR(source.format().fps, GetParam().at("url") == "jpeg" ? 0 : 25, 0.1);
    expect_pictures(source, 60);
    EXPECT_EQ(source.log(ARHOST_SEVERITY_WARNING), "");
    EXPECT_THAT(source.log(), AllOf(Not(HasSubstr("s3cr")), Not(HasSubstr("camera:"))));
}

INSTANTIATE_TEST_SUITE_P(Streams, Rtsp,
                         testing::Values(std::map<std::string, std::string>{{"url", "h264"}},
                                         std::map<std::string, std::string>{{"url", "h264"}, {"transport", "udp"}},
                                         std::map<std::string, std::string>{{"url", "h264"},
                                                                            {"sender_clock", "true"}},
                                         std::map<std::string, std::string>{{"url", "jpeg"}},
                                         std::map<std::string, std::string>{{"url", "sound"}},
                                         std::map<std::string, std::string>{{"url", "private"}}),
                         [](const auto &info) {
                             std::string name;
                             for (const auto &[key, value] : info.param)
                                 name += (key == "url" ? "" : key + "_") + value;
                             name.erase(std::remove(name.begin(), name.end(), '_'), name.end());
                             return name;
                         });

TEST(RtspErrors, NameTheCause) {
    ARHOST_REQUIRE_RTSP_SERVER();
    const Media media;
    CameraServer server("rtsp", media);
    EXPECT_THAT(error_of({{"url", server.url("none", user_and_password)}}), HasSubstr("404 Not Found"));
    for (const std::string user : {"", "camera:wrong", "nobody:s3cr"})
        EXPECT_THAT(error_of({{"url", server.url("private", user)}}),
                    AllOf(HasSubstr("401 Unauthorized"), HasSubstr("correct the user name and password")));
    EXPECT_THAT(error_of({{"url", server.url("only-sound")}}), HasSubstr("it may have no video"));
    server.kill();
    EXPECT_THAT(error_of({{"url", server.url("h264")}}),
                HasSubstr("the stream '" + server.url("h264") + "' cannot be received: Connection refused"));
}

TEST(RtspErrors, IncludeAServerThatSpeaksAnotherProtocol) {
    ARHOST_REQUIRE_FFMPEG();
    const Media media;
    const CameraServer server("http", media);
    const std::string address = server.url("silent").substr(4);
    EXPECT_THAT(error_of({{"url", "rtsp" + address}, {"timeout_ms", "1000"}}), HasSubstr("cannot be received: "));
}

TEST(Rtsp, ComesBackAfterTheServerHasDied) {
    ARHOST_REQUIRE_RTSP_SERVER();
    const Media media;
    CameraServer server("rtsp", media);
    SourceUnderTest source(id);
    ASSERT_EQ(source.start({{"url", server.url("h264", user_and_password)}}, live()), ARHOST_STATUS_OK)
        << source.log();
    expect_pictures(source, 10);
    std::int64_t last_ns = source.read(10).info.capture_ns;
    for (int outage = 1; outage <= 2; ++outage) {
        server.kill();
        std::thread restart([&] {
            std::this_thread::sleep_for(std::chrono::milliseconds(1500)); // several attempts fail
            server.start();
        });
        // Pictures that were on their way when the server died come first.
        for (int n = 0; n < 20; ++n) {
            const SourceFrame frame = source.read(0);
            ASSERT_EQ(frame.status, ARHOST_STATUS_OK) << source.log();
            EXPECT_GT(frame.info.capture_ns, last_ns);
            EXPECT_LE(frame.info.capture_ns, now_ns());
            EXPECT_NE(number_of(frame, source), -1);
            last_ns = frame.info.capture_ns;
        }
        restart.join();
        const std::string warnings = source.log(ARHOST_SEVERITY_WARNING), notes = source.log(ARHOST_SEVERITY_INFO);
        EXPECT_EQ(std::count(warnings.begin(), warnings.end(), '\n'), outage) << warnings;
        EXPECT_THAT(warnings, AllOf(HasSubstr("reconnecting until it is back"), Not(HasSubstr("s3cr"))));
        EXPECT_THAT(notes, HasSubstr("is back"));
    }
}

// ---- HTTP ------------------------------------------------------------------------------------------

TEST(Http, DeliversMotionJpeg) {
    ARHOST_REQUIRE_FFMPEG();
    const Media media;
    const CameraServer server("http", media);
    SourceUnderTest source(id);
    ASSERT_EQ(source.start({{"url", server.url("private/mjpeg?token=s3cr", user_and_password)}}, live()),
              ARHOST_STATUS_OK)
        << source.log();
    EXPECT_EQ(source.format().pixel_format, ARHOST_PIXEL_FORMAT_I420);
    EXPECT_EQ(source.format().yuv_range, ARHOST_YUV_RANGE_FULL);
    expect_pictures(source, 60);
    EXPECT_EQ(source.log(ARHOST_SEVERITY_WARNING), "");
    EXPECT_THAT(source.log(), AllOf(Not(HasSubstr("s3cr")), Not(HasSubstr("camera:"))));
}

TEST(Http, LiveModeDropsPicturesThatAreNotReadInTime) {
    ARHOST_REQUIRE_FFMPEG();
    const Media media;
    const CameraServer server("http", media);
    SourceUnderTest source(id);
    ASSERT_EQ(source.start({{"url", server.url("mjpeg")}}, live()), ARHOST_STATUS_OK) << source.log();
    SourceFrame last = source.read(0);
    bool has_skipped = false;
    for (int n = 1; n < 100 && !has_skipped; ++n) {
        std::this_thread::sleep_for(std::chrono::milliseconds(200));
        const SourceFrame frame = source.read(static_cast<std::uint64_t>(n));
        ASSERT_EQ(frame.status, ARHOST_STATUS_OK) << source.log();
        EXPECT_EQ(number_of(frame, source),
                  (number_of(last, source) + 1 + static_cast<int>(frame.info.skipped)) % 16);
        has_skipped = frame.info.skipped > 0;
        last = frame;
    }
    EXPECT_TRUE(has_skipped);
}

TEST(Http, TruncatedPicturesAreSkippedAndCounted) {
    ARHOST_REQUIRE_FFMPEG();
    const Media media;
    const CameraServer server("http", media);
    SourceUnderTest source(id);
    ASSERT_EQ(source.start({{"url", server.url("truncated")}}), ARHOST_STATUS_OK) << source.log();
    source.read(0);
    for (std::uint64_t n = 1; n < 20; ++n) {
        const SourceFrame frame = source.read(n);
        ASSERT_EQ(frame.status, ARHOST_STATUS_OK) << source.log();
        EXPECT_EQ(number_of(frame, source) % 2, 0) << "delivers a truncated picture";
        EXPECT_EQ(frame.info.skipped % 2, 1u) << "counts each truncated picture";
    }
    EXPECT_GE(source.plugin().counters().at("damaged"), 19u);
    source.stop();
    EXPECT_THAT(error_of({{"url", server.url("broken")}, {"timeout_ms", "1000"}}),
                AllOf(HasSubstr("no intact picture has arrived for 1000 ms (timeout_ms)"), HasSubstr("damaged")));
}

TEST(Http, ErrorsNameTheCause) {
    ARHOST_REQUIRE_FFMPEG();
    const Media media;
    CameraServer server("http", media);
    EXPECT_THAT(error_of({{"url", server.url("none", user_and_password)}}), HasSubstr("404 Not Found"));
    EXPECT_THAT(error_of({{"url", server.url("private/mjpeg", "camera:wrong")}}), HasSubstr("401 Unauthorized"));
    EXPECT_THAT(error_of({{"url", server.url("garbage")}}), HasSubstr("no video that arhost plays"));
    EXPECT_THAT(error_of({{"url", server.url("silent")}, {"timeout_ms", "500"}}),
                HasSubstr("the server has not answered within 500 ms (timeout_ms)"));
    EXPECT_THAT(error_of({{"url", "rtsp://host/"}, {"timeout_ms", "100"}}), HasSubstr("cannot be received"));
    server.kill();
    EXPECT_THAT(error_of({{"url", server.url("mjpeg")}}), HasSubstr("Connection refused"));
    EXPECT_THAT(error_of({{"url", "ftp://camera:s3cr@host/"}}), HasSubstr("must begin with rtsp://"));
}

TEST(Http, AStartCanBeCancelled) {
    ARHOST_REQUIRE_FFMPEG();
    const Media media;
    const CameraServer server("http", media);
    SourceUnderTest source(id);
    source.plugin().cancel(5);
    EXPECT_EQ(source.start({{"url", server.url("silent")}, {"timeout_ms", "600000"}}, live()),
              ARHOST_STATUS_ERROR_CANCELLED);
}

TEST(Http, AReadCanBeCancelledAndALostCameraIsReportedOnce) {
    ARHOST_REQUIRE_FFMPEG();
    const Media media;
    CameraServer server("http", media);
    SourceUnderTest source(id);
    ASSERT_EQ(source.start({{"url", server.url("mjpeg")}}, live()), ARHOST_STATUS_OK) << source.log();
    server.kill();
    source.plugin().cancel(100); // 2 s of waiting
    const std::vector<SourceFrame> frames = source.read_all();
    EXPECT_EQ(frames.back().status, ARHOST_STATUS_ERROR_CANCELLED);
    const std::string warnings = source.log(ARHOST_SEVERITY_WARNING);
    EXPECT_EQ(std::count(warnings.begin(), warnings.end(), '\n'), 1) << warnings;
}

TEST(Http, ACameraThatStopsSendingIsConnectedAgain) {
    ARHOST_REQUIRE_FFMPEG();
    const Media media;
    const CameraServer server("http", media);
    SourceUnderTest source(id);
    ASSERT_EQ(source.start({{"url", server.url("stalls")}, {"timeout_ms", "1000"}}), ARHOST_STATUS_OK)
        << source.log();
    for (int n = 0; n < 24; ++n) // ten in each connection
        ASSERT_EQ(number_of(source.read(0), source), n % 10) << source.log();
    EXPECT_THAT(source.log(ARHOST_SEVERITY_WARNING), HasSubstr("no intact picture has arrived for 1000 ms"));
}

TEST(Http, AChangeOfTheFrameSizeIsAnError) {
    ARHOST_REQUIRE_FFMPEG();
    const Media media;
    const CameraServer server("http", media);
    SourceUnderTest source(id);
    ASSERT_EQ(source.start({{"url", server.url("grows")}}), ARHOST_STATUS_OK) << source.log();
    EXPECT_EQ(source.read_all().back().status, ARHOST_STATUS_ERROR_DEVICE_LOST);
    EXPECT_THAT(source.log(ARHOST_SEVERITY_ERROR), HasSubstr("has changed from 160×120 to 320×240 px"));
}

TEST(Http, TheSizeOfTheCalibrationMustMatch) {
    ARHOST_REQUIRE_FFMPEG();
    const Media media;
    const CameraServer server("http", media);
    SourceUnderTest source(id);
    arhost_intrinsics camera{};
    camera.struct_size = sizeof camera;
    camera.width = 640;
    camera.height = 480;
    arhost_source_setup setup = live();
    setup.intrinsics = &camera;
    EXPECT_EQ(source.start({{"url", server.url("mjpeg")}}, setup), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(source.log(), HasSubstr("160×120 px, but the camera calibration is for 640×480"));
}

TEST(Http, CertificatesAreVerifiedUnlessTheConfigurationSaysOtherwise) {
    ARHOST_REQUIRE_FFMPEG();
    const Media media;
    const CameraServer server("https", media);
    for (const char *path : {"mjpeg", "vod.m3u8"}) {
        EXPECT_THAT(error_of({{"url", server.url(path)}}), HasSubstr("certificate")) << path;
        SourceUnderTest source(id);
        ASSERT_EQ(source.start({{"url", server.url(path)}, {"tls_verify", "false"}}), ARHOST_STATUS_OK)
            << source.log();
        expect_pictures(source, 10);
    }
}

// ---- HLS -------------------------------------------------------------------------------------------

TEST(Hls, PlaysARecordingToItsEndInRealTime) {
    ARHOST_REQUIRE_FFMPEG();
    const Media media;
    const CameraServer server("http", media);
    SourceUnderTest source(id);
    ASSERT_EQ(source.start({{"url", server.url("vod.m3u8")}}), ARHOST_STATUS_OK) << source.log();
    EXPECT_NEAR(source.format().fps, 25, 0.1);
    const std::vector<SourceFrame> frames = source.read_all();
    EXPECT_EQ(frames.back().status, ARHOST_STATUS_END);
    std::uint64_t count = 0;
    for (std::size_t n = 0; n + 1 < frames.size(); ++n)
        count += 1 + frames[n].info.skipped;
    EXPECT_EQ(count, 50u);
    EXPECT_GE(frames[frames.size() - 2].info.capture_ns - frames[0].info.capture_ns, 1'900'000'000)
        << "the frames must not come faster than in real time";
    EXPECT_EQ(source.read(0).status, ARHOST_STATUS_END);
}

TEST(Hls, FollowsALiveStream) {
    ARHOST_REQUIRE_FFMPEG();
    const Media media;
    const CameraServer server("http", media);
    SourceUnderTest source(id);
    ASSERT_EQ(source.start({{"url", server.url("live.m3u8")}}, live()), ARHOST_STATUS_OK) << source.log();
    expect_pictures(source, 75);
    EXPECT_EQ(source.log(ARHOST_SEVERITY_WARNING), "");
}

// The sandbox would block the file as well; this test runs without it.
TEST(Hls, NeverOpensFilesThatAServerNames) {
    ARHOST_REQUIRE_FFMPEG();
    const Media media;
    const CameraServer server("http", media);
    for (const char *path : {"passwd.m3u8", "files.m3u8"})
        EXPECT_THAT(error_of({{"url", server.url(path)}, {"timeout_ms", "1500"}}), HasSubstr("cannot be received"))
            << path;
    EXPECT_THAT(error_of({{"url", server.url("redirect")}}), HasSubstr("cannot be received"));
    EXPECT_THAT(error_of({{"url", server.url("list")}}), HasSubstr("no video that arhost plays"));
    SourceUnderTest source(id); // the same segments play over HTTP
    ASSERT_EQ(source.start({{"url", server.url("hls0.ts")}}), ARHOST_STATUS_OK) << source.log();
}
