// SPDX-License-Identifier: Apache-2.0
#include <fiducial/corner_refinement.hpp>

#include "prints.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <random>

namespace {

using namespace arhost::test;
using arhost::fiducial::Corners;
using arhost::fiducial::refine_edges;

const arhost_intrinsics camera = intrinsics_of({320, 240}, 300, 300, 159.5, 119.5);
const arhost::fiducial::Lens lens(camera);
constexpr int cells = 8; // of a tag36h11

// Mean distance of a tag's corners from their projections before and after refinement, and mean offset afterwards.
struct Errors {
    double before_px = 0, after_px = 0;
    cv::Point2d bias_px;
};

Errors errors(bool inverted) {
    Errors sum;
    int count = 0;
    std::mt19937 generator(3);
    std::uniform_real_distribution<double> tilt(-40, 40), turn(-180, 180), offset(-1.2, 1.2);
    for (int i = 0; i < 8; ++i) {
        const Mt mt =
            pose_of(tilt(generator), tilt(generator), 400, tilt(generator), tilt(generator), turn(generator));
        cv::Mat picture = render(camera, {{april_tag("tag36h11", i).with_margin(2), 100, mt}});
        if (inverted)
            picture = 255 - picture;
        add_noise(picture, 2, i + 1);
        const auto truth = corners_of(mt, camera, 100);
        Corners rough = truth;
        for (auto &corner : rough)
            corner += cv::Point2d(offset(generator), offset(generator));
        const Corners fine = refine_edges(picture, ARHOST_TRANSFER_LINEAR, rough, lens, cells).value().corners_px;
        for (int k = 0; k < 4; ++k, ++count) {
            sum.before_px += cv::norm(rough[k] - truth[k]);
            sum.after_px += cv::norm(fine[k] - truth[k]);
            sum.bias_px += fine[k] - truth[k];
        }
    }
    return {sum.before_px / count, sum.after_px / count, sum.bias_px / count};
}

TEST(EdgeRefinement, MovesRoughCornersToTheProjectedOnes) {
    for (const bool inverted : {false, true}) {
        const Errors e = errors(inverted);
        EXPECT_GT(e.before_px, 0.7);
        EXPECT_LT(e.after_px, 0.05);
        // Fails if the refinement does not put pixel centres at integers: the bias would then be half a pixel.
        EXPECT_LT(cv::norm(e.bias_px), 0.02);
    }
}

// OpenCV's corners are wrong by so much.
TEST(EdgeRefinement, DoesNotDependOnTheRoughCorners) {
    constexpr double rough_px = 0.6;
    double squares = 0;
    constexpr int count = 30;
    std::mt19937 generator(3);
    std::uniform_real_distribution<double> turn(-180, 180), tilt(-35, 35);
    std::normal_distribution<double> wrong(0, rough_px);
    for (int i = 0; i < count; ++i) {
        const Mt mt = pose_of(0, 0, 500, tilt(generator), tilt(generator), turn(generator));
        cv::Mat picture = render(camera, {{april_tag("tag36h11", i).with_margin(1), 100, mt}});
        cv::GaussianBlur(picture, picture, {}, 0.6);
        add_noise(picture, 1.5, i + 1);
        const Corners truth = corners_of(mt, camera, 100);
        Corners rough = truth;
        for (cv::Point2d &corner : rough)
            corner += cv::Point2d(wrong(generator), wrong(generator));
        const auto from_truth = refine_edges(picture, ARHOST_TRANSFER_LINEAR, truth, lens, cells),
                   from_rough = refine_edges(picture, ARHOST_TRANSFER_LINEAR, rough, lens, cells);
        ASSERT_TRUE(from_truth && from_rough) << i;
        for (int k = 0; k < 4; ++k) {
            const cv::Point2d difference = from_rough->corners_px[k] - from_truth->corners_px[k];
            squares += difference.dot(difference) / 8 / count;
        }
    }
    EXPECT_LT(std::sqrt(squares), 0.004);
}

// Mean distance by which a camera that encodes light as sRGB moves the edges of a tag into its black, if the edges
// are searched in codes or in linear light.
double inward_bias_px(arhost_transfer transfer) {
    double sum = 0;
    constexpr int count = 20;
    std::mt19937 generator(7);
    std::uniform_real_distribution<double> tilt(-30, 30), turn(-180, 180);
    for (int i = 0; i < count; ++i) {
        const Mt mt = pose_of(0, 0, 400, tilt(generator), tilt(generator), turn(generator));
        cv::Mat light, encoded;
        render(camera, {{april_tag("tag36h11", i).with_margin(2), 100, mt}})
            .convertTo(light, CV_32F, 0.85 / 255, 0.02);
        cv::GaussianBlur(light, light, {}, 0.7);
        cv::pow(light, 1 / 2.4, encoded); // sRGB above 0.003
        encoded = 255 * (1.055 * encoded - 0.055);
        cv::Mat picture;
        encoded.convertTo(picture, CV_8U);
        add_noise(picture, 1.5, i + 1);
        const auto truth = corners_of(mt, camera, 100);
        const Corners fine = refine_edges(picture, transfer, truth, lens, cells).value().corners_px;
        const cv::Point2d centre = (truth[0] + truth[1] + truth[2] + truth[3]) / 4;
        for (int k = 0; k < 4; ++k) {
            const cv::Point2d inward = (centre - truth[k]) / cv::norm(centre - truth[k]);
            sum += (fine[k] - truth[k]).dot(inward) / std::numbers::sqrt2; // of both edges at the corner
        }
    }
    return sum / (4 * count);
}

TEST(EdgeRefinement, FindsEdgesInLinearLight) {
    EXPECT_NEAR(inward_bias_px(ARHOST_TRANSFER_SRGB), 0, 0.02);
    EXPECT_GT(inward_bias_px(ARHOST_TRANSFER_LINEAR), 0.1) << "the codes do not have the middle of the edge";
}

// Returns a dark square that is blurred by a lens and averaged over pixels, without the errors of a renderer.
cv::Mat blurred_square(cv::Point2d centre_px, double side_px, double turn_rad, double blur_px) {
    constexpr int samples = 4;                    // per pixel along each axis
    const auto inside = [&](double distance_px) { // of two opposite edges
        const auto step = [&](double at_px) { return 0.5 * std::erfc(-at_px / blur_px / std::numbers::sqrt2); };
        return step(distance_px + side_px / 2) - step(distance_px - side_px / 2);
    };
    cv::Mat picture(240, 320, CV_8U);
    for (int y = 0; y < picture.rows; ++y)
        for (int x = 0; x < picture.cols; ++x) {
            double covered = 0;
            for (int i = 0; i < samples * samples; ++i) {
                const cv::Point2d at =
                    cv::Point2d(x + (i % samples + 0.5) / samples - 0.5, y + (i / samples + 0.5) / samples - 0.5) -
                    centre_px;
                covered += inside(at.x * std::cos(turn_rad) + at.y * std::sin(turn_rad)) *
                           inside(at.y * std::cos(turn_rad) - at.x * std::sin(turn_rad));
            }
            picture.at<std::uint8_t>(y, x) = cv::saturate_cast<std::uint8_t>(220 - 200 * covered / samples / samples);
        }
    return picture;
}

// Positions within pixels repeat along such edges, so errors that depend on them do not cancel out.
TEST(EdgeRefinement, LocatesEdgesOfSimpleSlopes) {
    constexpr double side_px = 80;
    for (const double turn_degrees : {0.0, 30.0, 45.0, 60.0})
        for (const cv::Point2d centre_px :
             {cv::Point2d(160, 120), cv::Point2d(160.3, 119.9), cv::Point2d(159.6, 120.4)}) {
            const double turn_rad = turn_degrees * std::numbers::pi / 180;
            Corners truth;
            for (int k = 0; k < 4; ++k)
                truth[k] = centre_px + side_px / std::numbers::sqrt2 *
                                           cv::Point2d(std::cos(turn_rad + (2 * k - 3) * std::numbers::pi / 4),
                                                       std::sin(turn_rad + (2 * k - 3) * std::numbers::pi / 4));
            const auto fine = refine_edges(blurred_square(centre_px, side_px, turn_rad, 0.4), ARHOST_TRANSFER_LINEAR,
                                           truth, lens, cells);
            SCOPED_TRACE(testing::Message() << turn_degrees << " " << centre_px);
            expect_near(fine, truth, 0.008);
        }
}

TEST(EdgeRefinement, ToleratesUnevenLight) {
    const Mt mt = pose_of(5, -3, 400, 20, 15, 25);
    const cv::Mat even = render_blurred(camera, {{april_tag("tag36h11", 4).with_margin(2), 100, mt}}, 0.6);
    const Corners truth = corners_of(mt, camera, 100);
    for (const double slope : {0.1, 0.3}) { // relative change per 100 px
        cv::Mat picture;
        even.convertTo(picture, CV_32F, 0.7);
        for (int x = 0; x < picture.cols; ++x)
            picture.col(x) *= 1 + slope * (x - 160) / 100;
        picture.convertTo(picture, CV_16S);
        add_noise(picture, 1, 1);
        const auto fine = refine_edges(picture, ARHOST_TRANSFER_LINEAR, truth, lens, cells);
        SCOPED_TRACE(slope);
        expect_near(fine, truth, 0.03);
    }
}

TEST(EdgeRefinement, TellsTheNoiseOfTheCorners) {
    std::mt19937 generator(5);
    std::uniform_real_distribution<double> tilt(-30, 30), turn(-180, 180);
    struct Case {
        double distance_mm, blur_px, noise, k1 = 0, x_mm = 0;
    };
    for (const auto &[distance_mm, blur_px, noise, k1, x_mm] :
         {Case{400, 0.7, 2}, Case{400, 0.7, 12}, Case{400, 2, 6}, Case{1000, 0.7, 6}, Case{300, 0.7, 6, -0.3, 130}}) {
        const arhost_intrinsics curved =
            k1 == 0 ? camera
                    : intrinsics_of({320, 240}, 200, 200, 159.5, 119.5, ARHOST_DISTORTION_BROWN, {k1, 0, 0, 0});
        const arhost::fiducial::Lens curved_lens(curved);
        double squares = 0, told = 0;
        constexpr int count = 30;
        for (int i = 0; i < count; ++i) {
            const Mt mt = pose_of(x_mm, 0, distance_mm, tilt(generator), tilt(generator), turn(generator));
            cv::Mat picture = render_blurred(curved, {{april_tag("tag36h11", i).with_margin(2), 100, mt}}, blur_px);
            add_noise(picture, noise, i + 1);
            const auto truth = corners_of(mt, curved, 100);
            const auto fine = refine_edges(picture, ARHOST_TRANSFER_LINEAR, truth, curved_lens, cells);
            ASSERT_TRUE(fine) << i;
            for (int k = 0; k < 4; ++k) {
                const cv::Point2d error = fine->corners_px[k] - truth[k];
                squares += error.dot(error) / 8;
            }
            told += fine->sigma_px * fine->sigma_px;
        }
        EXPECT_NEAR(std::sqrt(told / squares), 1, 0.25) << distance_mm << " " << blur_px << " " << noise << " " << k1;
    }
}

TEST(EdgeRefinement, FindsAHiddenCorner) {
    const Mt mt = pose_of(5, -3, 300, 20, 15, 25);
    const auto truth = corners_of(mt, camera, 100);
    for (const int grey : {20, 128, 230}) {
        cv::Mat picture = render(camera, {{april_tag("tag36h11", 4).with_margin(2), 100, mt}});
        cv::circle(picture, truth[2], 12, cv::Scalar(grey), cv::FILLED);
        Corners rough = truth;
        rough[2] += (truth[0] - truth[2]) / cv::norm(truth[0] - truth[2]) * 6;
        const auto fine = refine_edges(picture, ARHOST_TRANSFER_LINEAR, rough, lens, cells);
        SCOPED_TRACE(grey);
        expect_near(fine, truth, 0.05);
    }
}

TEST(EdgeRefinement, ReturnsNothingWithoutEdges) {
    const Corners corners{{{100, 80}, {160, 80}, {160, 140}, {100, 140}}};
    for (const cv::Size size :
         {cv::Size(320, 240), cv::Size(130, 120), cv::Size(1, 1)}) // inside, partly and entirely outside
        EXPECT_FALSE(refine_edges(cv::Mat(size, CV_8U, cv::Scalar(90)), ARHOST_TRANSFER_SRGB, corners, lens, cells));
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const cv::Mat plain(240, 320, CV_8U, cv::Scalar(90));
    EXPECT_FALSE(
        refine_edges(plain, ARHOST_TRANSFER_LINEAR, {{{100, 80}, {100, 80}, {100, 80}, {100, 80}}}, lens, cells));
    EXPECT_FALSE(
        refine_edges(plain, ARHOST_TRANSFER_LINEAR, {{{nan, 80}, {160, 80}, {160, 140}, {100, 140}}}, lens, cells));
}

TEST(EdgeRefinement, NeverMovesACornerFar) {
    cv::Mat noise(240, 320, CV_8U, cv::Scalar(128));
    add_noise(noise, 60, 5);
    std::mt19937 generator(11);
    std::uniform_real_distribution<double> at(-10, 250);
    for (int i = 0; i < 200; ++i) {
        Corners corners;
        for (auto &corner : corners)
            corner = {at(generator), at(generator)};
        if (const auto refined = refine_edges(noise, ARHOST_TRANSFER_LINEAR, corners, lens, cells)) {
            for (int k = 0; k < 4; ++k)
                EXPECT_LT(cv::norm(refined->corners_px[k] - corners[k]),
                          cv::norm(corners[(k + 1) % 4] - corners[k]) / 4);
        }
    }
}

} // namespace
