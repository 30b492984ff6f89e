// SPDX-License-Identifier: Apache-2.0
#include "failure_of.hpp"
#include "jpeg_splitter.hpp"
#include "sender_clock.hpp"
#include "stream_url.hpp"

#include <gmock/gmock.h>

#include <random>
#include <vector>

namespace {

using arhost::check_url;
using arhost::JpegSplitter;
using arhost::SenderClock;
using arhost::without_credentials;

constexpr std::int64_t ms = 1'000'000, second = 1000 * ms, frame = 40 * ms;

// Returns "" if the URL is accepted.
std::string rejection_of(const std::string &url) {
    const auto [status, message] = arhost::test::failure_of([&] { check_url(url); });
    EXPECT_THAT(status, testing::AnyOf(ARHOST_STATUS_OK, ARHOST_STATUS_ERROR_CONFIGURATION));
    return status == ARHOST_STATUS_OK ? "" : message;
}

} // namespace

TEST(SenderClock, RemovesTheJitterOfTheNetwork) {
    SenderClock clock;
    std::mt19937 random(1);
    std::int64_t worst_ns = 0;
    for (std::int64_t n = 0; n < 500; ++n) {
        const std::int64_t sent_ns = n * frame, delay_ns = 10 * ms + std::int64_t(random() % (20 * ms));
        const std::int64_t captured_ns = clock.capture_ns(7 * second + sent_ns, sent_ns + delay_ns);
        if (n >= 100)
            worst_ns = std::max(worst_ns, std::abs(captured_ns - sent_ns - 10 * ms));
    }
    EXPECT_LT(worst_ns, 2 * ms) << "the delays vary by 20 ms";
}

TEST(SenderClock, FollowsClocksThatAreFastOrSlow) {
    for (const double drift : {-200e-6, 200e-6}) {
        SenderClock clock;
        for (std::int64_t n = 0; n < 25 * 3600; ++n) {
            const std::int64_t arrival_ns = n * frame + 10 * ms;
            const auto stamp_ns = static_cast<std::int64_t>(static_cast<double>(n * frame) * (1 + drift));
            ASSERT_NEAR(static_cast<double>(clock.capture_ns(stamp_ns, arrival_ns) - arrival_ns), 0, 1e5)
                << "frame " << n << ", drift " << drift;
        }
    }
}

TEST(SenderClock, NeverDecreasesNorIsInTheFutureWhateverTheSenderSends) {
    SenderClock clock;
    std::mt19937_64 random(2);
    std::int64_t last_ns = 0, arrival_ns = second;
    for (int n = 0; n < 10'000; ++n) {
        arrival_ns += static_cast<std::int64_t>(random() % (2 * frame));
        std::optional<std::int64_t> stamp_ns;
        if (random() % 10 > 0)
            stamp_ns = static_cast<std::int64_t>(random() % (100 * second)) - 50 * second;
        if (random() % 100 == 0)
            clock.restart();
        const std::int64_t captured_ns = clock.capture_ns(stamp_ns, arrival_ns);
        ASSERT_LE(captured_ns, arrival_ns) << n;
        ASSERT_GE(captured_ns, last_ns) << n;
        last_ns = captured_ns;
    }
}

TEST(SenderClock, RecoversFromTimeStampsThatJumpBack) {
    SenderClock clock;
    clock.capture_ns(100 * second, second);
    EXPECT_EQ(clock.capture_ns(0, second + frame), second + frame);
    EXPECT_EQ(clock.capture_ns(frame, second + 2 * frame + 5 * ms), second + 2 * frame + frame / 2000 + 2500);
}

TEST(SenderClock, UsesTheArrivalIfThereAreNoTimeStamps) {
    SenderClock clock;
    EXPECT_EQ(clock.capture_ns(std::nullopt, 5), 5);
    EXPECT_EQ(clock.capture_ns(std::nullopt, 9), 9);
}

TEST(JpegSplitter, FindsPicturesHoweverTheirBytesArrive) {
    const std::string first = "\xff\xd8\xff" + std::string(300, 'a') + "\xff\xd9\r\n-no boundary\xff\xff\xd9",
                      second = "\xff\xd8\xff\xd9";
    const std::string stream = "--frame\r\nContent-Length: 7\r\n\r\n\xff" + first + "\r\n--frame\r\n\r\n" + second +
                               "\n--frame\r\n\r\n\xff\xd8";
    for (const std::size_t size : {std::size_t(1), std::size_t(2), std::size_t(7), stream.size()}) {
        JpegSplitter splitter;
        std::vector<std::string> found;
        for (std::size_t begin = 0; begin < stream.size(); begin += size) {
            splitter.append(std::string_view(stream).substr(begin, size));
            while (const auto picture = splitter.next())
                found.push_back(*picture);
        }
        EXPECT_EQ(found, (std::vector{first, second})) << size << " bytes at a time";
        EXPECT_EQ(splitter.size(), 2u) << size << " bytes at a time";
    }
}

TEST(Url, IsAcceptedWithCredentialsPortAndQuery) {
    for (const char *url : {"rtsp://camera/", "rtsp://u:p%40@10.0.0.7:8554/live?channel=1", "https://host",
                            "http://[::1]:80/a.m3u8#x", "http://u:p@[::1]/?a=b:0"})
        EXPECT_EQ(rejection_of(url), "") << url;
}

TEST(Url, IsRejectedWithoutBeingShown) {
    using testing::HasSubstr;
    for (const char *url : {"", "file:///etc/passwd", "rtsps://u:secret@host", "concat:http://u:secret@host/",
                            "RTSP://u:secret@host", " http://u:secret@host"})
        EXPECT_EQ(rejection_of(url), "url: must begin with rtsp://, http:// or https:// (in lower case)") << url;
    for (const char *url : {"http://u:secret@host/a b", "http://u:secret@host/\r\nX: y", "http://u:sec'ret@host/",
                            "http://u:secret@host/ä"})
        EXPECT_THAT(rejection_of(url), testing::AllOf(HasSubstr("write it as %20"), Not(HasSubstr("secret")))) << url;
    for (const char *url : {"rtsp://host:0", "http://u:secret@host:65536/", "http://host:/", "http://[::1]:x/",
                            "rtsp://u:secret/q@host:554"})
        EXPECT_EQ(rejection_of(url),
                  "url: the port must be a number from 1 to 65535; write a slash in a password as %2F")
            << url;
    EXPECT_EQ(rejection_of("http:///path"), "url: names no host");
    EXPECT_EQ(rejection_of("http://"), "url: names no host");
    EXPECT_EQ(rejection_of("http://h/" + std::string(3000, 'x')), "url: is longer than 2000 characters");
}

TEST(Url, IsShownWithoutCredentials) {
    EXPECT_EQ(without_credentials("rtsp://u:p@host:1/a?user=u&pwd=p#x"), "rtsp://host:1/a?…");
    EXPECT_EQ(without_credentials("Opening 'http://u:p@a/b.ts' and \"https://u@c/?t=1\" for reading"),
              "Opening 'http://a/b.ts' and \"https://c/?…\" for reading");
    EXPECT_EQ(without_credentials("rtsp://u:p/q@host/"), "rtsp://host/") << "an unescaped slash in the password";
    EXPECT_EQ(without_credentials("rtsp://u:p?q@host/a"), "rtsp://host/a") << "an unescaped ? in the password";
    EXPECT_EQ(without_credentials("rtsp://u:p@q@host/a"), "rtsp://host/a");
    EXPECT_EQ(without_credentials("no URL, a@b"), "no URL, a@b");
    EXPECT_EQ(without_credentials("http://"), "http://");
}
