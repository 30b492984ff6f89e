// SPDX-License-Identifier: Apache-2.0
#include <fiducial_common/tracker_support.hpp>

#include <gmock/gmock.h>
#include <opencv2/imgproc.hpp>

#include <fstream>
#include <numbers>

namespace {

using namespace arhost::test;
using testing::HasSubstr;
using testing::IsEmpty;

const arhost_intrinsics camera = plain_camera({640, 480});
using Quad = std::array<cv::Point2d, 4>;

// A poster of 480 × 640: many patches of different brightness and size, the same for the same seed.
cv::Mat poster(std::uint64_t seed) {
    cv::RNG random(seed);
    cv::Mat picture(640, 480, CV_8UC1, cv::Scalar(170));
    for (int i = 0; i < 400; ++i) {
        const cv::Point at(random.uniform(0, picture.cols), random.uniform(0, picture.rows));
        const cv::Size size(random.uniform(4, 50), random.uniform(4, 50));
        if (i % 2)
            cv::rectangle(picture, {at, size}, cv::Scalar(random.uniform(0, 256)), cv::FILLED);
        else
            cv::ellipse(picture, at, size / 2, random.uniform(0, 180), 0, 360, cv::Scalar(random.uniform(0, 256)),
                        cv::FILLED, cv::LINE_AA);
    }
    return picture;
}

Quad moved(const Quad &quad, double x, double y) {
    Quad result = quad;
    for (cv::Point2d &corner : result)
        corner += cv::Point2d(x, y);
    return result;
}

// A poster in motion: it turns, tilts and comes nearer. `t` in frames.
Quad place(double t) {
    const auto wave = [&](double frames) { return std::sin(2 * std::numbers::pi * t / frames); };
    const double height = 240 + 40 * wave(170), width = height * 0.75, turn = 0.5 * wave(130);
    Quad quad;
    const double x[] = {-1, 1, 1, -1}, y[] = {-1, -1, 1, 1};
    for (std::size_t i = 0; i < 4; ++i) {
        const double depth = 1 + 0.2 * wave(90) * x[i] + 0.15 * wave(110) * y[i];
        const double u = x[i] * width / 2 / depth, v = y[i] * height / 2 / depth;
        quad[i] = {320 + 60 * wave(150) + u * std::cos(turn) - v * std::sin(turn),
                   240 + 40 * wave(100) + u * std::sin(turn) + v * std::cos(turn)};
    }
    return quad;
}

void draw(const cv::Mat &picture, const Quad &quad, cv::Mat &frame) {
    const float right = static_cast<float>(picture.cols) - 0.5F, bottom = static_cast<float>(picture.rows) - 0.5F;
    const std::vector<cv::Point2f> from{{-0.5F, -0.5F}, {right, -0.5F}, {right, bottom}, {-0.5F, bottom}};
    std::vector<cv::Point2f> to;
    for (const cv::Point2d &corner : quad)
        to.emplace_back(corner);
    // Drawn at twice the size and averaged.
    cv::Mat large;
    cv::resize(frame, large, {}, 2, 2, cv::INTER_NEAREST);
    for (cv::Point2f &corner : to)
        corner = 2 * corner + cv::Point2f(0.5F, 0.5F);
    cv::warpPerspective(picture, large, cv::getPerspectiveTransform(from, to), large.size(), cv::INTER_AREA,
                        cv::BORDER_TRANSPARENT);
    cv::resize(large, frame, frame.size(), 0, 0, cv::INTER_AREA);
}

cv::Mat empty_frame() {
    return {480, 640, CV_8UC1, cv::Scalar(110)};
}

void add_sensor(cv::Mat &frame, std::uint64_t seed) {
    cv::Mat noise(frame.size(), CV_16S);
    cv::RNG(seed).fill(noise, cv::RNG::NORMAL, 0, 2);
    cv::GaussianBlur(frame, frame, {}, 0.6);
    cv::add(frame, noise, frame, cv::noArray(), CV_8U);
}

arhost_expected_marker expected_at(std::uint32_t marker, const Quad &corners) {
    arhost_expected_marker expected{sizeof expected, marker, {}, 8};
    for (std::size_t i = 0; i < 4; ++i) {
        expected.corners_px[i][0] = corners[i].x;
        expected.corners_px[i][1] = corners[i].y;
    }
    return expected;
}

double mean_error_px(const arhost_observation &seen, const Quad &truth) {
    double sum = 0;
    for (int i = 0; i < 4; ++i)
        sum += corner_distance_px(seen, i, truth[static_cast<std::size_t>(i)]) / 4;
    return sum;
}

class ImageTracker : public testing::Test {
protected:
    ImageTracker() : tracker_("tracker_image") { EXPECT_EQ(tracker_.created(), ARHOST_STATUS_OK) << tracker_.log(); }
    std::string write(const std::string &name, const cv::Mat &picture) const {
        const std::string path = (folder_.path() / name).string();
        cv::imwrite(path, picture);
        return path;
    }
    Listed listed(int id, const cv::Mat &picture) const {
        return {id, 210, "image", write(std::to_string(id) + ".png", picture)};
    }
    ScratchFolder folder_;
    Tracker tracker_;
};

TEST_F(ImageTracker, FindsSeveralPicturesAnywhere) {
    const cv::Mat one = poster(1), other = poster(2);
    ASSERT_EQ(tracker_.start(camera, {listed(0, one), listed(1, other)}), ARHOST_STATUS_OK) << tracker_.log();
    cv::Mat frame = empty_frame();
    const Quad left = moved({cv::Point2d(0, 10), {150, 0}, {160, 210}, {5, 190}}, 60, 120),
               right = moved({cv::Point2d(150, 0), {160, 200}, {0, 190}, {10, 5}}, 380, 140);
    draw(one, left, frame);
    draw(other, right, frame);
    add_sensor(frame, 1);
    const auto seen = tracker_.track(GreyFrame(frame));
    ASSERT_EQ(seen.size(), 2u);
    EXPECT_EQ(seen[0].id, 0);
    EXPECT_EQ(seen[1].id, 1);
    EXPECT_LT(mean_error_px(seen[0], left), 0.5);
    EXPECT_LT(mean_error_px(seen[1], right), 0.5) << "turned by a quarter";
}

TEST_F(ImageTracker, FollowsAPictureThatIsHalfCovered) {
    const cv::Mat picture = poster(3);
    ASSERT_EQ(tracker_.start(camera, {listed(0, picture)}), ARHOST_STATUS_OK) << tracker_.log();
    constexpr int frames = 200;
    int found = 0;
    double error_px = 0;
    for (int t = 0; t < frames; ++t) {
        const Quad truth = place(t);
        cv::Mat frame = empty_frame();
        draw(picture, truth, frame);
        // A sheet with other texture covers one half.
        const std::vector<cv::Point> half{truth[t / 50 % 4], truth[(t / 50 + 1) % 4],
                                          (truth[(t / 50 + 1) % 4] + truth[(t / 50 + 2) % 4]) / 2,
                                          (truth[t / 50 % 4] + truth[(t / 50 + 3) % 4]) / 2};
        cv::fillConvexPoly(frame, half, cv::Scalar(60), cv::LINE_AA);
        add_sensor(frame, static_cast<std::uint64_t>(t) + 1);
        const auto seen =
            t == 0 ? tracker_.track(GreyFrame(frame))
                   : tracker_.track(GreyFrame(frame), {expected_at(0, moved(place(t - 0.5), 3, -2))}, false);
        if (seen.empty())
            continue;
        ++found;
        error_px += mean_error_px(seen[0], truth);
    }
    EXPECT_GE(found, 98 * frames / 100);
    EXPECT_LE(error_px / found, 1);
}

TEST_F(ImageTracker, FindsAPictureThatIsNotWhereItIsExpected) {
    const cv::Mat picture = poster(4);
    ASSERT_EQ(tracker_.start(camera, {listed(0, picture)}), ARHOST_STATUS_OK) << tracker_.log();
    cv::Mat frame = empty_frame();
    draw(picture, place(0), frame);
    add_sensor(frame, 1);
    const auto seen = tracker_.track(GreyFrame(frame), {expected_at(0, moved(place(0), 150, 100))}, false);
    ASSERT_EQ(seen.size(), 1u);
    EXPECT_LT(mean_error_px(seen[0], place(0)), 0.5);
}

TEST_F(ImageTracker, FindsNothingElse) {
    ASSERT_EQ(tracker_.start(camera, {listed(0, poster(5))}), ARHOST_STATUS_OK) << tracker_.log();
    cv::Mat frame = empty_frame();
    EXPECT_THAT(tracker_.track(GreyFrame(frame)), IsEmpty());
    draw(poster(6), place(0), frame);
    EXPECT_THAT(tracker_.track(GreyFrame(frame)), IsEmpty());
    EXPECT_THAT(tracker_.track(GreyFrame(frame), {expected_at(0, place(0))}, false), IsEmpty());
    for (const cv::Size size : {cv::Size(1, 1), cv::Size(3, 200)}) {
        ASSERT_EQ(tracker_.start(plain_camera(size), {listed(0, poster(5))}), ARHOST_STATUS_OK);
        EXPECT_THAT(tracker_.track(GreyFrame(cv::Mat(size, CV_8UC1, cv::Scalar(128)))), IsEmpty());
        EXPECT_THAT(
            tracker_.track(GreyFrame(cv::Mat(size, CV_8UC1, cv::Scalar(128))), {expected_at(0, place(0))}, false),
            IsEmpty());
    }
}

TEST_F(ImageTracker, RejectsPicturesWithoutTextureAndOtherFiles) {
    EXPECT_EQ(tracker_.start(camera, {listed(0, cv::Mat(200, 300, CV_8UC1, cv::Scalar(255)))}),
              ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(tracker_.log(), HasSubstr("0.png' has too little texture to be recognised"));
    const std::filesystem::path text_file = folder_.path() / "a.txt";
    std::ofstream(text_file) << "text";
    const Listed text{0, 210, "image", text_file.string()};
    EXPECT_EQ(tracker_.start(camera, {text}), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(tracker_.log(), HasSubstr("a.txt' is not an image that OpenCV can read"));
    EXPECT_EQ(tracker_.start(camera, {{0, 80, "tag36h11"}}), ARHOST_STATUS_ERROR_CONFIGURATION);
    EXPECT_THAT(tracker_.log(), HasSubstr("unknown family 'tag36h11': tracker_image finds targets with an 'image'"));
}

// OpenCV's own example: a box of tea among other things, partly covered.
TEST_F(ImageTracker, FindsOpenCvsBoxInItsScene) {
    const std::filesystem::path data = "/usr/share/doc/opencv-doc/examples/data";
    if (!std::filesystem::exists(data / "box_in_scene.png"))
        GTEST_SKIP() << "needs the photos of the Debian package opencv-doc in " << data;
    const cv::Mat scene = read_grey(data / "box_in_scene.png");
    ASSERT_EQ(tracker_.start(plain_camera(scene.size()), {{0, 210, "image", (data / "box.png").string()}}),
              ARHOST_STATUS_OK)
        << tracker_.log();
    const auto seen = tracker_.track(GreyFrame(scene));
    ASSERT_EQ(seen.size(), 1u);
    // The top right corner is hidden by another box.
    const Quad read_off{cv::Point2d(118, 161), {281, 178}, {266, 297}, {95, 260}};
    EXPECT_LT(mean_error_px(seen[0], read_off), 6);
}

} // namespace
