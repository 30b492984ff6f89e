// SPDX-License-Identifier: Apache-2.0
//
// Calibrates with exactly projected corners: selection of views, coverage, errors.
#include "calibrate/collector.hpp"
#include "rendered_board.hpp"

#include <gmock/gmock.h>

#include <random>

namespace {

using namespace arhost::calibrate;
using testing::Contains;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::StartsWith;
using Verdict = Collector::Verdict;

// The corners of a chessboard with 9 x 6 inner corners.
View view_at(const Pose &pose, const TrueCamera &camera, double noise_px = 0, std::uint32_t seed = 1) {
    cv::Matx33d rotation;
    cv::Vec3d translation;
    constexpr double square_mm = 36;
    place(pose, camera, {8 * square_mm, 5 * square_mm}, rotation, translation);
    cv::Vec3d rotation_vector;
    cv::Rodrigues(rotation, rotation_vector);
    View view;
    std::vector<cv::Point3d> board;
    for (int row = 0; row < 6; ++row)
        for (int column = 0; column < 9; ++column)
            board.emplace_back(column * square_mm, row * square_mm, 0);
    std::vector<cv::Point2d> pixels;
    if (camera.lens.model == Model::fisheye)
        cv::fisheye::projectPoints(board, pixels, rotation_vector, translation, camera.lens.matrix,
                                   camera.lens.coefficients);
    else
        cv::projectPoints(board, rotation_vector, translation, camera.lens.matrix, camera.lens.coefficients, pixels);
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    for (std::size_t i = 0; i < board.size(); ++i) {
        view.board_mm.emplace_back(board[i]);
        const double x = normal(random), y = normal(random);
        view.image_px.emplace_back(pixels[i] + noise_px * cv::Point2d(x, y));
    }
    return view;
}

std::vector<View> views_at(const std::vector<Pose> &poses, const TrueCamera &camera, double noise_px = 0,
                           std::uint32_t seed = 1) {
    std::vector<View> views;
    for (const Pose &pose : poses)
        views.push_back(view_at(pose, camera, noise_px, ++seed));
    return views;
}

Coverage coverage_of(const std::vector<View> &views, const TrueCamera &camera) {
    return Coverage(calibrate(views, camera.size, camera.lens.model));
}

class EveryLens : public testing::TestWithParam<TrueCamera> {};
INSTANTIATE_TEST_SUITE_P(Calibration, EveryLens, testing::Values(brown_camera(), fisheye_camera()),
                         [](const auto &info) { return info.index == 0 ? "Brown" : "Fisheye"; });

} // namespace

TEST_P(EveryLens, IsExactForExactCorners) {
    const Calibration calibration =
        calibrate(views_at(good_poses(), GetParam()), GetParam().size, GetParam().lens.model);
    for (const auto &[row, column] : {std::pair(0, 0), {1, 1}, {0, 2}, {1, 2}})
        EXPECT_NEAR(calibration.lens.matrix(row, column), GetParam().lens.matrix(row, column), 0.02);
    EXPECT_LT(calibration.error_px, 1e-3);
    EXPECT_THAT(calibration.dropped, IsEmpty());
}

TEST_P(EveryLens, ReportsItsStandardDeviations) {
    constexpr int trials = 30;
    std::array<double, 4> squares{}, reported{};
    for (std::uint32_t trial = 0; trial < trials; ++trial) {
        const Calibration calibration =
            calibrate(views_at(good_poses(), GetParam(), 0.2, 100 * trial), GetParam().size, GetParam().lens.model);
        const auto &found = calibration.lens.matrix, &expected = GetParam().lens.matrix;
        const std::array errors{found(0, 0) - expected(0, 0), found(1, 1) - expected(1, 1),
                                found(0, 2) - expected(0, 2), found(1, 2) - expected(1, 2)};
        for (std::size_t k = 0; k < 4; ++k) {
            squares[k] += errors[k] * errors[k] / trials;
            reported[k] += calibration.deviations_px[k] / trials;
        }
        EXPECT_NEAR(calibration.error_px, 0.2 * std::numbers::sqrt2, 0.03);
    }
    for (std::size_t k = 0; k < 4; ++k) // the deviation of 30 trials is uncertain by 13 %
        EXPECT_NEAR(std::sqrt(squares[k]) / reported[k], 1, 0.4) << k;
}

