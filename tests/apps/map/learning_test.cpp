// SPDX-License-Identifier: Apache-2.0
//
// Learns maps of simulated markers, whose true places are known.
#include "errors.hpp"
#include "map/learning.hpp"
#include "simulated_markers.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

namespace arhost::map {
namespace {

using pose::degrees_between;
using pose::pose_at;
using pose::radians;
using pose::Rigid;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// Turned about its own x, then y, then z axis.
Rigid at(double x_mm, double y_mm, double z_mm, double about_x = 0, double about_y = 0, double about_z = 0) {
    return {pose::rotation_by({0, 0, radians * about_z}) * pose::rotation_by({0, radians * about_y, 0}) *
                pose::rotation_by({radians * about_x, 0, 0}),
            {x_mm, y_mm, z_mm}};
}

class Scene {
public:
    Scene(std::vector<Marker> markers, const arhost_intrinsics &intrinsics, double noise_px)
        : markers(std::move(markers)), camera_(intrinsics), noise_px_(noise_px) {
        for (const Marker &marker : this->markers)
            settings.sides_mm[marker.id] = marker.side_mm;
    }

    // A frame with the markers of which the camera sees the front, or only with some of these.
    Frame &shoot(const Rigid &camera_from_map, const std::vector<int> &ids = {}) {
        Frame &frame = frames.emplace_back();
        frame.name = "frame " + std::to_string(frames.size() - 1);
        for (const Marker &marker : markers) {
            const Rigid pose = camera_from_map * marker.map_from_marker;
            const double towards = -pose.rotation.col(2).dot(pose.translation_mm.normalized());
            if (towards < 0.2 || (!ids.empty() && !std::ranges::count(ids, marker.id)))
                continue;
            const auto observed =
                camera_.observe(camera_from_map, pose::square_at(marker.map_from_marker, marker.side_mm), noise_px_);
            const auto &intrinsics = camera_.projection().intrinsics();
            if (std::ranges::all_of(observed.corners_px, [&](const Eigen::Vector2d &px) {
                    return px.x() > 5 && px.y() > 5 && px.x() < intrinsics.width - 6 &&
                           px.y() < intrinsics.height - 6;
                }))
                frame.detections.push_back({marker.id, observed.corners_px});
        }
        return frame;
    }
    // Frames from different directions, up to 45° from the z axis of the map.
    void shoot_around(int count, double distance_mm, const Eigen::Vector3d &centre_mm,
                      const std::vector<int> &ids = {}) {
        for (int i = 0; i < count; ++i)
            shoot(
                pose_at({camera_.between(-30, 30), camera_.between(-30, 30), distance_mm * camera_.between(0.8, 1.2)},
                        camera_.between(5, 45), camera_.between(0, 360), camera_.between(-60, 60)) *
                    Rigid{Eigen::Matrix3d::Identity(), -centre_mm},
                ids);
    }

    Map learn() const { return map::learn(frames, camera_.projection().intrinsics(), settings); }

    // The true pose of a marker relative to that which fixes the frame.
    Rigid truth(const Map &map, int id) const { return marker(map.origin).inverse() * marker(id); }
    const Rigid &marker(int id) const { return std::ranges::find(markers, id, &Marker::id)->map_from_marker; }

