// SPDX-License-Identifier: Apache-2.0
#include "pose/estimate.hpp"

#include "simulated_markers.hpp"

#include <opencv2/calib3d.hpp>

namespace arhost::pose {
namespace {

constexpr double side_mm = 80;
const arhost_intrinsics pinhole = intrinsics_of(ARHOST_DISTORTION_NONE, {});

// A box of 120 mm with a marker on each of its three visible sides, or a board of 3×2 markers.
std::vector<std::array<Eigen::Vector3d, 4>> box() {
    const Eigen::Vector3d x = Eigen::Vector3d::UnitX(), y = Eigen::Vector3d::UnitY();
    return {square_at({Eigen::Matrix3d::Identity(), {0, 0, 60}}, side_mm),
            square_at({rotation_by(90 * radians * y), {60, 0, 0}}, side_mm),
            square_at({rotation_by(-90 * radians * x), {0, 60, 0}}, side_mm)};
}
std::vector<std::array<Eigen::Vector3d, 4>> board() {
    std::vector<std::array<Eigen::Vector3d, 4>> markers;
    for (int column = 0; column < 3; ++column)
        for (int row = 0; row < 2; ++row)
            markers.push_back(square_at({Eigen::Matrix3d::Identity(), {100.0 * column, 100.0 * row, 0}}, side_mm));
    return markers;
}

std::vector<ObservedMarker> observe(Camera &camera, const Rigid &pose,
                                    const std::vector<std::array<Eigen::Vector3d, 4>> &markers, double noise_px = 0) {
    std::vector<ObservedMarker> observed;
    for (const auto &corners : markers)
        observed.push_back(camera.observe(pose, corners, noise_px));
    return observed;
}

void expect_pose(const Rigid &found, const Rigid &truth, double degrees, double mm) {
    EXPECT_LT(degrees_between(found, truth), degrees);
    EXPECT_LT((found.translation_mm - truth.translation_mm).norm(), mm);
}

class EstimateThroughLens : public testing::TestWithParam<LensCase> {};
INSTANTIATE_TEST_SUITE_P(Lenses, EstimateThroughLens, testing::ValuesIn(lenses), name_of);

} // namespace

TEST_P(EstimateThroughLens, RecoversTheKnownPoseOfAMarkerFromExactCorners) {
    Camera camera(GetParam().intrinsics);
    for (const Rigid &truth : {pose_at({0, 0, 400}, 35, 20, 10), pose_at({150, 60, 500}, 40, 25, 100),
                               pose_at({-220, -110, 600}, 50, -70, 190), pose_at({30, 20, 2000}, 60, 5, 45)}) {
        const ObservedMarker marker = camera.observe(truth, square_corners_mm(side_mm));
        const auto found = estimate_poses({&marker, 1}, camera.projection());
        ASSERT_FALSE(found.empty());
        expect_pose(found[0].camera_from_target, truth, 1e-4, 1e-3);
        EXPECT_LT(found[0].reprojection_px, 1e-6);
    }
}

TEST_P(EstimateThroughLens, RecoversTheKnownPoseOfABodyFromExactCorners) {
    Camera camera(GetParam().intrinsics);
    const Rigid truth = pose_at({-30, 20, 900}, 40, 130, 30);
    for (const auto &markers : {box(), board()}) {
        const auto found = estimate_poses(observe(camera, truth, markers), camera.projection());
        ASSERT_FALSE(found.empty());
        expect_pose(found[0].camera_from_target, truth, 1e-4, 1e-3);
        EXPECT_EQ(found[0].outliers, 0u);
    }
}

TEST(Estimate, AFarMarkerHasASecondPoseANearOneHasNot) {
    Camera camera(pinhole);
    const auto poses_at = [&](double distance_mm) {
        const ObservedMarker marker = camera.observe(pose_at({0, 0, distance_mm}, 40), square_corners_mm(side_mm));
        return estimate_poses({&marker, 1}, camera.projection());
    };
    const auto far = poses_at(4000);
    ASSERT_EQ(far.size(), 2u);
    EXPECT_LT(degrees_between(far[1].camera_from_target, pose_at({0, 0, 4000}, -40)), 3);
    EXPECT_GT(far[1].normalized_error, far[0].normalized_error);
    EXPECT_EQ(poses_at(100).size(), 1u);
}

TEST(Estimate, IsTheMinimumOfTheReprojectionErrorThatOpenCvFinds) {
    Camera camera(pinhole, 5);
    for (int round = 0; round < 50; ++round) {
        const Rigid truth = pose_at({camera.between(-200, 200), camera.between(-100, 100), camera.between(600, 1500)},
                                    camera.between(20, 60), camera.between(0, 360));
        const auto markers = observe(camera, truth, box(), 0.2);
        std::vector<cv::Point3d> object;
        std::vector<cv::Point2d> image;
        for (const ObservedMarker &marker : markers)
            for (int i = 0; i < 4; ++i) {
                const Eigen::Vector3d &p = marker.corners_on_target_mm[i];
                object.emplace_back(p.x(), p.y(), p.z());
                image.emplace_back(marker.corners_px[i].x(), marker.corners_px[i].y());
            }
        cv::Vec3d rotation, translation;
        const Eigen::Vector3d start = rotation_vector(truth.rotation);
        rotation = {start.x(), start.y(), start.z()};
        translation = {truth.translation_mm.x(), truth.translation_mm.y(), truth.translation_mm.z()};
        cv::solvePnPRefineLM(object, image, cv::Matx33d(900, 0, 652, 0, 910, 349, 0, 0, 1), cv::noArray(), rotation,
                             translation, {cv::TermCriteria::MAX_ITER + cv::TermCriteria::EPS, 200, 1e-12});
        const auto found = estimate_poses(markers, camera.projection());
        ASSERT_FALSE(found.empty());
        EXPECT_EQ(found[0].outliers, 0u);
        expect_pose(
            found[0].camera_from_target,
            {rotation_by({rotation[0], rotation[1], rotation[2]}), {translation[0], translation[1], translation[2]}},
            1e-3, 1e-2);
    }
}

TEST(Estimate, WrongMarkersDoNotMoveABody) {
    Camera camera(pinhole, 7);
    const Rigid truth = pose_at({-100, -50, 900}, 30, 60);
    auto markers = observe(camera, truth, board(), 0.05);
    const auto clean = estimate_poses({markers.data() + 2, 4}, camera.projection());
    ASSERT_FALSE(clean.empty());
    for (Eigen::Vector2d &corner : markers[0].corners_px) // another copy of the marker, somewhere else
        corner += Eigen::Vector2d(200, 120);
    for (Eigen::Vector2d &corner : markers[1].corners_px) // a marker that has been moved
        corner += Eigen::Vector2d(3, 1);
    const auto found = estimate_poses(markers, camera.projection());
    ASSERT_FALSE(found.empty());
    EXPECT_EQ(found[0].outliers, 8u);
    expect_pose(found[0].camera_from_target, clean[0].camera_from_target, 0.02, 0.2);
}

TEST(Estimate, AHiddenCornerDoesNotMoveABody) {
    Camera camera(pinhole, 8);
    const Rigid truth = pose_at({-100, -50, 900}, 30, 60);
    auto markers = observe(camera, truth, board(), 0.05);
    markers[3].corners_px[2] += Eigen::Vector2d(4, -2);
    const auto found = estimate_poses(markers, camera.projection());
    ASSERT_FALSE(found.empty());
    EXPECT_EQ(found[0].outliers, 1u);
    expect_pose(found[0].camera_from_target, truth, 0.1, 1);
}

// The 95 % quantile of the chi-squared distribution with 6 degrees of freedom is 12.59.
TEST(Estimate, The95PercentEllipsoidContainsTheTruthIn95Percent) {
    constexpr double noise_px = 0.1;
    constexpr int rounds = 1000;
    for (const auto &markers : {std::vector{square_corners_mm(side_mm)}, board()}) {
        Camera camera(pinhole, 9);
        int covered = 0;
        for (int round = 0; round < rounds; ++round) {
            const Rigid truth = pose_at({camera.between(-80, 80), camera.between(-60, 60), camera.between(500, 700)},
                                        camera.between(30, 60), camera.between(0, 360), camera.between(0, 360));
            const auto found = estimate_poses(observe(camera, truth, markers, noise_px), camera.projection());
            ASSERT_FALSE(found.empty());
            Eigen::Matrix<double, 6, 1> error;
            error << truth.translation_mm - found[0].camera_from_target.translation_mm,
                rotation_vector(truth.rotation * found[0].camera_from_target.rotation.transpose());
            covered += error.dot(found[0].covariance.ldlt().solve(error)) < 12.59;
        }
        EXPECT_GT(covered, 0.92 * rounds) << markers.size();
        EXPECT_LT(covered, 0.98 * rounds) << markers.size();
    }
}

TEST(Estimate, TheCovarianceOfABodyFollowsItsResidualsIfTheNoiseIsLargerThanSigma) {
    Camera camera(pinhole, 10);
    const Rigid truth = pose_at({-100, -50, 900}, 30, 60);
    const auto quiet = estimate_poses(observe(camera, truth, board(), 0.1), camera.projection());
    auto markers = observe(camera, truth, board(), 0.5);
    for (ObservedMarker &marker : markers)
        marker.corner_sigma_px = 0.1;
    const auto noisy = estimate_poses(markers, camera.projection());
    ASSERT_FALSE(quiet.empty());
    ASSERT_FALSE(noisy.empty());
    EXPECT_GT(noisy[0].covariance.trace(), 8 * quiet[0].covariance.trace());
}

TEST(Estimate, CornersThatNoFrontCanShowHaveNoPose) {
    Camera camera(pinhole);
    const ObservedMarker good = camera.observe(pose_at({0, 0, 500}, 20), square_corners_mm(side_mm));
    const auto expect_none = [&](const char *what, auto change) {
        ObservedMarker marker = good;
        change(marker);
        EXPECT_TRUE(estimate_poses({&marker, 1}, camera.projection()).empty()) << what;
    };
    expect_none("mirrored", [](ObservedMarker &m) { std::ranges::reverse(m.corners_px); });
    expect_none("NaN", [](ObservedMarker &m) { m.corners_px[1].x() = std::nan(""); });
    expect_none("equal", [](ObservedMarker &m) { m.corners_px.fill({100, 100}); });
    expect_none("concave",
                [](ObservedMarker &m) { m.corners_px[0] = 0.4 * m.corners_px[0] + 0.6 * m.corners_px[2]; });
    expect_none("collinear", [](ObservedMarker &m) { m.corners_px[1] = 0.5 * (m.corners_px[0] + m.corners_px[2]); });
    expect_none("no extent on the target", [](ObservedMarker &m) { m.corners_on_target_mm.fill({1, 2, 3}); });
    EXPECT_TRUE(estimate_poses({}, camera.projection()).empty());
}

TEST(Estimate, ASquareParallelToTheImageHasTheFrontalPose) {
    // Both solutions coincide, and rounding errors could select either.
    const Projection projection(pinhole);
    constexpr double side_px = 95, distance_mm = 900 * side_mm / side_px;
    for (int left = 300; left <= 900; left += 10)
        for (const double nudge_px : {0.0, 1e-9, 1e-7, 1e-6}) {
            const double right = left + side_px, top = 310, bottom = top + side_px * 910 / 900;
            const ObservedMarker marker{square_corners_mm(side_mm),
                                        {{{double(left), top},
                                          {right + nudge_px, top - nudge_px / 2},
                                          {right, bottom},
                                          {double(left), bottom}}},
                                        0.1};
            const auto found = estimate_poses({&marker, 1}, projection);
            ASSERT_FALSE(found.empty()) << left;
            const double x_px = left + side_px / 2 - pinhole.cx, y_px = (top + bottom) / 2 - pinhole.cy;
            expect_pose(found[0].camera_from_target,
                        pose_at({x_px * distance_mm / 900, y_px * distance_mm / 910, distance_mm}, 0), 1e-3, 1e-3);
        }
}

TEST(Estimate, EveryPoseOfArbitraryCornersShowsTheFrontOfTheMarker) {
    const Projection projection(pinhole);
    std::mt19937 random(7);
    std::uniform_real_distribution<double> x_px(0, 1280), y_px(0, 720);
    int poses = 0;
    for (int round = 0; round < 3000; ++round) {
        ObservedMarker marker{square_corners_mm(side_mm), {}, 0.1};
        for (Eigen::Vector2d &corner : marker.corners_px)
            corner = {x_px(random), y_px(random)};
        for (const Estimate &estimate : estimate_poses({&marker, 1}, projection)) {
            ++poses;
            const Rigid &pose = estimate.camera_from_target;
            EXPECT_GT(pose.translation_mm.z(), 0);
            EXPECT_LT(pose.rotation.col(2).dot(pose.translation_mm), 0);
            EXPECT_TRUE(std::isfinite(estimate.reprojection_px));
        }
    }
    EXPECT_GT(poses, 100);
}

} // namespace arhost::pose