TEST_P(EveryLens, LeavesOutWrongCorners) {
    std::vector<View> views = views_at(good_poses(), GetParam(), 0.1);
    views[5].image_px[20] += cv::Point2f(9, 4);
    views[7].image_px[0] += cv::Point2f(-2, 0);
    const Calibration calibration = calibrate(views, GetParam().size, GetParam().lens.model);
    EXPECT_THAT(calibration.dropped, IsEmpty());
    ASSERT_EQ(calibration.used.size(), views.size());
    for (const UsedView &used : calibration.used) {
        EXPECT_EQ(used.left_out, used.index == 5 || used.index == 7 ? 1u : 0u);
        EXPECT_EQ(used.residuals_px.size(), 54 - used.left_out);
        EXPECT_EQ(used.corners_px.size(), 54 - used.left_out);
    }
    EXPECT_LT(calibration.error_px, 0.2);
    EXPECT_NEAR(calibration.lens.matrix(0, 0), GetParam().lens.matrix(0, 0), 1);
}

TEST_P(EveryLens, LeavesOutAWrongView) {
    std::vector<View> views = views_at(good_poses(), GetParam(), 0.1);
    views[5] = view_at(good_poses()[5], GetParam(), 2);
    const Calibration calibration = calibrate(views, GetParam().size, GetParam().lens.model);
    ASSERT_EQ(calibration.dropped.size(), 1u);
    EXPECT_EQ(calibration.dropped[0].index, 5u);
    EXPECT_GT(calibration.dropped[0].error_px, 1);
    EXPECT_EQ(calibration.used.size(), views.size() - 1);
    EXPECT_LT(calibration.error_px, 0.2);
    EXPECT_NEAR(calibration.lens.matrix(0, 0), GetParam().lens.matrix(0, 0), 1);
}

TEST_P(EveryLens, ReportsTheTiltsOfViews) {
    for (const Pose &pose : {Pose{0.5, 0.5, 1, 25, 0, 0},
                             {0.3, 0.4, 1.2, -25, 0, 90},
                             {0.6, 0.6, 1, 0, 20, 179.9},
                             {0.5, 0.3, 1, 0, -20, 20}}) {
        const Tilt tilt = tilt_of(view_at(pose, GetParam()), GetParam().lens);
        EXPECT_NEAR(tilt.about_vertical_degrees, pose.about_vertical, 0.5);
        EXPECT_NEAR(tilt.about_horizontal_degrees, pose.about_horizontal, 0.5);
    }
}

TEST(Coverage, IsCompleteForViewsInAllRegionsWithAllTilts) {
    EXPECT_THAT(coverage_of(views_at(good_poses(), brown_camera()), brown_camera()).missing(), IsEmpty());
}

TEST(Coverage, NamesEachMissingRegion) {
    const std::pair<cv::Point2d, const char *> opposite_regions[] = {
        {{0.7, 0.7}, "top left"},     {{0.3, 0.7}, "top right"}, {{0.7, 0.3}, "bottom left"},
        {{0.3, 0.3}, "bottom right"}, {{0.5, 0.7}, "top"},       {{0.5, 0.3}, "bottom"},
        {{0.7, 0.5}, "left"},         {{0.3, 0.5}, "right"},
    };
    for (const auto &[at, name] : opposite_regions) {
        Coverage coverage(brown_camera().size);
        coverage.add(view_at({at.x, at.y, 1.6, 0, 0, 0}, brown_camera()), {});
        EXPECT_THAT(coverage.missing(), Contains("move the board to the " + std::string(name) + " of the image"));
    }
    const std::vector<std::string> missing = Coverage(brown_camera().size).missing();
    EXPECT_THAT(missing, Contains("move the board to the centre of the image"));
}

