// SPDX-License-Identifier: Apache-2.0
#include "camera/coordinates.hpp"

#include "errors.hpp"

#include <glm/matrix.hpp>
#include <glm/vec4.hpp>
#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

namespace arhost::camera {
namespace {

glm::dvec3 to_scene(const Coordinates &coordinates, const glm::dvec3 &marker_point) {
    return glm::dvec3(glm::inverse(rotation_of(coordinates)) * glm::dvec4(marker_point, 1));
}

Coordinates parsed(const std::string &text) {
    return parse_coordinates(yaml::Node::parse(text, "lab.yaml"));
}

// Returns the error message without the name of the file.
std::string error_in(const std::string &text) {
    return test::after("lab.yaml:", test::error_of([&] { parsed(text); }));
}

} // namespace

// The example of the dissertation: -ar 1 -rt 2 -g 90 -x 1 -y 0 -z 0.
TEST(Coordinates, DissertationsExampleMapsXyzToXzMinusY) {
    const Coordinates coordinates{1, 2, {{90, {1, 0, 0}}}};
    EXPECT_EQ(to_scene(coordinates, {1, 2, 3}), glm::dvec3(1, 3, -2));
}

TEST(Coordinates, EqualProfilesDoNotRotate) {
    EXPECT_EQ(rotation_of({1, 1, {}}), glm::dmat4(1));
    EXPECT_EQ(rotation_of({3, 3, {}}), glm::dmat4(1));
}

TEST(Coordinates, MultiplyTheFirstRotationByTheSecond) {
    // R1 maps y to z, and R2 maps x to y. Therefore R1·R2 maps x to z.
    const glm::dmat4 product = rotation_of({1, 3, {{90, {1, 0, 0}}, {90, {0, 0, 1}}}});
    EXPECT_EQ(glm::dvec3(product[0]), glm::dvec3(0, 0, 1));
    EXPECT_EQ(glm::dvec3(product[1]), glm::dvec3(-1, 0, 0));
    EXPECT_EQ(glm::dvec3(product[2]), glm::dvec3(0, -1, 0));
}

TEST(Coordinates, AreExactForMultiplesOf90Degrees) {
    EXPECT_EQ(to_scene({1, 2, {{180, {1, 0, 0}}}}, {1, 2, 3}), glm::dvec3(1, -2, -3));
    EXPECT_EQ(to_scene({1, 2, {{-90, {1, 0, 0}}}}, {1, 2, 3}), glm::dvec3(1, -3, 2));
    EXPECT_EQ(to_scene({1, 2, {{450, {1, 0, 0}}}}, {1, 2, 3}), glm::dvec3(1, 3, -2));
    EXPECT_EQ(to_scene({1, 2, {{360, {0, 1, 0}}}}, {1, 2, 3}), glm::dvec3(1, 2, 3));
}

TEST(Coordinates, RotateByAnyAngleAboutAnyAxis) {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> angle(-720, 720), component(-5, 5);
    for (int i = 0; i < 1000; ++i) {
        const cv::Vec3d axis(component(random), component(random), component(random));
        const double degrees = angle(random);
        cv::Matx33d expected;
        cv::Rodrigues(axis / cv::norm(axis) * (degrees * std::numbers::pi / 180), expected);
        const glm::dmat4 rotation = rotation_of({1, 2, {{degrees, {axis[0], axis[1], axis[2]}}}});
        for (int row = 0; row < 3; ++row)
            for (int column = 0; column < 3; ++column)
                ASSERT_NEAR(rotation[column][row], expected(row, column), 1e-12);
    }
}

TEST(Coordinates, AcceptAxesOfAnyLength) {
    for (const double length : {1e-300, 1.0, 1e300})
        EXPECT_EQ(to_scene({1, 2, {{90, {length, 0, 0}}}}, {1, 2, 3}), glm::dvec3(1, 3, -2)) << length;
}

TEST(Coordinates, FollowTheScenesAxes) {
    EXPECT_EQ(rotation_of(default_for(ARHOST_AXES_Z_UP)), glm::dmat4(1));
    EXPECT_EQ(to_scene(default_for(ARHOST_AXES_Y_UP), {1, 2, 3}), glm::dvec3(1, 3, -2));
    EXPECT_EQ(problem_with(default_for(ARHOST_AXES_Z_UP)), "");
    EXPECT_EQ(problem_with(default_for(ARHOST_AXES_Y_UP)), "");
}

TEST(Coordinates, ExplainsInvalidCoordinates) {
    const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
    const std::pair<Coordinates, const char *> cases[] = {
        {{1, 2, {{90, {0, 0, 0}}}}, "rotation 1: the axis must not be (0, 0, 0); for the x axis, write [1, 0, 0]"},
        {{1, 2, {{90, {1, 0, 0}}, {nan, {1, 0, 0}}}}, "rotation 2: the angle must be a finite number of degrees"},
        {{1, 2, {{inf, {1, 0, 0}}}}, "rotation 1: the angle must be a finite number of degrees"},
        {{1, 2, {{90, {1, nan, 0}}}}, "rotation 1: the axis must be three finite numbers"},
        {{1, 2, {}},
         "the profiles ar 1 and rt 2 differ, so a rotation is needed; from 1 to 2 it is 90 degrees about [1, 0, 0]"},
        {{2, 2, {{90, {1, 0, 0}}}},
         "the profiles ar and rt are both 2, so the rotations would have no effect; remove them, or set rt to the "
         "ray tracer's profile"},
        {{1, 2, {{1, {1, 0, 0}}, {2, {1, 0, 0}}, {3, {1, 0, 0}}}}, "at most two rotations are allowed, not 3"},
        {{1, 4, {{90, {1, 0, 0}}}},
         "the profiles ar and rt must be 1 (x right, y back, z up), 2 (x right, y up, z front) or 3 (other); they "
         "are 1 and 4"},
    };
    for (const auto &[coordinates, problem] : cases)
        EXPECT_EQ(problem_with(coordinates), problem);
}

TEST(Coordinates, AreParsedFromYaml) {
    const Coordinates coordinates =
        parsed("ar: 1\nrt: 3\nrotations: [{degrees: 90, axis: [1, 0, 0]}, {degrees: -12.5, axis: [0, 2, 0]}]\n");
    EXPECT_EQ(coordinates.ar, 1);
    EXPECT_EQ(coordinates.rt, 3);
    ASSERT_EQ(coordinates.rotations.size(), 2u);
    EXPECT_EQ(coordinates.rotations[0].degrees, 90);
    EXPECT_EQ(coordinates.rotations[0].axis, glm::dvec3(1, 0, 0));
    EXPECT_EQ(coordinates.rotations[1].degrees, -12.5);
    EXPECT_EQ(coordinates.rotations[1].axis, glm::dvec3(0, 2, 0));
    EXPECT_TRUE(parsed("{ar: 2, rt: 2}").rotations.empty());
}

TEST(Coordinates, ErrorsInYamlNameTheLine) {
    EXPECT_EQ(error_in("ar: 1\nrt: 2\nrotations:\n  - {degrees: 90, axis: [0, 0, 0]}\n"),
              "4:25: rotations[0].axis: the axis must not be (0, 0, 0); for the x axis, write [1, 0, 0]");
    EXPECT_EQ(error_in("ar: 1\nrt: 2\nrotations:\n  - {degrees: .nan, axis: [1, 0, 0]}\n"),
              "4:15: rotations[0].degrees: must be a finite number, but is .nan");
    EXPECT_EQ(error_in("ar: 1\nrt: 2\nrotations:\n  - {degrees: 90, axis: [1, 0]}\n"),
              "4:25: rotations[0].axis: must be a list of 3 numbers, but has 2");
    EXPECT_EQ(error_in("ar: 1\nrt: 4\n"), "2:5: rt: must be 1 to 3, but is 4");
    EXPECT_EQ(error_in("ar: 1\n"), "1:1: the key 'rt' is missing");
    EXPECT_EQ(error_in("ar: 1\nrt: 2\n"), "1:1: the profiles ar 1 and rt 2 differ, so a rotation is needed; from 1 "
                                          "to 2 it is 90 degrees about [1, 0, 0]");
    EXPECT_EQ(error_in("ar: 1\nrt: 2\nrotation: []\n"), "3:1: rotation: unknown key; did you mean 'rotations'?");
}

} // namespace arhost::camera