    std::vector<Marker> markers;
    Settings settings;
    std::vector<Frame> frames;

private:
    pose::Camera camera_;
    double noise_px_;
};

std::vector<int> ids_of(const std::vector<LearnedMarker> &markers) {
    std::vector<int> ids;
    for (const LearnedMarker &marker : markers)
        ids.push_back(marker.id);
    return ids;
}

const LearnedMarker &find(const Map &map, int id) {
    const auto found = std::ranges::find(map.markers, id, &LearnedMarker::id);
    if (found == map.markers.end())
        throw std::runtime_error("marker " + std::to_string(id) + " is not in the map");
    return *found;
}

void expect_true_places(const Scene &scene, const Map &map, double tolerance_mm, double tolerance_degrees) {
    for (const LearnedMarker &marker : map.markers) {
        const Rigid truth = scene.truth(map, marker.id);
        EXPECT_LE((marker.map_from_marker.translation_mm - truth.translation_mm).norm(), tolerance_mm) << marker.id;
        EXPECT_LE(degrees_between(marker.map_from_marker, truth), tolerance_degrees) << marker.id;
    }
}

// A desk: six markers on it, two on its back wall, and one on a box.
std::vector<Marker> desk() {
    return {{3, 60, at(0, 0, 0)},         {4, 60, at(150, 10, 0, 0, 0, 30)}, {5, 60, at(300, -5, 0, 0, 0, -80)},
            {6, 60, at(0, -150, 0)},      {7, 40, at(140, -140, 0)},         {8, 60, at(310, -160, 0, 0, 0, 170)},
            {9, 80, at(60, 120, 80, 60)}, {10, 80, at(240, 120, 80, 60)},    {20, 50, at(150, -60, 40, 10, -25, 5)}};
}

class LearningWithLens : public testing::TestWithParam<pose::LensCase> {};
INSTANTIATE_TEST_SUITE_P(Every, LearningWithLens, testing::ValuesIn(pose::lenses), pose::name_of);

TEST_P(LearningWithLens, FindsTheMarkersOfADesk) {
    constexpr double noise_px = 0.1;
    Scene scene(desk(), GetParam().intrinsics, noise_px);
    scene.shoot_around(20, 700, {150, -50, 20});
    const Map map = scene.learn();
    EXPECT_EQ(map.origin, 3);
    EXPECT_THAT(ids_of(map.markers), ElementsAre(3, 4, 5, 6, 7, 8, 9, 10, 20));
    EXPECT_THAT(map.refused, IsEmpty());
    EXPECT_THAT(map.misfits, IsEmpty());
    EXPECT_EQ(map.frames, 20u);
    EXPECT_NEAR(map.rms_px, noise_px * std::sqrt(2), 0.02);
    expect_true_places(scene, map, 0.6, 0.2);
    for (const LearnedMarker &marker : map.markers) {
        EXPECT_FALSE(marker.is_ambiguous) << marker.id;
        EXPECT_EQ(marker.misfits, 0u) << marker.id;
        if (marker.id == map.origin)
            continue;
        const Rigid truth = scene.truth(map, marker.id);
        EXPECT_LE((marker.map_from_marker.translation_mm - truth.translation_mm).norm(), 4 * marker.position_sigma_mm)
            << marker.id;
        EXPECT_LE(degrees_between(marker.map_from_marker, truth) * radians, 4 * marker.rotation_sigma_rad)
            << marker.id;
        EXPECT_LE(marker.position_sigma_mm, 0.5) << marker.id;
    }
}

TEST(Learning, IsExactWithoutNoise) {
    Scene scene(desk(), pose::lenses[1].intrinsics, 0);
    scene.shoot_around(10, 700, {150, -50, 20});
    const Map map = scene.learn();
    EXPECT_EQ(map.markers.size(), 9u);
    expect_true_places(scene, map, 1e-3, 1e-4);
    EXPECT_LE(map.rms_px, 1e-4);
}

TEST(Learning, SaysHowPreciseItIs) {
    // The errors in units of the reported standard deviations, over several scenes.
    double squares = 0;
    int count = 0;
    for (int run = 0; run < 6; ++run) {
        Scene scene(desk(), pose::lenses[0].intrinsics, 0.2);
        for (int skipped = 0; skipped <= run; ++skipped) { // other random numbers
            scene.frames.clear();
            scene.shoot_around(12, 700, {150, -50, 20});
        }
        const Map map = scene.learn();
        for (const LearnedMarker &marker : map.markers)
            if (marker.id != map.origin) {
                const Eigen::Vector3d error =
                    marker.map_from_marker.translation_mm - scene.truth(map, marker.id).translation_mm;
                squares += error.squaredNorm() / (marker.position_sigma_mm * marker.position_sigma_mm);
                ++count;
            }
    }
    // One direction dominates, so the mean is between 1 and 3.
    EXPECT_GE(squares / count, 0.5);
    EXPECT_LE(squares / count, 3);
}

TEST(Learning, ResolvesTiltsThatAreAmbiguousInEachFrame) {
    const std::vector<Marker> pair{{0, 30, at(0, 0, 0)}, {1, 30, at(60, 0, 5, 0, 30)}};
    Scene scene(pair, pose::lenses[0].intrinsics, 0.3);
    scene.shoot_around(30, 1000, {30, 0, 0});
    int flipped = 0; // single frames whose better solution is the wrong one
    const pose::Projection projection(pose::lenses[0].intrinsics);
    for (const Frame &frame : scene.frames)
        for (const Detection &detection : frame.detections) {
            const pose::ObservedMarker observed{pose::square_corners_mm(30), detection.corners_px, 0.3};
            const auto poses = estimate_poses(std::span(&observed, 1), projection);
            flipped += poses.size() == 2 && poses[1].normalized_error < 4 * poses[0].normalized_error;
        }
    EXPECT_GE(flipped, 10) << "the scene must be difficult";
    const Map map = scene.learn();
    ASSERT_EQ(map.markers.size(), 2u);
    expect_true_places(scene, map, 3, 5);
    EXPECT_FALSE(find(map, 1).is_ambiguous);
}

TEST(Learning, ReportsATiltThatTheImagesLeaveOpen) {
    const std::vector<Marker> pair{{0, 100, at(0, 0, 0)}, {1, 10, at(80, 0, 5, 0, 20)}};
    Scene scene(pair, pose::lenses[0].intrinsics, 0.3);
    for (int i = 0; i < 5; ++i)
        scene.shoot(pose_at({0, 0, 1000}, -30, 90));
    EXPECT_TRUE(find(scene.learn(), 1).is_ambiguous);
}

TEST(Learning, FollowsAChainOfMarkers) {
    std::vector<Marker> wall;
    for (int id = 0; id < 12; ++id)
        wall.push_back({id, 100, at(250 * id, 20 * (id % 3), 0, 0, 0, 15 * id)});
    Scene scene(wall, pose::lenses[4].intrinsics, 0.1);
    for (int id = 0; id + 1 < 12; ++id)
        scene.shoot_around(6, 800, {250.0 * id + 125, 0, 0}, {id, id + 1});
    const Map map = scene.learn();
    ASSERT_EQ(map.markers.size(), 12u);
    for (const LearnedMarker &marker : map.markers)
        if (marker.id != map.origin) {
            EXPECT_LE((marker.map_from_marker.translation_mm - scene.truth(map, marker.id).translation_mm).norm(),
                      4 * marker.position_sigma_mm)
                << marker.id;
        }
    EXPECT_GT(find(map, 11).position_sigma_mm, 3 * find(map, 1).position_sigma_mm) << "errors add up";
}

TEST(Learning, RefusesMarkersThatAreNotConnected) {
    Scene scene(desk(), pose::lenses[0].intrinsics, 0.1);
    scene.shoot_around(8, 700, {150, -50, 20}, {3, 4, 5, 6, 8});
    scene.shoot_around(5, 700, {150, -50, 20}, {9, 10});
    scene.shoot_around(2, 700, {150, -50, 20}, {3, 7});
    scene.shoot_around(4, 700, {150, -50, 20}, {7});
    scene.shoot_around(2, 700, {150, -50, 20}, {4, 20});
    const Map map = scene.learn();
    EXPECT_THAT(ids_of(map.markers), ElementsAre(3, 4, 5, 6, 8));
    ASSERT_EQ(map.refused.size(), 4u);
    EXPECT_EQ(map.refused[0].id, 7);
    EXPECT_THAT(map.refused[0].reason, HasSubstr("was seen together with the other markers in only 2 frames"));
    EXPECT_EQ(map.refused[1].id, 9);
    EXPECT_THAT(map.refused[1].reason, HasSubstr("was never seen together with the other markers"));
    EXPECT_EQ(map.refused[2].id, 10);
    EXPECT_EQ(map.refused[3].id, 20);
    EXPECT_THAT(map.refused[3].reason, HasSubstr("was seen in only 2 frames; at least 3 are needed"));
    scene.settings.origin = 9;
    EXPECT_THAT(ids_of(scene.learn().markers), ElementsAre(9, 10)) << "the group of the origin";
    scene.settings.origin = 20;
    EXPECT_THAT(test::error_of<std::runtime_error>([&] { scene.learn(); }),
                HasSubstr("marker 20 cannot be the origin"));
}

TEST(Learning, NeedsTwoMarkersInAFrame) {
    Scene scene(desk(), pose::lenses[0].intrinsics, 0.1);
    EXPECT_THAT(scene.learn().markers, IsEmpty());
    scene.shoot_around(8, 700, {150, -50, 20}, {3});
    scene.shoot_around(8, 700, {150, -50, 20}, {4});
    const Map map = scene.learn();
    EXPECT_THAT(map.markers, IsEmpty());
    EXPECT_EQ(map.refused.size(), 2u);
}

TEST(Learning, IgnoresAFrameOfAnotherScene) {
    Scene scene(desk(), pose::lenses[0].intrinsics, 0.1);
    scene.shoot_around(12, 700, {150, -50, 20});
    Frame &wrong = scene.frames[5];
    for (std::size_t i = 0; i + 1 < wrong.detections.size(); i += 2)
        std::swap(wrong.detections[i].id, wrong.detections[i + 1].id);
    const Map map = scene.learn();
    EXPECT_EQ(map.markers.size(), 9u);
    EXPECT_THAT(map.misfits, ElementsAre("frame 5"));
    expect_true_places(scene, map, 0.8, 0.4);
}

TEST(Learning, IgnoresCornersThatAreWrong) {
    Scene scene(desk(), pose::lenses[0].intrinsics, 0.1);
    scene.shoot_around(15, 700, {150, -50, 20});
    for (std::size_t k = 0; k < scene.frames.size(); k += 3)
        scene.frames[k].detections[k % 4].corners_px[k % 4] += Eigen::Vector2d(6, -4);
    const Map map = scene.learn();
    EXPECT_EQ(map.markers.size(), 9u);
    EXPECT_NEAR(map.rms_px, 0.1 * std::sqrt(2), 0.02);
    expect_true_places(scene, map, 0.8, 0.25);
}

TEST(Learning, ReportsAMarkerThatWasMoved) {
    Scene scene(desk(), pose::lenses[0].intrinsics, 0.1);
    scene.shoot_around(12, 700, {150, -50, 20});
    const Scene before = scene;
    scene.markers[4].map_from_marker = at(200, -90, 0, 0, 0, 40);
    scene.shoot_around(6, 700, {150, -50, 20});
    const Map map = scene.learn();
    EXPECT_EQ(map.markers.size(), 9u);
    for (const LearnedMarker &marker : map.markers)
        if (marker.id == 7) {
            EXPECT_GE(marker.misfits, 5u);
            EXPECT_LE(marker.misfits, 6u);
        } else {
            EXPECT_EQ(marker.misfits, 0u) << marker.id;
        }
    expect_true_places(before, map, 0.8, 0.25);
}

TEST(Learning, RefusesAMarkerThatIsElsewhereInEachFrame) {
    Scene scene(desk(), pose::lenses[0].intrinsics, 0.1);
    for (int k = 0; k < 10; ++k) {
        scene.markers[4].map_from_marker = at(20.0 * k, -75 + 9 * (k % 4), 0, 0, 0, 20 * k);
        scene.shoot_around(1, 700, {150, -50, 20});
    }
    const Map map = scene.learn();
    EXPECT_EQ(map.markers.size(), 8u);
    ASSERT_EQ(map.refused.size(), 1u);
    EXPECT_EQ(map.refused[0].id, 7);
    EXPECT_THAT(map.refused[0].reason, HasSubstr("fits to the other markers in only "));
}

TEST(Learning, UsesTheFrameOfTheOrigin) {
    Scene scene(desk(), pose::lenses[0].intrinsics, 0.1);
    scene.shoot_around(12, 700, {150, -50, 20});
    scene.settings.origin = 9;
    const Map map = scene.learn();
    EXPECT_EQ(map.origin, 9);
    EXPECT_LE(find(map, 9).map_from_marker.translation_mm.norm(), 1e-9);
    expect_true_places(scene, map, 0.8, 0.25);
}

TEST(Learning, BeginsWithALayoutAndKeepsItsFrame) {
    Scene scene(desk(), pose::lenses[0].intrinsics, 0.1);
    scene.shoot_around(12, 700, {150, -50, 20});
    const Rigid layout_from_desk = at(1000, 500, -20, 5, 10, 15);
    for (const Marker &marker : scene.markers)
        if (marker.id <= 8) {
            Marker given = marker;
            given.map_from_marker = layout_from_desk * marker.map_from_marker;
            if (marker.id > 3) // only roughly known
                given.map_from_marker.translation_mm += Eigen::Vector3d(4, -3, 2);
            scene.settings.layout.push_back(given);
        }
    const Map map = scene.learn();
    EXPECT_EQ(map.markers.size(), 9u);
    for (const LearnedMarker &marker : map.markers) {
        const Rigid truth = layout_from_desk * scene.marker(marker.id);
        EXPECT_LE((marker.map_from_marker.translation_mm - truth.translation_mm).norm(), 0.8) << marker.id;
        EXPECT_LE(degrees_between(marker.map_from_marker, truth), 0.25) << marker.id;
    }
}

TEST(Learning, TurnsTheFrameIntoThePlaneOfTheMarkers) {
    std::vector<Marker> plane;
    for (int id = 0; id < 6; ++id)
        plane.push_back({id, 60, at(150 * (id % 3), 150 * (id / 3), 0)});
    plane[0].map_from_marker = at(0, 0, 0, 3, -2, 0); // its paper is uneven
    Scene scene(plane, pose::lenses[0].intrinsics, 0.1);
    scene.shoot_around(12, 700, {150, 50, 0});
    scene.settings.is_plane = true;
    const Map map = scene.learn();
    ASSERT_EQ(map.markers.size(), 6u);
    for (const LearnedMarker &marker : map.markers) {
        EXPECT_NEAR(marker.map_from_marker.translation_mm.z(), 0, 1) << marker.id;
        EXPECT_LE(pose::angle_between_rad(marker.map_from_marker.rotation, Eigen::Matrix3d::Identity()),
                  (marker.id == 0 ? 4 : 0.5) * radians)
            << marker.id;
    }
    EXPECT_LE(find(map, 0).map_from_marker.translation_mm.head<2>().norm(), 1e-6);
}

TEST(Learning, CanBeStopped) {
    Scene scene(desk(), pose::lenses[0].intrinsics, 0.1);
    scene.shoot_around(12, 700, {150, -50, 20});
    for (const int last : {0, 1, 5, 20}) {
        int calls = 0;
        scene.settings.progress = [&](const std::string &) {
            if (calls++ == last)
                throw std::invalid_argument("stop");
        };
        EXPECT_THROW(scene.learn(), std::invalid_argument);
    }
}

} // namespace
} // namespace arhost::map