TEST(Coverage, NamesTheMissingTilt) {
    const auto without = [](auto keeps) {
        std::vector<Pose> poses;
        for (Pose pose : good_poses()) {
            keeps(pose);
            poses.push_back(pose);
        }
        return coverage_of(views_at(poses, brown_camera()), brown_camera()).missing();
    };
    EXPECT_THAT(without([](Pose &pose) { pose.about_vertical = 10; }),
                ElementsAre("tilt the board more about its vertical axis: bring its left side nearer to the camera"));
    EXPECT_THAT(
        without([](Pose &pose) { pose.about_vertical = -10; }),
        ElementsAre("tilt the board more about its vertical axis: bring its right side nearer to the camera"));
    EXPECT_THAT(
        without([](Pose &pose) { pose.about_horizontal = 10; }),
        ElementsAre("tilt the board more about its horizontal axis: bring its upper side nearer to the camera"));
    EXPECT_THAT(
        without([](Pose &pose) { pose.about_horizontal = -10; }),
        ElementsAre("tilt the board more about its horizontal axis: bring its lower side nearer to the camera"));
}

TEST(Coverage, NamesTheNumberOfMissingViews) {
    Coverage coverage(brown_camera().size);
    coverage.add(view_at(good_poses()[0], brown_camera()), {});
    EXPECT_THAT(coverage.missing(), Contains("take 9 more views, with other tilts"));
}

TEST(Selection, KeepsTheViewsThatCoverMost) {
    std::vector<Pose> poses = good_poses();
    const std::size_t useful = poses.size();
    for (int i = 0; i < 60; ++i) // almost the same view
        poses.insert(poses.begin(), {0.5, 0.5, 1.1, 0.01 * i, 0, 0});
    const std::vector<View> views = views_at(poses, brown_camera());
    const auto chosen = select(views, brown_camera().size, brown_camera().lens, useful);
    EXPECT_EQ(chosen.size(), useful);
    EXPECT_TRUE(std::ranges::is_sorted(chosen));
    EXPECT_LE(std::ranges::count_if(chosen, [](std::size_t index) { return index < 60; }), 2);
    std::vector<View> kept;
    for (const std::size_t index : chosen)
        kept.push_back(views[index]);
    EXPECT_THAT(coverage_of(kept, brown_camera()).missing(), IsEmpty());
    EXPECT_EQ(select(views, brown_camera().size, brown_camera().lens, 1000).size(), views.size());
}

TEST(Collector, TakesStillSharpAndNewViews) {
    const TrueCamera camera = brown_camera();
    Collector collector(camera.size, Model::brown, 40);
    const View first = view_at({0.3, 0.3, 1.2, 0, 0, 0}, camera);
    EXPECT_EQ(collector.offer(std::nullopt, 0), Verdict::no_board);
    EXPECT_EQ(collector.offer(first, 2), Verdict::moving) << "nothing to compare with";
    EXPECT_EQ(collector.offer(first, 2), Verdict::taken);
    EXPECT_EQ(collector.offer(first, 2), Verdict::similar);
    const View moved = view_at({0.6, 0.6, 1.2, 0, 0, 0}, camera);
    EXPECT_EQ(collector.offer(moved, 2), Verdict::moving);
    EXPECT_EQ(collector.offer(moved, 9), Verdict::blurred);
    EXPECT_EQ(collector.offer(moved, 3), Verdict::taken);
    const View tilted = view_at({0.6, 0.6, 1.2, 20, 0, 0}, camera);
    collector.offer(tilted, 2);
    EXPECT_EQ(collector.offer(tilted, 2), Verdict::taken);
    EXPECT_EQ(collector.views().size(), 3u);
}

TEST(Collector, AdvisesUntilTheViewsAreComplete) {
    const TrueCamera camera = brown_camera();
    Collector collector(camera.size, Model::brown, 40);
    EXPECT_EQ(collector.advice(), "show the board to the camera");
    for (const View &view : views_at(good_poses(), camera, 0.1)) {
        EXPECT_FALSE(collector.is_complete());
        collector.offer(view, 2);
        collector.offer(view, 2);
        if (collector.is_complete())
            break;
        EXPECT_THAT(collector.advice(),
                    testing::AnyOf(StartsWith("move the board to the "), StartsWith("tilt the board more about its "),
                                   StartsWith("take ")));
    }
    EXPECT_TRUE(collector.is_complete());
    EXPECT_EQ(collector.advice(), "the views are complete");
}

