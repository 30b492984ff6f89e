// SPDX-License-Identifier: Apache-2.0
#include <fiducial/corner_refinement.hpp>

#include "prints.hpp"

#include <arhost/shading/srgb8.hpp>
#include <gtest/gtest.h>

#include <limits>
#include <random>

namespace {

using namespace arhost::test;
using arhost::fiducial::align_print;
using arhost::fiducial::Corners;
using arhost::fiducial::Lens;
using arhost::fiducial::MeasuredCorners;
using arhost::fiducial::refine_corners;
using arhost::fiducial::refine_edges;

const cv::Size size(320, 240);
const arhost_intrinsics camera = intrinsics_of(size, 300, 300, 159.5, 119.5);
const Lens lens(camera);
const Print tag = april_tag("tag36h11", 4);
const Mt mt = pose_of(5, -3, 500, 20, 15, 25);
const Corners truth = corners_of(mt, camera, 100);

arhost::fiducial::Print print_of(const Print &tag) {
    arhost::fiducial::Print print{{}, (tag.cells.rows - tag.corner_cells) / 2};
    tag.cells.convertTo(print.cells, CV_32F, 1 / 255.0);
    return print;
}

constexpr int fine = 4; // times the resolution, because the renderer has only 32 rays per pixel

cv::Mat reduced(const cv::Mat &fine_picture) {
    cv::Mat picture;
    cv::resize(fine_picture, picture, size, 0, 0, cv::INTER_AREA);
    return picture;
}

cv::Mat blurred(double blur_px, const Mt &pose = mt, const Print &print = tag) {
    cv::Mat picture = reduced(render(enlarged(camera, fine), {{print.with_margin(1), 100, pose}}));
    if (blur_px > 0)
        cv::GaussianBlur(picture, picture, {}, blur_px);
    return picture;
}

auto aligned(const cv::Mat &picture, const Corners &corners_px, const Print &print = tag) {
    return align_print(picture, ARHOST_TRANSFER_LINEAR, corners_px, lens, print_of(print));
}

auto edges_of(const cv::Mat &picture, const Corners &rough_px, bool is_subpixel = false) {
    return refine_edges(picture, ARHOST_TRANSFER_LINEAR, rough_px, lens, 8, is_subpixel);
}

auto refined(const cv::Mat &picture, const Corners &rough_px, const Print &print = tag, bool is_subpixel = false) {
    return refine_corners(
        picture, ARHOST_TRANSFER_LINEAR, rough_px, lens, print.corner_cells, [&] { return print_of(print); },
        is_subpixel);
}

struct Case {
    double distance_mm, tilt_degrees, blur_px, noise;
    arhost_intrinsics intrinsics = camera;
    double x_mm = 0;
    bool is_inverted = false;
    arhost_transfer transfer = ARHOST_TRANSFER_LINEAR;
    double exposure = 1;
    double light_slope = 0; // relative change of the light per 100 px of the frame, to the right
};

struct Errors {
    double aligned_px = 0, edges_px = 0; // RMS of each coordinate
    double told_px = 0;                  // the standard deviation that align_print tells
    int without_edges = 0;
};

// Of tags whose rough corners are wrong by up to 0.3 px.
Errors errors(const Case &one) {
    constexpr int count = 30;
    const Lens lens(one.intrinsics);
    std::mt19937 generator(5);
    std::uniform_real_distribution<double> turn(-180, 180), shift(-20, 20), wrong(-0.3, 0.3);
    Errors sum;
    for (int i = 0; i < count; ++i) {
        const Mt mt = pose_of(one.x_mm + shift(generator), shift(generator), one.distance_mm, one.tilt_degrees, 0,
                              turn(generator));
        const Print tag = april_tag("tag36h11", i);
        cv::Mat picture = render(enlarged(one.intrinsics, fine), {{tag.with_margin(1), 100, mt}});
        if (one.is_inverted)
            picture = 255 - picture;
        picture.convertTo(picture, CV_32F);
        cv::GaussianBlur(picture, picture, {}, fine * one.blur_px); // a lens blurs before the sensor samples
        picture = reduced(picture);
        if (one.transfer == ARHOST_TRANSFER_SRGB) {
            cv::Mat light;
            picture.convertTo(light, -1, 0.85 / 255, 0.02);
            cv::pow(light, 1 / 2.4, light); // sRGB above 0.003
            light.convertTo(picture, -1, 255 * 1.055, -255 * 0.055);
        }
        picture *= one.exposure;
        for (int x = 0; x < picture.cols; ++x)
            picture.col(x) *= 1 + one.light_slope * (x - 160) / 100;
        picture.convertTo(picture, CV_16S); // noise comes before saturation
        add_noise(picture, one.noise, i + 1);
        const auto truth = corners_of(mt, one.intrinsics, 100);
        Corners rough = truth;
        for (cv::Point2d &corner : rough)
            corner += cv::Point2d(wrong(generator), wrong(generator));
        const auto squares = [&](const MeasuredCorners &found) {
            double squares = 0;
            for (int k = 0; k < 4; ++k)
                squares += (found.corners_px[k] - truth[k]).dot(found.corners_px[k] - truth[k]) / 8 / count;
            return squares;
        };
        const auto aligned = align_print(picture, one.transfer, rough, lens, print_of(tag));
        if (!aligned) {
            ADD_FAILURE() << i;
            continue;
        }
        sum.aligned_px += squares(*aligned);
        sum.told_px += aligned->sigma_px * aligned->sigma_px / count;
        const auto edges = refine_edges(picture, one.transfer, rough, lens, 8);
        sum.edges_px += edges ? squares(*edges) : 0;
        sum.without_edges += !edges;
    }
    sum.edges_px *= static_cast<double>(count) / std::max(count - sum.without_edges, 1);
    return {std::sqrt(sum.aligned_px), std::sqrt(sum.edges_px), std::sqrt(sum.told_px), sum.without_edges};
}

TEST(PrintAlignment, IsMorePreciseThanEdgesWhereCellsAreNarrow) {
    for (const Case &one : {Case{1800, 20, 0.6, 1.5}, Case{600, 75, 0.6, 1.5}, Case{600, 20, 2.5, 1.5}}) {
        const Errors e = errors(one);
        EXPECT_LT(e.aligned_px, 0.03) << one.distance_mm << " " << one.tilt_degrees << " " << one.blur_px;
        EXPECT_TRUE(e.without_edges > 15 || e.edges_px > 2 * e.aligned_px) << e.edges_px;
    }
}

TEST(PrintAlignment, TellsTheNoiseOfTheCorners) {
    const auto curved = intrinsics_of(size, 200, 200, 159.5, 119.5, ARHOST_DISTORTION_BROWN, {-0.3, 0, 0, 0});
    for (const Case &one : {Case{1400, 20, 0.7, 3}, Case{1400, 20, 0.7, 12}, Case{600, 40, 2.5, 6},
                            Case{700, 20, 0.7, 6, curved, 220}, Case{1000, 20, 0.7, 6, camera, 0, true}}) {
        const Errors e = errors(one);
        EXPECT_NEAR(e.told_px / e.aligned_px, 1, 0.2) << one.distance_mm << " " << one.blur_px << " " << one.noise;
    }
}

TEST(PrintAlignment, WorksInLinearLight) {
    EXPECT_LT(errors({1000, 20, 0.7, 1.5, camera, 0, false, ARHOST_TRANSFER_SRGB}).aligned_px, 0.03);
}

TEST(PrintAlignment, ToleratesUnevenLight) {
    for (Case one : {Case{1200, 20, 0.8, 1.5}, Case{600, 20, 2.5, 1.5}}) {
        one.light_slope = 0.4; // 20 % over a print of 50 px
        const Errors e = errors(one);
        EXPECT_LT(e.aligned_px, 0.03);
        EXPECT_NEAR(e.told_px / e.aligned_px, 1, 0.35);
    }
}

TEST(PrintAlignment, IsNotShiftedBySaturatedWhite) {
    Case bright{600, 20, 0.7, 1.5};
    bright.exposure = 2;
    const Errors e = errors(bright);
    EXPECT_LT(e.aligned_px, 0.03);
    EXPECT_GT(e.edges_px, 0.2) << "the picture does not have the difficulty";
}

TEST(PrintAlignment, ModelsTheFlanksOfEdgesBesideSaturatedWhite) {
    Case bright{600, 20, 0.8, 0};
    bright.exposure = 2.5;
    EXPECT_LT(errors(bright).aligned_px, 0.007);
}

TEST(PrintAlignment, ModelsStrongBlurInPerspective) {
    for (const Case &one : {Case{500, 45, 4, 0}, Case{600, 30, 3, 0}})
        EXPECT_LT(errors(one).aligned_px, one.tilt_degrees == 45 ? 0.03 : 0.007) << one.tilt_degrees;
}

TEST(PrintAlignment, ReturnsNothingForAnotherPrint) {
    const Mt far = pose_of(5, -3, 1000, 20, 15, 25);
    const Corners corners = corners_of(far, camera, 100);
    EXPECT_TRUE(aligned(blurred(0.7, far), corners));
    EXPECT_FALSE(aligned(blurred(0.7, far), corners, april_tag("tag36h11", 5)));
    EXPECT_FALSE(aligned(cv::Mat(size, CV_8U, cv::Scalar(90)), corners));
}

TEST(PrintAlignment, ReturnsNothingWithoutASquare) {
    cv::Mat noise(size, CV_8U, cv::Scalar(128));
    add_noise(noise, 60, 5);
    const double nan = std::numeric_limits<double>::quiet_NaN(), huge = 1e12;
    // A tag that would be found, and corners that are not its own.
    const cv::Mat picture = blurred(0, pose_of(5, -3, 600));
    const auto [a, b, c, d] = corners_of(pose_of(5, -3, 600), camera, 100);
    ASSERT_TRUE(aligned(picture, {a, b, c, d}));
    for (const Corners &corners : {Corners{a, a, a, a}, Corners{{{nan, 80}, b, c, d}}, Corners{a, b, a, b},
                                   Corners{a, c, b, d}, Corners{a, d, c, b}, Corners{b, c, d, a}, Corners{a, b, c, c},
                                   Corners{{{400, 80}, {460, 80}, {460, 140}, {400, 140}}},
                                   Corners{{{-huge, -huge}, {huge, -huge}, {huge, huge}, {-huge, huge}}},
                                   Corners{{{100, 80}, {101, 80}, {101, 81}, {100, 81}}}})
        EXPECT_FALSE(aligned(picture, corners)) << corners[1];
    EXPECT_FALSE(aligned(noise, {a, b, c, d}));
    EXPECT_FALSE(aligned(cv::Mat(1, 1, CV_8U, cv::Scalar(0)), {{{0, 0}, {1, 0}, {1, 1}, {0, 1}}}));
}

TEST(PrintAlignment, FitsAPrintThatTheFrameCuts) {
    const Mt far = pose_of(0, 0, 1500, 0, 0, 20);
    const Corners truth = corners_of(far, camera, 100);
    const double left = std::min({truth[0].x, truth[1].x, truth[2].x, truth[3].x});
    const int cut = static_cast<int>(left) + 1;
    const cv::Point2d shift(cut, 0);
    const auto found = aligned(blurred(0, far).colRange(cut, size.width).clone(),
                               {truth[0] - shift, truth[1] - shift, truth[2] - shift, truth[3] - shift});
    ASSERT_TRUE(found);
    for (int k = 0; k < 4; ++k)
        EXPECT_LT(cv::norm(found->corners_px[k] + shift - truth[k]), 0.05);
}

// A tag one of whose corners something of one grey level hides.
struct HiddenCorner {
    Mt mt;
    cv::Mat picture;

