// SPDX-License-Identifier: Apache-2.0
#include "camera_server.hpp"
#include "process_state.hpp"
#include "source_under_test.hpp"
#include "waiting.hpp"

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
    return source_setup(0, true);
}

// Reads `count` frames and checks that they are the camera's pictures in order, with ascending times.
void expect_pictures(SourceUnderTest &source, int count) {
    int last = -1;
    std::int64_t last_ns = 0;
    for (int n = 0; n < count; ++n) {
        const SourceFrame frame = source.read_frame(static_cast<std::uint64_t>(n));
        EXPECT_EQ(frame.info.clock, ARHOST_CLOCK_MONOTONIC);
        EXPECT_GT(frame.info.capture_ns, last_ns) << "frame " << n;
        EXPECT_LE(frame.info.capture_ns, monotonic_ns());
        EXPECT_GT(frame.info.capture_ns, monotonic_ns() - 20'000'000'000);
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

// A camera server of this protocol, and the plugin.
class Network : public testing::Test {
protected:
    void serve(const std::string &protocol) { server_.emplace(protocol, media_.emplace()); }
    std::string url(const std::string &path, const std::string &user = "") const { return server_->url(path, user); }
    void start(const std::map<std::string, std::string> &options, arhost_source_setup setup = live()) {
        if (source_.start(options, setup) != ARHOST_STATUS_OK)
            throw std::runtime_error(source_.log());
    }
    std::string warnings() const { return source_.log(ARHOST_SEVERITY_WARNING); }
    std::ptrdiff_t warning_count() const { return std::ranges::count(warnings(), '\n'); }

    std::optional<Media> media_;
    std::optional<CameraServer> server_;
    SourceUnderTest source_{id};
};
class Rtsp : public Network {
protected:
    void SetUp() override {
        ARHOST_REQUIRE_RTSP_SERVER();
        serve("rtsp");
    }
};
struct Stream {
    const char *name, *path;
    std::map<std::string, std::string> options{};

    friend void PrintTo(const Stream &stream, std::ostream *out) { *out << stream.name; }
};
class RtspStream : public Rtsp, public testing::WithParamInterface<Stream> {};
class Http : public Network {
protected:
    void SetUp() override {
        ARHOST_REQUIRE_FFMPEG();
        serve("http");
    }
};
class Hls : public Http {};
class Https : public Network {};

} // namespace

// ---- RTSP ------------------------------------------------------------------------------------------

TEST_P(RtspStream, DeliversThePicturesOfTheCamera) {
    const auto &[name, path, more] = GetParam();
    std::map<std::string, std::string> options = more;
    options["url"] = url(path, user_and_password);
    start(options);
    EXPECT_EQ(source_.format().width, 160u);
    EXPECT_EQ(source_.format().height, 120u);
    EXPECT_EQ(source_.format().pixel_format, ARHOST_PIXEL_FORMAT_I420);
    // RTP with JPEG does not tell the rate.
    EXPECT_NEAR(source_.format().fps, std::string(path) == "jpeg" ? 0 : 25, 0.1);
    expect_pictures(source_, 60);
    EXPECT_EQ(source_.log(ARHOST_SEVERITY_WARNING), "");
    EXPECT_THAT(source_.log(), AllOf(Not(HasSubstr("s3cr")), Not(HasSubstr("camera:"))));
}

INSTANTIATE_TEST_SUITE_P(Streams, RtspStream,
                         testing::Values(Stream{"h264", "h264"}, Stream{"udp", "h264", {{"transport", "udp"}}},
                                         Stream{"senderClock", "h264", {{"sender_clock", "true"}}},
                                         Stream{"jpeg", "jpeg"}, Stream{"sound", "sound"},
                                         Stream{"private", "private"}),
                         [](const auto &info) { return info.param.name; });

TEST_F(Rtsp, ErrorsNameTheCause) {
    EXPECT_THAT(error_of({{"url", url("none", user_and_password)}}), HasSubstr("404 Not Found"));
    for (const std::string user : {"", "camera:wrong", "nobody:s3cr"})
        EXPECT_THAT(error_of({{"url", url("private", user)}}),
                    AllOf(HasSubstr("401 Unauthorized"), HasSubstr("correct the user name and password")));
    EXPECT_THAT(error_of({{"url", url("only-sound")}}), HasSubstr("it may have no video"));
    server_->kill();
    EXPECT_THAT(error_of({{"url", url("h264")}}),
                HasSubstr("the stream '" + url("h264") + "' cannot be received: Connection refused"));
}

TEST_F(Http, IsNoRtsp) {
    const std::string address = url("silent").substr(4);
    EXPECT_THAT(error_of({{"url", "rtsp" + address}, {"timeout_ms", "1000"}}), HasSubstr("cannot be received: "));
}

TEST_F(Rtsp, ComesBackAfterTheServerHasDied) {
    start({{"url", url("h264", user_and_password)}});
    expect_pictures(source_, 10);
    std::int64_t last_ns = source_.read(10).info.capture_ns;
    for (int outage = 1; outage <= 2; ++outage) {
        server_->kill();
        std::thread restart([&] {
            EXPECT_TRUE(eventually([&] { return warning_count() == outage; })) << "an attempt must have failed";
            server_->start();
        });
        // Pictures that were on their way when the server died come first.
        for (int n = 0; n < 20; ++n) {
            const SourceFrame frame = source_.read_frame(0);
            EXPECT_GT(frame.info.capture_ns, last_ns);
            EXPECT_LE(frame.info.capture_ns, monotonic_ns());
            EXPECT_NE(number_of(frame, source_), -1);
            last_ns = frame.info.capture_ns;
        }
        restart.join();
        EXPECT_EQ(warning_count(), outage) << warnings();
        EXPECT_THAT(warnings(), AllOf(HasSubstr("reconnecting until it is back"), Not(HasSubstr("s3cr"))));
        EXPECT_THAT(source_.log(ARHOST_SEVERITY_INFO), HasSubstr("is back"));
    }
}

// ---- HTTP ------------------------------------------------------------------------------------------

TEST_F(Http, DeliversMotionJpeg) {
    start({{"url", url("private/mjpeg?token=s3cr", user_and_password)}});
    EXPECT_EQ(source_.format().pixel_format, ARHOST_PIXEL_FORMAT_I420);
    EXPECT_EQ(source_.format().yuv_range, ARHOST_YUV_RANGE_FULL);
    expect_pictures(source_, 60);
    EXPECT_EQ(source_.log(ARHOST_SEVERITY_WARNING), "");
    EXPECT_THAT(source_.log(), AllOf(Not(HasSubstr("s3cr")), Not(HasSubstr("camera:"))));
}

TEST_F(Http, LiveModeDropsPicturesThatAreNotReadInTime) {
    start({{"url", url("mjpeg")}});
    SourceFrame last = source_.read(0);
    bool has_skipped = false;
    for (int n = 1; n < 100 && !has_skipped; ++n) {
        std::this_thread::sleep_for(std::chrono::milliseconds(200));
        const SourceFrame frame = source_.read_frame(static_cast<std::uint64_t>(n));
        EXPECT_EQ(number_of(frame, source_),
                  (number_of(last, source_) + 1 + static_cast<int>(frame.info.skipped)) % 16);
        has_skipped = frame.info.skipped > 0;
        last = frame;
    }
    EXPECT_TRUE(has_skipped);
}

TEST_F(Http, TruncatedPicturesAreSkippedAndCounted) {
    start({{"url", url("truncated")}}, {});
    source_.read(0);
    for (std::uint64_t n = 1; n < 20; ++n) {
        const SourceFrame frame = source_.read_frame(n);
        EXPECT_EQ(number_of(frame, source_) % 2, 0) << "delivers a truncated picture";
        EXPECT_EQ(frame.info.skipped % 2, 1u) << "counts each truncated picture";
    }
    EXPECT_GE(source_.plugin().counters().at("damaged"), 19u);
    source_.stop();
    EXPECT_THAT(error_of({{"url", url("broken")}, {"timeout_ms", "1000"}}),
                AllOf(HasSubstr("no intact picture has arrived for 1000 ms (timeout_ms)"), HasSubstr("damaged")));
}

TEST_F(Http, PicturesWithWrongLengthsAreFoundByTheirBoundaries) {
    for (const char *path : {"short_lengths", "long_lengths"}) {
        start({{"url", url(path)}}, {});
        source_.read(0);
        for (std::uint64_t n = 1; n < 20; ++n)
            EXPECT_NE(number_of(source_.read_frame(n), source_), -1) << path << ", frame " << n;
        EXPECT_LE(source_.plugin().counters().at("damaged"), 1u) << path;
        EXPECT_EQ(warnings(), "") << path << ": the connection must not be lost";
        source_.stop();
    }
}

TEST_F(Http, ErrorsNameTheCause) {
    EXPECT_THAT(error_of({{"url", url("none", user_and_password)}}), HasSubstr("404 Not Found"));
    EXPECT_THAT(error_of({{"url", url("private/mjpeg", "camera:wrong")}}), HasSubstr("401 Unauthorized"));
    EXPECT_THAT(error_of({{"url", url("garbage")}}), HasSubstr("no video that arhost plays"));
    EXPECT_THAT(error_of({{"url", url("silent")}, {"timeout_ms", "500"}}),
                HasSubstr("the server has not answered within 500 ms (timeout_ms)"));
    EXPECT_THAT(error_of({{"url", "rtsp://host/"}, {"timeout_ms", "100"}}), HasSubstr("cannot be received"));
    server_->kill();
    EXPECT_THAT(error_of({{"url", url("mjpeg")}}), HasSubstr("Connection refused"));
    EXPECT_THAT(error_of({{"url", "ftp://camera:s3cr@host/"}}), HasSubstr("must begin with rtsp://"));
}

TEST_F(Http, AStartCanBeCancelled) {
    source_.plugin().cancel(5);
    EXPECT_EQ(source_.start({{"url", url("silent")}, {"timeout_ms", "600000"}}, live()),
              ARHOST_STATUS_ERROR_CANCELLED);
}

TEST_F(Http, AReadCanBeCancelledAndALostCameraIsReportedOnce) {
    start({{"url", url("mjpeg")}});
    server_->kill();
    source_.plugin().cancel(100); // 2 s of waiting
    const std::vector<SourceFrame> frames = source_.read_all();
    EXPECT_EQ(frames.back().status, ARHOST_STATUS_ERROR_CANCELLED);
    EXPECT_EQ(warning_count(), 1) << warnings();
}

TEST_F(Http, ACameraThatStopsSendingIsConnectedAgain) {
    start({{"url", url("stalls")}, {"timeout_ms", "1000"}}, {});
    for (int n = 0; n < 24; ++n) // ten in each connection
        ASSERT_EQ(number_of(source_.read(0), source_), n % 10) << source_.log();
    EXPECT_THAT(source_.log(ARHOST_SEVERITY_WARNING), HasSubstr("no intact picture has arrived for 1000 ms"));
}

TEST_F(Http, AChangeOfTheFrameSizeIsAnError) {
    start({{"url", url("grows")}}, {});
    EXPECT_EQ(source_.read_all().back().status, ARHOST_STATUS_ERROR_DEVICE_LOST);
    EXPECT_THAT(source_.log(ARHOST_SEVERITY_ERROR), HasSubstr("has changed from 160×120 to 320×240 px"));
}

TEST_F(Http, TheSizeOfTheCalibrationMustMatch) {
    const arhost_intrinsics camera = intrinsics_of_size(640, 480);
    arhost_source_setup setup = live();
    setup.intrinsics = &camera;
    EXPECT_EQ(source_.start({{"url", url("mjpeg")}}, setup), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(source_.log(), HasSubstr("160×120 px, but the camera calibration is for 640×480"));
}

TEST_F(Https, CertificatesAreVerifiedUnlessTheConfigurationSaysOtherwise) {
    ARHOST_REQUIRE_FFMPEG();
    serve("https");
    for (const char *path : {"mjpeg", "vod.m3u8"}) {
        EXPECT_THAT(error_of({{"url", url(path)}}), HasSubstr("certificate")) << path;
        start({{"url", url(path)}, {"tls_verify", "false"}}, {});
        expect_pictures(source_, 10);
    }
}

// ---- HLS -------------------------------------------------------------------------------------------

TEST_F(Hls, PlaysARecordingToItsEndInRealTime) {
    start({{"url", url("vod.m3u8")}}, {});
    EXPECT_NEAR(source_.format().fps, 25, 0.1);
    const std::vector<SourceFrame> frames = source_.read_all();
    EXPECT_EQ(frames.back().status, ARHOST_STATUS_END);
    std::uint64_t count = 0;
    for (std::size_t n = 0; n + 1 < frames.size(); ++n)
        count += 1 + frames[n].info.skipped;
    EXPECT_EQ(count, 50u);
    EXPECT_GE(frames[frames.size() - 2].info.capture_ns - frames[0].info.capture_ns, 1'900'000'000)
        << "the frames must not come faster than in real time";
    EXPECT_EQ(source_.read(0).status, ARHOST_STATUS_END);
}

TEST_F(Hls, FollowsALiveStream) {
    start({{"url", url("live.m3u8")}});
    expect_pictures(source_, 75);
    EXPECT_EQ(source_.log(ARHOST_SEVERITY_WARNING), "");
}

TEST_F(Hls, LosesNoPictureWhereTwoFilmsAreJoined) {
    const auto pictures = [&](const char *path) {
        start({{"url", url(path)}}, {});
        std::vector<SourceFrame> frames = source_.read_all();
        EXPECT_EQ(frames.back().status, ARHOST_STATUS_END);
        frames.pop_back();
        return frames;
    };
    const std::size_t one = pictures("hls0.ts").size();
    const std::vector<SourceFrame> both = pictures("joined.ts");
    EXPECT_EQ(both.size(), 2 * one);
    for (const SourceFrame &frame : both)
        EXPECT_EQ(frame.info.skipped, 0u);
}

// The sandbox would block the file as well; this test runs without it.
TEST_F(Hls, NeverOpensFilesThatAServerNames) {
    for (const char *path : {"passwd.m3u8", "files.m3u8"})
        EXPECT_THAT(error_of({{"url", url(path)}, {"timeout_ms", "1500"}}), HasSubstr("cannot be received")) << path;
    EXPECT_THAT(error_of({{"url", url("redirect")}}), HasSubstr("cannot be received"));
    EXPECT_THAT(error_of({{"url", url("list")}}), HasSubstr("no video that arhost plays"));
    start({{"url", url("hls0.ts")}}, {}); // the same segments play over HTTP
}