TEST(Collector, SaysWhyItTakesNoView) {
    const TrueCamera camera = brown_camera();
    Collector collector(camera.size, Model::brown, 40);
    const auto after = [&](const std::function<void(int)> &frame) {
        for (int i = 0; i < 20; ++i)
            frame(i);
        return collector.advice();
    };
    const auto moving = [&](int i) { collector.offer(view_at({0.3 + 0.01 * i, 0.3, 1.3, 0, 0, 0}, camera), 2); };
    EXPECT_EQ(after(moving), "hold the board still");
    EXPECT_EQ(after([&](int) {
                  collector.offer(view_at({0.3, 0.3, 1.3, 0, 0, 0}, camera), 9);
              }),
              "the board is blurred; focus the camera, or use more light");
    EXPECT_EQ(after([&](int) {
                  collector.offer(view_at({0.3, 0.3, 1.3, 0, 0, 0}, camera), 2);
              }),
              "move the board to the top right of the image");
    EXPECT_EQ(after([&](int) { collector.offer(std::nullopt, 0); }),
              "the board is not visible; show it to the camera");
}

TEST(Collector, StopsAtItsLimit) {
    const TrueCamera camera = brown_camera();
    Collector collector(camera.size, Model::brown, 5);
    for (const View &view : views_at(good_poses(), camera)) {
        collector.offer(view, 2);
        collector.offer(view, 2);
    }
    EXPECT_TRUE(collector.is_full());
    EXPECT_EQ(collector.views().size(), 5u);
}

TEST(Board, IsFoundInLargeImages) {
    for (const BoardOptions &options :
         {BoardOptions{false, 9, 6, 36, 0, "", 0}, BoardOptions{true, 10, 7, 36, 27, "DICT_5X5_100", 0}}) {
        const cv::Mat image = Renderer(brown_camera(), options).image({0.45, 0.55, 1.2, 20, 10, 5});
        cv::Mat large;
        constexpr int factor = 5;
        cv::resize(image, large, {}, factor, factor, cv::INTER_CUBIC);
        const Board board(options);
        const auto view = board.find(image), large_view = board.find(large);
        ASSERT_TRUE(view && large_view);
        ASSERT_EQ(view->board_mm, large_view->board_mm);
        for (std::size_t i = 0; i < view->image_px.size(); ++i) {
            const cv::Point2f half(0.5F, 0.5F);
            EXPECT_LT(cv::norm((large_view->image_px[i] + half) / factor - half - view->image_px[i]), 0.15) << i;
        }
    }
}

TEST(Board, IsNotFoundInOtherImages) {
    cv::Mat noise(480, 640, CV_8U);
    cv::RNG(3).fill(noise, cv::RNG::UNIFORM, 0, 256);
    for (const cv::Mat &image :
         {noise, cv::Mat(cv::Mat::zeros(64, 64, CV_8U)), cv::Mat(cv::Mat::ones(65, 2000, CV_8U))})
        for (const BoardOptions &options :
             {BoardOptions{false, 9, 6, 36, 0, "", 0}, BoardOptions{true, 10, 7, 36, 27, "DICT_5X5_100", 0}}) {
            EXPECT_FALSE(Board(options).find(image));
            EXPECT_EQ(Board(options).seen_instead(image), "");
        }
}

TEST(Sharpness, IsTheWidthOfEdges) {
    const BoardOptions board{false, 9, 6, 36, 0, "", 0};
    Renderer renderer(brown_camera(), board);
    double before = 0;
    for (const double blur_px : {0.5, 1.0, 2.0, 3.0}) {
        const cv::Mat image = renderer.image(good_poses()[4], blur_px);
        const auto view = Board(board).find(image);
        ASSERT_TRUE(view);
        const double width_px = edge_width_px(image, *view);
        EXPECT_GT(width_px, before + 0.3);
        EXPECT_NEAR(width_px, std::sqrt(2 * std::numbers::pi * (blur_px * blur_px + 0.5)), 1) << blur_px;
        before = width_px;
    }
}