    // `hidden`: side of the cover relative to that of the tag.
    HiddenCorner(double hidden, int level, double turn_degrees, int corner = 0, double tilt_degrees = 25)
        : mt(pose_of(5, -3, 500, tilt_degrees, 15, turn_degrees)) {
        const arhost_intrinsics fine_camera = enlarged(camera, fine);
        cv::Mat sharp = render(fine_camera, {{tag.with_margin(1), 100, mt}});
        hide_corner(sharp, fine_camera, mt, 100, hidden, level, corner);
        cv::GaussianBlur(sharp, sharp, {}, fine * 0.7);
        reduced(sharp).convertTo(picture, CV_16S);
        add_noise(picture, 1.5, 1);
    }
    Corners corners_px() const { return corners_of(mt, camera, 100); }
};

TEST(PrintAlignment, IgnoresWhatHidesACorner) {
    for (const double hidden : {0.1, 0.2, 0.3})
        for (const int level : {0, 120, 255})
            for (const double turn_degrees : {0, 50}) {
                const HiddenCorner view(hidden, level, turn_degrees);
                const Corners truth = view.corners_px();
                const auto found = aligned(view.picture, truth);
                SCOPED_TRACE(testing::Message() << hidden << " " << level << " " << turn_degrees);
                ASSERT_TRUE(found);
                expect_near(found, truth, 0.06);
                EXPECT_LT(found->sigma_px, 0.03);
            }
}

// They differ most from the model, whose blur is that of a lens.
TEST(PrintAlignment, ToleratesSharpEdges) {
    EXPECT_LT(errors({500, 30, 0.1, 1.5}).aligned_px, 0.022);
}

// The slope of sRGB's curve is steep there, so small errors of the light are large ones of the code.
TEST(PrintAlignment, ToleratesFlareBesideDeepBlack) {
    cv::Mat light, flare;
    blurred(0).convertTo(light, CV_32F, 1 / 255.0);
    double black = 0, white = 0;
    cv::minMaxLoc(light, &black, &white);
    light = (light - black) * (0.8 / (white - black)) + 0.0002;
    cv::GaussianBlur(light, light, {}, 0.7);
    cv::GaussianBlur(light, flare, {}, 3);
    light = 0.93 * light + 0.07 * flare;
    cv::Mat_<std::uint8_t> picture(light.size());
    for (int y = 0; y < light.rows; ++y)
        for (int x = 0; x < light.cols; ++x)
            picture(y, x) = static_cast<std::uint8_t>(arhost::shading::srgb8_exact(light.at<float>(y, x)));
    const auto found = align_print(picture, ARHOST_TRANSFER_SRGB, truth, lens, print_of(tag));
    expect_near(found, truth, 0.04);
}

TEST(PrintAlignment, ToleratesNoiseBesideClippedBlack) {
    cv::Mat picture = blurred(0.7);
    picture.convertTo(picture, CV_16S, 1, -40); // black is below 0
    add_noise(picture, 8, 1);
    const auto found = aligned(picture, truth);
    expect_near(found, truth, 0.25); // clipped black shifts edges
}

TEST(PrintAlignment, ReturnsNothingIfHalfOfThePrintIsHidden) {
    for (const int level : {0, 120, 255}) {
        const HiddenCorner view(0.75, level, 20);
        EXPECT_FALSE(aligned(view.picture, view.corners_px()));
    }
}

TEST(CornerRefinement, FindsACornerThatTheDetectorTakesForTheEndOfItsCover) {
    for (int i = 0; i < 8; ++i) {
        const int corner = i % 4;
        const HiddenCorner view(0.3, 120, 50, corner, i < 4 ? 25 : 55);
        const Corners truth = view.corners_px();
        Corners rough = truth;
        rough[corner] = pixel_of(view.mt, camera, corner == 1 || corner == 2 ? 35 : -35, corner < 2 ? 35 : -35);
        const auto found = refined(view.picture, rough);
        SCOPED_TRACE(i);
        expect_near(found, truth, 0.06);
    }
}

TEST(CornerRefinement, KeepsTheEdgesBesideWhiteThatIsHardlyClipped) {
    cv::Mat picture = blurred(0.7);
    double white = 0;
    cv::minMaxLoc(picture, nullptr, &white);
    picture.convertTo(picture, CV_8U, 1.02 * 255 / white);
    ASSERT_TRUE(aligned(picture, truth));
    const auto found = refined(picture, truth), edges = edges_of(picture, truth);
    ASSERT_TRUE(found && edges);
    EXPECT_EQ(found->corners_px, edges->corners_px);
}

TEST(CornerRefinement, AlignsThePrintOnlyWhereCellsAreNarrow) {
    for (const auto &[distance_mm, is_narrow] : {std::pair(400.0, false), {1600.0, true}}) {
        const Mt pose = pose_of(5, -3, distance_mm, 20, 15, 25);
        const cv::Mat picture = blurred(0.6, pose);
        const Corners rough = corners_of(pose, camera, 100);
        const auto found = refined(picture, rough), edges = edges_of(picture, rough);
        ASSERT_TRUE(found && edges);
        EXPECT_EQ(found->corners_px != edges->corners_px, is_narrow);
    }
}

TEST(CornerRefinement, NeedsNoPrintIfMarkersAreDarkNoisyOrPartlyHidden) {
    struct View {
        double hidden, exposure, noise, max_px;
    };
    for (const auto &[hidden, exposure, noise, max_px] :
         {View{0, 1, 1.5, 0.03}, View{0, 0.1, 1.5, 0.2}, View{0, 1, 20, 0.25}, View{0.1, 1, 1.5, 0.03},
          View{0.2, 1, 1.5, 0.03}}) {
        const Mt mt = pose_of(5, -3, 500, 25, 15, 50);
        const arhost_intrinsics fine_camera = enlarged(camera, fine);
        cv::Mat picture = render(fine_camera, {{tag.with_margin(1), 100, mt}});
        if (hidden > 0)
            hide_corner(picture, fine_camera, mt, 100, hidden, 120);
        cv::GaussianBlur(picture, picture, {}, fine * 0.6);
        reduced(picture).convertTo(picture, CV_16S, exposure);
        add_noise(picture, noise, 1);
        const Corners truth = corners_of(mt, camera, 100);
        Corners rough = truth;
        rough[0] += hidden / 2 * (truth[2] - truth[0]);
        const auto found = refine_corners(picture, ARHOST_TRANSFER_LINEAR, rough, lens, tag.corner_cells, [&] {
            ADD_FAILURE() << "needs the print";
            return print_of(tag);
        });
        SCOPED_TRACE(testing::Message() << hidden << " " << exposure << " " << noise);
        expect_near(found, truth, max_px);
    }
}

TEST(CornerRefinement, AlignsThePrintBesideSaturatedWhite) {
    for (const char *family : {"tag36h11", "tagStandard41h12"}) { // the border of the second is white
        const Print print = april_tag(family, 4);
        const auto found = refined(2 * blurred(0.7, mt, print), truth, print);
        SCOPED_TRACE(family);
        expect_near(found, truth, 0.15);
    }
}

TEST(CornerRefinement, AlignsThePrintIfEdgesAreNotFound) {
    const cv::Mat picture = blurred(4);
    ASSERT_FALSE(edges_of(picture, truth, true));
    const auto found = refined(picture, truth, tag, true);
    expect_near(found, truth, 0.1);
}

TEST(CornerRefinement, KeepsTheEdgesOfAPrintThatDoesNotFit) {
    const Mt far = pose_of(5, -3, 1600, 20, 15, 25);
    const cv::Mat picture = blurred(0.6, far);
    const Corners rough = corners_of(far, camera, 100);
    const auto found = refined(picture, rough, april_tag("tag36h11", 5)), edges = edges_of(picture, rough);
    ASSERT_TRUE(found && edges);
    EXPECT_EQ(found->corners_px, edges->corners_px);
}

} // namespace
