// SPDX-License-Identifier: Apache-2.0
#include "camera/mapping.hpp"

#include "camera/lens_model.hpp"
#include "plugin_under_test.hpp"

#include <glm/geometric.hpp>
#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>

#include <cmath>
#include <fstream>
#include <limits>
#include <numbers>
#include <random>
#include <sstream>

namespace arhost::camera {
namespace {

const Coordinates z_up{};
const Coordinates y_up{1, 2, {{90, {1, 0, 0}}}};

struct Pose {
    double mt[16]; // column-major
};

Pose pose(const cv::Matx33d &rotation, const cv::Vec3d &translation_mm) {
    Pose pose{};
    for (int column = 0; column < 3; ++column)
        for (int row = 0; row < 3; ++row)
            pose.mt[4 * column + row] = rotation(row, column);
    for (int row = 0; row < 3; ++row)
        pose.mt[12 + row] = translation_mm[row];
    pose.mt[15] = 1;
    return pose;
}

// The marker is on the optical axis and faces the camera.
Pose facing(double distance_mm) {
    return pose(cv::Matx33d::eye(), {0, 0, -distance_mm});
}

Pose random_pose(std::mt19937 &random) {
    std::uniform_real_distribution<double> angle(-2, 2), mm(-2000, 2000);
    cv::Matx33d rotation;
    cv::Rodrigues(cv::Vec3d(angle(random), angle(random), angle(random)), rotation);
    return pose(rotation, {mm(random), mm(random), mm(random)});
}

void expect_near(const double (&actual)[3], const glm::dvec3 &expected, double tolerance) {
    for (int i = 0; i < 3; ++i)
        EXPECT_NEAR(actual[i], expected[i], tolerance) << "component " << i;
}

} // namespace

TEST(CameraFromMarker, IsInFrontOfAMarkerThatFacesIt) {
    const auto camera = camera_from_marker(facing(500).mt, z_up, {});
    ASSERT_TRUE(camera);
    expect_near(camera->eye, {0, 0, 500}, 0);
    expect_near(camera->look_at, {0, 0, 499}, 0);
    expect_near(camera->up, {0, 1, 0}, 0);
    EXPECT_EQ(camera->struct_size, sizeof(arhost_camera));
}

TEST(CameraFromMarker, IsAboveTheMarkerInAYUpWorld) {
    const auto camera = camera_from_marker(facing(500).mt, y_up, {});
    ASSERT_TRUE(camera);
    expect_near(camera->eye, {0, 500, 0}, 0);
    expect_near(camera->look_at, {0, 499, 0}, 0);
    expect_near(camera->up, {0, 0, -1}, 0);
}

// The camera is 400 mm above and 300 mm in front of the marker and looks at it: w = (0, -0.6, 0.8),
// v = (0, 0.8, 0.6); the rows of the rotation are u, v, w, and t = −R·eye = (0, 0, −500).
TEST(CameraFromMarker, MatchesAHandComputedPose) {
    const cv::Matx33d rotation(1, 0, 0, 0, 0.8, 0.6, 0, -0.6, 0.8);
    const auto marker = pose(rotation, {0, 0, -500});
    const auto flat = camera_from_marker(marker.mt, z_up, {});
    ASSERT_TRUE(flat);
    expect_near(flat->eye, {0, -300, 400}, 1e-12);
    expect_near(flat->look_at, {0, -299.4, 399.2}, 1e-12);
    expect_near(flat->up, {0, 0.8, 0.6}, 1e-15);
    const auto upright = camera_from_marker(marker.mt, y_up, {});
    ASSERT_TRUE(upright);
    expect_near(upright->eye, {0, 400, 300}, 1e-12);
    expect_near(upright->look_at, {0, 399.2, 299.4}, 1e-12);
    expect_near(upright->up, {0, 0.6, -0.8}, 1e-15);
}

// Compares with equations 3.2 to 3.5 of the dissertation computed with OpenCV, for one and for two rotations.
TEST(CameraFromMarker, MatchesAnIndependentInverseForRandomPoses) {
    std::mt19937 random(2);
    std::uniform_real_distribution<double> angle(-360, 360), component(-1, 1);
    for (int i = 0; i < 2000; ++i) {
        const Pose marker = random_pose(random);
        Coordinates coordinates{1, 3, {}};
        cv::Matx44d product = cv::Matx44d(marker.mt).t(); // transposed because Matx is row-major
        for (int k = 0; k <= i % 2; ++k) {
            const cv::Vec3d axis(component(random), component(random), component(random));
            const double degrees = angle(random);
            coordinates.rotations.push_back({degrees, {axis[0], axis[1], axis[2]}});
            cv::Matx33d turn;
            cv::Rodrigues(axis / cv::norm(axis) * (degrees * std::numbers::pi / 180), turn);
            cv::Matx44d turn4 = cv::Matx44d::eye();
            for (int row = 0; row < 3; ++row)
                for (int column = 0; column < 3; ++column)
                    turn4(row, column) = turn(row, column);
            product = product * turn4;
        }
        const cv::Matx44d cp = product.inv(cv::DECOMP_LU);
        const auto camera = camera_from_marker(marker.mt, coordinates, {});
        ASSERT_TRUE(camera);
        expect_near(camera->eye, {cp(0, 3), cp(1, 3), cp(2, 3)}, 1e-9);
        expect_near(camera->look_at, {cp(0, 3) - cp(0, 2), cp(1, 3) - cp(1, 2), cp(2, 3) - cp(2, 2)}, 1e-9);
        expect_near(camera->up, {cp(0, 1), cp(1, 1), cp(2, 1)}, 1e-12);
        EXPECT_NEAR(glm::distance(glm::dvec3(camera->eye[0], camera->eye[1], camera->eye[2]),
                                  glm::dvec3(camera->look_at[0], camera->look_at[1], camera->look_at[2])),
                    1, 1e-9);
    }
}

// MT maps marker points to eye space (OpenGL: y up, looking along −z).
TEST(CameraFromMarker, SeesMarkerPointsWhereMtMapsThem) {
    std::mt19937 random(3);
    for (int i = 0; i < 500; ++i) {
        const Pose marker = random_pose(random);
        const auto camera = camera_from_marker(marker.mt, y_up, {});
        ASSERT_TRUE(camera);
        const glm::dvec3 on_marker(random() % 100, random() % 100, random() % 100);
        const cv::Vec4d eye_space = cv::Matx44d(marker.mt).t() * cv::Vec4d(on_marker.x, on_marker.y, on_marker.z, 1);
        const glm::dvec3 seen =
            in_camera(*camera, {on_marker.x, on_marker.z, -on_marker.y}); // converted to y-up world axes
        EXPECT_NEAR(seen.x, eye_space[0], 1e-9);
        EXPECT_NEAR(seen.y, -eye_space[1], 1e-9);
        EXPECT_NEAR(seen.z, -eye_space[2], 1e-9);
    }
}

TEST(CameraFromMarker, KeepsTheIntrinsics) {
    arhost_intrinsics intrinsics{};
    intrinsics.struct_size = sizeof intrinsics;
    intrinsics.width = 640;
    intrinsics.cx = 319.5;
    const auto camera = camera_from_marker(facing(1).mt, z_up, intrinsics);
    ASSERT_TRUE(camera);
    EXPECT_EQ(camera->intrinsics.width, 640u);
    EXPECT_EQ(camera->intrinsics.cx, 319.5);
    EXPECT_EQ(camera->intrinsics.struct_size, sizeof intrinsics);
}

// The recorded cameras are rounded to six digits, so look_at − eye is accurate only to about 1e-3.
TEST(CameraFromMarker, ReproducesTheCamerasOfRecordedTrajectories) {
    ARHOST_REQUIRE_SHARED_DATA("seed-samples/camPose.txt");
    for (const char *name : {"seed-samples/camPose.txt", "seed-samples/camPoseDragon.txt"}) {
        std::ifstream file(test::shared_data(name));
        std::size_t records = 0;
        for (std::string line; std::getline(file, line);) {
            std::istringstream numbers(line);
            glm::dvec3 eye, look_at, up;
            if (!(numbers >> eye.x >> eye.y >> eye.z >> look_at.x >> look_at.y >> look_at.z >> up.x >> up.y >> up.z))
                continue; // skips the truncated last line
            const glm::dvec3 w = glm::normalize(eye - look_at), u = glm::normalize(glm::cross(up, w));
            const glm::dvec3 v = glm::cross(w, u);
            const cv::Matx33d rotation(u.x, u.y, u.z, v.x, v.y, v.z, w.x, w.y, w.z);
            const auto marker = pose(rotation, rotation * cv::Vec3d(-eye.x, -eye.y, -eye.z));
            const auto camera = camera_from_marker(marker.mt, z_up, {});
            ASSERT_TRUE(camera) << line;
            expect_near(camera->eye, eye, 1e-9);
            expect_near(camera->look_at, look_at, 3e-3);
            expect_near(camera->up, up, 3e-3);
            ++records;
        }
        EXPECT_GT(records, 100u) << name;
    }
}

TEST(CameraFromMarker, RejectsInvalidPoses) {
    const auto expect_rejected = [](const char *why, auto change) {
        Pose broken = facing(500);
        change(broken.mt);
        EXPECT_STREQ(problem_with(broken.mt), why);
        EXPECT_FALSE(camera_from_marker(broken.mt, z_up, {})) << why;
    };
    const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
    EXPECT_EQ(problem_with(facing(500).mt), nullptr);
    for (int i = 0; i < 16; ++i) {
        expect_rejected("the pose is not finite", [&](double *mt) { mt[i] = nan; });
        expect_rejected("the pose is not finite", [&](double *mt) { mt[i] = -inf; });
    }
    for (const int i : {3, 7, 11, 15})
        expect_rejected("the pose's last row is not 0 0 0 1", [&](double *mt) { mt[i] += 1e-12; });
    expect_rejected("the pose's rotation is not orthonormal", [](double *mt) { mt[0] = 1 + 1e-6; });
    expect_rejected("the pose's rotation is not orthonormal", [](double *mt) { mt[1] = 2e-6; });
    expect_rejected("the pose's rotation is not orthonormal", [](double *mt) { mt[0] = 1e200; });
    expect_rejected("the pose's rotation is not orthonormal", [](double *mt) { mt[0] = mt[5] = mt[10] = 0; });
    expect_rejected("the pose's rotation is left-handed", [](double *mt) { mt[10] = -1; });
    expect_rejected("the pose is more than 1000 km from the camera", [](double *mt) { mt[14] = -1.1e9; });
}

TEST(CameraFromMarker, AcceptsARotationThatIsOrthonormalTo1e6) {
    Pose nearly = facing(500);
    nearly.mt[1] = 9e-7;
    EXPECT_TRUE(camera_from_marker(nearly.mt, z_up, {}));
}

} // namespace arhost::camera
