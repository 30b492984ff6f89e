// SPDX-License-Identifier: Apache-2.0
#include "latency/time_codes.hpp"

#include "fiducial/tracker_support.hpp"

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

using namespace arhost;
using arhost::latency::TimeCodes;
using namespace std::chrono_literals;

namespace {

const cv::Size size{640, 480};
const auto start = TimeCodes::Clock::time_point(1h);

cv::Mat drawn(TimeCodes &codes, TimeCodes::Clock::time_point now) {
    cv::Mat picture(size, CV_8UC3);
    codes.draw({picture.data, picture.step}, size.width, size.height, now);
    return picture;
}

// A camera and the tracker of time codes.
class Camera {
public:
    Camera() {
        std::vector<test::Listed> listed;
        for (int id = 0; id < TimeCodes::count; ++id)
            listed.push_back({id});
        EXPECT_EQ(tracker_.created(), ARHOST_STATUS_OK) << tracker_.log();
        EXPECT_EQ(tracker_.start(test::plain_camera(size), listed), ARHOST_STATUS_OK) << tracker_.log();
    }
    std::vector<arhost_observation> see(const cv::Mat &picture) {
        cv::Mat grey;
        cv::cvtColor(picture, grey, cv::COLOR_BGR2GRAY);
        return tracker_.track(test::GreyFrame(grey));
    }

private:
    test::Tracker tracker_{"tracker_apriltag"};
};

// As a camera at an angle sees it: perspective and rotation, blur, noise, little contrast, JPEG.
cv::Mat distorted(const cv::Mat &picture, int seed) {
    const std::vector<cv::Point2f> from = {{0, 0}, {640, 0}, {640, 480}, {0, 480}},
                                   to = {{90, 40}, {600, 90}, {560, 420}, {60, 450}};
    cv::Mat seen, noise(size, CV_16SC3), noisy;
    cv::warpPerspective(picture, seen, cv::getPerspectiveTransform(from, to), size, cv::INTER_LINEAR,
                        cv::BORDER_CONSTANT, cv::Scalar::all(120));
    cv::GaussianBlur(seen, seen, {}, 2.5);
    seen.convertTo(noisy, CV_16SC3, 0.5, 50);
    cv::RNG random(static_cast<std::uint64_t>(seed));
    random.fill(noise, cv::RNG::NORMAL, 0, 8);
    noisy += noise;
    noisy.convertTo(seen, CV_8UC3);
    std::vector<std::uint8_t> jpeg;
    cv::imencode(".jpg", seen, jpeg, {cv::IMWRITE_JPEG_QUALITY, 40});
    return cv::imdecode(jpeg, cv::IMREAD_COLOR);
}

} // namespace

TEST(TimeCodes, AreRecognisedInADistortedPicture) {
    TimeCodes codes(start);
    Camera camera;
    for (int i = 0; i < TimeCodes::count; ++i) {
        const auto now = start + i * 33ms;
        const auto age = codes.see(camera.see(distorted(drawn(codes, now), i)), now + 70ms + i * 1us);
        ASSERT_TRUE(age) << i;
        EXPECT_EQ(*age, 70ms + i * 1us) << i;
    }
}

TEST(TimeCodes, AMixtureOfTwoIsNeverMistakenForAThird) {
    Camera camera;
    TimeCodes codes(start);
    std::vector<cv::Mat> pictures;
    for (int i = 0; i < TimeCodes::count; ++i)
        pictures.push_back(drawn(codes, start));
    int recognised = 0;
    for (int i = 0; i + 1 < TimeCodes::count; i += 4)
        for (const double share : {0.2, 0.5, 0.8}) {
            cv::Mat mixed;
            cv::addWeighted(pictures[static_cast<std::size_t>(i)], share, pictures[static_cast<std::size_t>(i) + 1],
                            1 - share, 0, mixed);
            for (const arhost_observation &seen : camera.see(distorted(mixed, i)))
                if (seen.id < TimeCodes::count) {
                    EXPECT_TRUE(seen.id == i || seen.id == i + 1) << i << " became " << seen.id;
                    ++recognised;
                }
        }
    EXPECT_GT(recognised, 0) << "a weak second exposure does not matter";
}

TEST(TimeCodes, CountEachPictureOnceAndRejectSeveral) {
    TimeCodes codes(start);
    const auto marker = [](std::int32_t id) {
        arhost_observation seen{};
        seen.id = id;
        return seen;
    };
    drawn(codes, start);
    drawn(codes, start + 33ms);
    const std::vector<arhost_observation> first = {marker(0)}, both = {marker(0), marker(1)}, undrawn = {marker(7)},
                                          no_code = {marker(TimeCodes::count)};
    EXPECT_FALSE(codes.see({}, start + 50ms));
    EXPECT_FALSE(codes.see(both, start + 50ms));
    EXPECT_FALSE(codes.see(undrawn, start + 50ms)) << "a picture that was not drawn yet";
    EXPECT_FALSE(codes.see(no_code, start + 50ms));
    EXPECT_EQ(codes.see(first, start + 60ms), 60ms);
    EXPECT_FALSE(codes.see(first, start + 90ms)) << "the display holds a picture until the next one";
    for (int i = 2; i < TimeCodes::count; ++i)
        drawn(codes, start + 1s);
    drawn(codes, start + 2s); // the first picture again
    EXPECT_EQ(codes.see(first, start + 2100ms), 100ms);
}

TEST(TimeCodes, RemindIfNoneIsSeen) {
    TimeCodes codes(start);
    EXPECT_FALSE(codes.is_overdue(5s, start + 4s));
    EXPECT_TRUE(codes.is_overdue(5s, start + 5s));
    EXPECT_FALSE(codes.is_overdue(5s, start + 9s));
    EXPECT_TRUE(codes.is_overdue(5s, start + 10s));
}

TEST(TimeCodes, FitIntoAnySize) {
    TimeCodes codes(start);
    for (const auto &[width, height] : {std::pair{1u, 1u}, {3u, 100u}, {9u, 9u}, {10u, 10u}, {641u, 57u}}) {
        std::vector<std::uint8_t> picture(std::size_t{3} * width * height + 1, 7);
        codes.draw({picture.data(), std::size_t{3} * width}, width, height, start);
        EXPECT_EQ(picture.back(), 7) << width << " x " << height;
        EXPECT_TRUE(std::all_of(picture.begin(), picture.end() - 1, [](int c) { return c == 0 || c == 255; }));
    }
}
