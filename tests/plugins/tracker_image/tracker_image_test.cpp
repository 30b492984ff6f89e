// SPDX-License-Identifier: Apache-2.0
#include "poster_video.hpp"

#include <gmock/gmock.h>
#include <opencv2/calib3d.hpp>

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

// The frame and the true corners come from OpenCV's lens models. The poster faces the camera.
TEST_F(ImageTracker, KnowsTheDistortionOfTheLens) {
    const cv::Size size(640, 480);
    struct Case {
        arhost_distortion distortion;
        std::vector<double> coefficients;
        double focal_px, off_axis_rad;
    };
    for (const auto &[distortion, coefficients, focal_px, off_axis_rad] :
         {Case{ARHOST_DISTORTION_BROWN, {-0.28, 0.09, 1e-3, -5e-4}, 400, 0.1},
          {ARHOST_DISTORTION_BROWN, {-0.28, 0.09, 1e-3, -5e-4}, 400, 0.45},
          {ARHOST_DISTORTION_FISHEYE, {-0.02, 0.005, 0, 0}, 300, 0.1},
          {ARHOST_DISTORTION_FISHEYE, {-0.02, 0.005, 0, 0}, 300, 0.95}}) {
        const bool is_fisheye = distortion == ARHOST_DISTORTION_FISHEYE;
        const cv::Matx33d matrix(focal_px, 0, 322, 0, focal_px, 236, 0, 0, 1);
        const auto lens = intrinsics_of(size, focal_px, focal_px, 322, 236, distortion, coefficients);
        const cv::Size flat_size(2000, 1500); // of an image without distortion
        const cv::Point2d flat_centre(1000, 750);

        std::vector<cv::Point2d> pixels, undistorted;
        for (int y = 0; y < size.height; ++y)
            for (int x = 0; x < size.width; ++x)
                pixels.emplace_back(x, y);
        if (is_fisheye)
            cv::fisheye::undistortPoints(pixels, undistorted, matrix, coefficients);
        else
            cv::undistortPoints(pixels, undistorted, matrix, coefficients);
        cv::Mat_<cv::Vec2f> map(size);
        for (std::size_t i = 0; i < pixels.size(); ++i) {
            const cv::Point2d flat = focal_px * undistorted[i] + flat_centre;
            map(pixels[i]) = cv::Vec2f(static_cast<float>(flat.x), static_cast<float>(flat.y));
        }

        cv::Matx33d rotation;
        cv::Rodrigues(cv::Vec3d(-0.5, 0.87, 0) * off_axis_rad, rotation);
        std::vector<cv::Point3d> rays;
        Quad flat_corners, truth;
        std::vector<cv::Point2d> projected;
        for (const auto &[x, y] : {std::pair(-1, -1), {1, -1}, {1, 1}, {-1, 1}}) {
            const cv::Vec3d ray = rotation * cv::Vec3d(0.2 * x, 0.26 * y, 1);
            flat_corners[rays.size()] = focal_px * cv::Point2d(ray[0] / ray[2], ray[1] / ray[2]) + flat_centre;
            rays.emplace_back(ray);
        }
        if (is_fisheye)
            cv::fisheye::projectPoints(rays, projected, cv::Vec3d(), cv::Vec3d(), matrix, coefficients);
        else
            cv::projectPoints(rays, cv::Vec3d(), cv::Vec3d(), matrix, coefficients, projected);
        std::ranges::copy(projected, truth.begin());

        cv::Mat flat(flat_size, CV_8UC1, cv::Scalar(110)), frame;
        draw(poster(7), flat_corners, flat);
        cv::remap(flat, frame, map, cv::noArray(), cv::INTER_LINEAR);
        add_sensor(frame, 1);
        ASSERT_EQ(tracker_.start(lens, {listed(0, poster(7))}), ARHOST_STATUS_OK) << tracker_.log();
        for (const bool everywhere : {true, false}) {
            const auto seen = tracker_.track(GreyFrame(frame), {expected_at(0, moved(truth, 3, -2))}, everywhere);
            ASSERT_EQ(seen.size(), 1u) << distortion << ' ' << off_axis_rad << ' ' << everywhere;
            EXPECT_LT(mean_error_px(seen[0], truth), 0.3) << distortion << ' ' << off_axis_rad << ' ' << everywhere;
            EXPECT_GT(seen[0].decision_margin, 80) << "most of its points are found";
        }
    }
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
