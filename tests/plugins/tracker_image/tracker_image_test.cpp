// SPDX-License-Identifier: Apache-2.0
#include "poster_video.hpp"

#include <gmock/gmock.h>

#include <fstream>

namespace {

using namespace arhost::test;
using testing::HasSubstr;
using testing::IsEmpty;

const arhost_intrinsics camera = plain_camera({640, 480});

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
        cover_half(frame, truth, t);
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
    EXPECT_THAT(
        tracker_.log(),
        HasSubstr("0.png' has too little texture to be recognised: it has 0 corners and 0 features; 24 and 24 "
                  "are needed; use a picture with more details"));
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
