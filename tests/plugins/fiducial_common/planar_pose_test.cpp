// SPDX-License-Identifier: Apache-2.0
#include <fiducial_common/planar_pose.hpp>

#include "rendered_marker.hpp"

#include <arhost-cpp/plugin.hpp>

#include <gmock/gmock.h>

#include <algorithm>
#include <limits>
#include <random>

namespace {

using namespace arhost::test;
using arhost::fiducial::Corners;
using arhost::fiducial::Lens;
using arhost::fiducial::planar_pose;
using testing::DoubleNear;
using testing::Pointwise;

constexpr double side_mm = 80;

struct LensCase {
    const char *name;
    arhost_intrinsics camera;
};

arhost_intrinsics camera_of(arhost_distortion distortion, const std::vector<double> &coefficients) {
    return intrinsics_of({1280, 720}, 900, 910, 652, 349, distortion, coefficients);
}

const LensCase lenses[] = {
    {"None", camera_of(ARHOST_DISTORTION_NONE, {})},
    {"Brown4", camera_of(ARHOST_DISTORTION_BROWN, {-0.28, 0.09, 0.001, -0.0007})},
    {"Brown5", camera_of(ARHOST_DISTORTION_BROWN, {0.135, -0.234, 0.0007, 0.0048, 0.02})},
    {"Brown8", camera_of(ARHOST_DISTORTION_BROWN, {0.4, -0.1, 0.0005, 0.0003, 0.01, 0.5, -0.05, 0.004})},
    {"Brown12", camera_of(ARHOST_DISTORTION_BROWN,
                          {0.4, -0.1, 0.0005, 0.0003, 0.01, 0.5, -0.05, 0.004, 0.001, -0.0005, 0.0008, 0.0002})},
    {"Fisheye", camera_of(ARHOST_DISTORTION_FISHEYE, {0.08, -0.03, 0.012, -0.003})},
};

void PrintTo(const LensCase &lens, std::ostream *out) {
    *out << lens.name;
}
std::string name_of(const testing::TestParamInfo<LensCase> &info) {
    return info.param.name;
}

void expect_orthonormal(const std::array<double, 16> &mt) {
    for (int a = 0; a < 3; ++a)
        for (int b = a; b < 3; ++b) {
            const double dot = mt[4 * a] * mt[4 * b] + mt[4 * a + 1] * mt[4 * b + 1] + mt[4 * a + 2] * mt[4 * b + 2];
            EXPECT_NEAR(dot, a == b ? 1 : 0, 1e-9);
        }
    const cv::Vec3d x(mt.data()), y(mt.data() + 4), z(mt.data() + 8);
    EXPECT_NEAR(x.cross(y).dot(z), 1, 1e-9);
    EXPECT_THAT((std::array{mt[3], mt[7], mt[11], mt[15]}), testing::ElementsAre(0, 0, 0, 1));
}

class PlanarPoseThroughLens : public testing::TestWithParam<LensCase> {};
INSTANTIATE_TEST_SUITE_P(Lenses, PlanarPoseThroughLens, testing::ValuesIn(lenses), name_of);

TEST_P(PlanarPoseThroughLens, RecoversTheKnownPoseFromExactCorners) {
    const arhost_intrinsics &camera = GetParam().camera;
    for (const Mt &truth : {pose_of(0, 0, 400, 35, 20, 10), pose_of(150, -60, 500, -40, 25, 100),
                            pose_of(-220, 110, 600, 10, -50, -170), pose_of(30, 20, 2000, 60, 5, 45)}) {
        const auto found = planar_pose(corners_of(truth, camera, side_mm), Lens(camera), side_mm);
        ASSERT_TRUE(found);
        EXPECT_THAT(found->best.mt, Pointwise(DoubleNear(1e-4), truth));
        EXPECT_LT(found->best.reprojection_px, 1e-6);
        ASSERT_TRUE(found->alternative);
        EXPECT_LT(found->ambiguity, 1e-4);
        expect_orthonormal(found->best.mt);
        expect_orthonormal(found->alternative->mt);
    }
}

TEST(PlanarPose, FacingMarkerHasXRightYUpAndZTowardsTheViewer) {
    const auto camera = intrinsics_of({640, 480}, 600, 600, 320, 240);
    // The square is 60 px wide; its centre is 30 px to the right of the principal point and 60 px above it.
    const auto found = planar_pose({{{320, 150}, {380, 150}, {380, 210}, {320, 210}}}, Lens(camera), 100);
    ASSERT_TRUE(found);
    const Mt expected{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 50, 100, -1000, 1};
    EXPECT_THAT(found->best.mt, Pointwise(DoubleNear(1e-3), expected));
}

TEST(PlanarPose, SquareCentredOnTheAxisFacesTheCamera) {
    const auto camera = intrinsics_of({320, 256}, 300, 300, 159.5, 127.5);
    const double left = 112, right = 207, top = 80, bottom = 175, distance = 300 * side_mm / 95;
    Corners corners = {{{left, top}, {right, top}, {right, bottom}, {left, bottom}}};
    for (const int turn : {0, -90, -180, -270}) {
        for (const double nudge : {0.0, 1e-9, 1e-7, 1e-6}) {
            Corners nudged = corners;
            nudged[1] += cv::Point2d(nudge, -nudge / 2);
            const auto found = planar_pose(nudged, Lens(camera), side_mm);
            ASSERT_TRUE(found) << turn << ", " << nudge;
            EXPECT_THAT(found->best.mt, Pointwise(DoubleNear(1e-3), pose_of(0, 0, distance, 0, 0, turn))) << nudge;
        }
        std::ranges::rotate(corners, corners.begin() + 1);
    }
}

TEST(PlanarPose, OffAxisSquareFacesTheCamera) {
    const auto camera = intrinsics_of({320, 256}, 300, 300, 159.5, 127.5);
    for (int left = 52; left <= 172; ++left) {
        const double top = 80, side = 95, scale = side_mm / side;
        const auto found = planar_pose(
            {{{1.0 * left, top}, {left + side, top}, {left + side, top + side}, {1.0 * left, top + side}}},
            Lens(camera), side_mm);
        ASSERT_TRUE(found) << left;
        const auto expected = pose_of((left + side / 2 - 159.5) * scale, 0, 300 * scale, 0, 0, 0);
        EXPECT_THAT(found->best.mt, Pointwise(DoubleNear(1e-3), expected)) << left;
    }
}

TEST(PlanarPose, ReprojectionErrorIsTheRmsInDistortedPixels) {
    const auto &camera = lenses[5].camera;
    const Lens lens(camera);
    auto corners = corners_of(pose_of(180, 90, 500, 30, 20, 5), camera, side_mm);
    corners[2] += cv::Point2d(1.5, -1);
    const auto found = planar_pose(corners, lens, side_mm);
    ASSERT_TRUE(found);
    for (const auto &pose : {found->best, *found->alternative}) {
        const auto again = corners_of(pose.mt, camera, side_mm);
        double sum = 0;
        for (int i = 0; i < 4; ++i)
            sum += (corners[i] - again[i]).dot(corners[i] - again[i]);
        EXPECT_NEAR(pose.reprojection_px, std::sqrt(sum / 4), 1e-6);
    }
    EXPECT_GT(found->best.reprojection_px, 0.1);
    EXPECT_NEAR(found->ambiguity, found->best.reprojection_px / found->alternative->reprojection_px, 1e-12);
}

TEST(PlanarPose, FarMarkerIsAmbiguousWithAnAlternativeTiltedTheOtherWay) {
    const auto camera = intrinsics_of({640, 480}, 600, 600, 319.5, 239.5);
    auto corners = corners_of(pose_of(0, 0, 4000, 30), camera, side_mm);
    corners[0] += cv::Point2d(0.1, -0.05);
    const auto far = planar_pose(corners, Lens(camera), side_mm);
    ASSERT_TRUE(far && far->alternative);
    EXPECT_GT(far->ambiguity, 0.5);
    EXPECT_LE(far->ambiguity, 1);
    EXPECT_LT(far->best.mt[9] * far->alternative->mt[9], 0); // the y components of the two normals

    auto near_corners = corners_of(pose_of(0, 0, 300, 40), camera, side_mm);
    near_corners[0] += cv::Point2d(0.1, -0.05);
    EXPECT_LT(planar_pose(near_corners, Lens(camera), side_mm)->ambiguity, 0.05);
}

TEST(PlanarPose, ReturnsNothingForDegenerateCorners) {
    const Lens lens(intrinsics_of({640, 480}, 600, 600, 319.5, 239.5));
    const double nan = std::numeric_limits<double>::quiet_NaN(), infinite = std::numeric_limits<double>::infinity();
    const Corners degenerate[] = {
        {{{10, 10}, {20, 20}, {30, 30}, {40, 40}}},       // collinear
        {{{10, 10}, {50, 10}, {30, 10}, {10, 50}}},       // three corners are collinear
        {{{10, 10}, {10, 10}, {10, 10}, {10, 10}}},       // all corners coincide
        {{{10, 10}, {50, 50}, {50, 10}, {10, 50}}},       // self-intersecting
        {{{10, 10}, {50, 10}, {20, 20}, {10, 50}}},       // not convex
        {{{nan, 10}, {50, 10}, {50, 50}, {10, 50}}},      //
        {{{10, 10}, {50, infinite}, {50, 50}, {10, 50}}}, //
        {{{50, 10}, {10, 10}, {10, 50}, {50, 50}}},       // wrong orientation: shows the back face
    };
    for (const Corners &corners : degenerate)
        EXPECT_FALSE(planar_pose(corners, lens, side_mm));
}

TEST(PlanarPose, ReturnsNothingWhereTheDistortionCannotBeInverted) {
    // The distorted radius r·(1 − 0.5 r²) has its maximum 0.544 at r = 0.816; no ray reaches pixels beyond that
    // radius.
    const auto camera = intrinsics_of({640, 480}, 300, 300, 319.5, 239.5, ARHOST_DISTORTION_BROWN, {-0.5, 0, 0, 0});
    EXPECT_TRUE(planar_pose({{{300, 220}, {340, 220}, {340, 260}, {300, 260}}}, Lens(camera), side_mm));
    EXPECT_FALSE(planar_pose({{{580, 220}, {620, 220}, {620, 260}, {580, 260}}}, Lens(camera), side_mm));
}

TEST(PlanarPose, AnyQuadrilateralGivesAValidPoseOrNone) {
    const auto camera = intrinsics_of({640, 480}, 600, 600, 319.5, 239.5);
    const Lens lens(camera);
    std::mt19937 generator(7);
    std::uniform_real_distribution<double> x(0, 640), y(0, 480);
    int poses = 0;
    for (int i = 0; i < 3000; ++i) {
        Corners corners;
        for (auto &corner : corners)
            corner = {x(generator), y(generator)};
        const auto found = planar_pose(corners, lens, side_mm);
        if (!found)
            continue;
        ++poses;
        EXPECT_TRUE(found->ambiguity >= 0 && found->ambiguity <= 1);
        for (const auto &pose : {found->best, found->alternative.value_or(found->best)}) {
            expect_orthonormal(pose.mt);
            EXPECT_LT(pose.mt[14], 0); // the marker is in front of the camera
            const double facing = pose.mt[8] * pose.mt[12] + pose.mt[9] * pose.mt[13] + pose.mt[10] * pose.mt[14];
            EXPECT_LT(facing, 0); // the marker's front faces the camera
            EXPECT_LE(found->best.reprojection_px, pose.reprojection_px);
        }
        const auto again = planar_pose(corners, lens, side_mm);
        EXPECT_EQ(again->best.mt, found->best.mt);
    }
    EXPECT_GT(poses, 200);
}

TEST(Lens, RejectsAnInvalidCalibration) {
    auto three_coefficients = camera_of(ARHOST_DISTORTION_BROWN, {0.1, 0.1, 0.1});
    auto fisheye_of_five = camera_of(ARHOST_DISTORTION_FISHEYE, {0, 0, 0, 0, 0});
    auto unknown_model = camera_of(99, {});
    auto no_focal_length = intrinsics_of({640, 480}, 0, 600, 320, 240);
    for (const auto &camera : {three_coefficients, fisheye_of_five, unknown_model, no_focal_length})
        try {
            Lens lens(camera);
            ADD_FAILURE() << "the invalid input was accepted";
        } catch (const arhost::Failure &failure) {
            EXPECT_EQ(failure.status(), ARHOST_STATUS_ERROR_CONFIGURATION);
            EXPECT_THAT(failure.what(), testing::HasSubstr("calibration"));
        }
}

} // namespace
