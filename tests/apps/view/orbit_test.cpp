// SPDX-License-Identifier: Apache-2.0
#include "view/orbit.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

using namespace arhost;
using view::Lens;
using view::Orbit;

namespace {

const glm::dvec3 y_up(0, 1, 0), z_up(0, 0, 1);

glm::dvec3 vector_of(const double (&v)[3]) {
    return {v[0], v[1], v[2]};
}

// Projects a point as arhost/camera.h defines it.
glm::dvec2 pixel_of(const arhost_camera &camera, const glm::dvec3 &point) {
    const glm::dvec3 eye = vector_of(camera.eye), back = glm::normalize(eye - vector_of(camera.look_at)),
                     right = glm::normalize(glm::cross(vector_of(camera.up), back)), up = glm::cross(back, right);
    const double depth = -glm::dot(point - eye, back);
    return {camera.intrinsics.cx + camera.intrinsics.fx * glm::dot(point - eye, right) / depth,
            camera.intrinsics.cy - camera.intrinsics.fy * glm::dot(point - eye, up) / depth};
}

// The largest distance of a corner of the box from the centre of the picture, relative to its edge.
double extent_of(const Orbit &orbit, const Lens &lens, const scene::Box &box) {
    double extent = 0;
    for (int i = 0; i < 8; ++i) {
        const glm::dvec3 corner(i & 1 ? box.max.x : box.min.x, i & 2 ? box.max.y : box.min.y,
                                i & 4 ? box.max.z : box.min.z);
        const glm::dvec2 pixel = pixel_of(orbit.camera(lens), corner);
        extent = std::max({extent, std::abs(2 * (pixel.x + 0.5) / lens.width - 1),
                           std::abs(2 * (pixel.y + 0.5) / lens.height - 1)});
    }
    return extent;
}

void expect_near(const glm::dvec3 &a, const glm::dvec3 &b) {
    EXPECT_LT(glm::length(a - b), 1e-9 * (1 + glm::length(b))) << a.x << " " << a.y << " " << a.z;
}

} // namespace

TEST(Orbit, ABoxOfAnySizeFillsThePicture) {
    for (const float size : {1e-6f, 1.0f, 1e6f})
        for (const Lens &lens : {Lens{45, 800, 600}, Lens{20, 300, 900}}) {
            const scene::Box box{glm::vec3(0.5f, 0, -2) * size, glm::vec3(2, 1, 3) * size};
            const double extent = extent_of(Orbit(box, y_up, lens), lens, box);
            EXPECT_GT(extent, 0.95) << size;
            EXPECT_LT(extent, 1) << size;
        }
}

TEST(Orbit, AFilmOfATurnShowsTheWholeBoxAllTheTime) {
    const scene::Box box{glm::vec3(-50, 0, -2), glm::vec3(50, 10, 2)};
    const Lens lens;
    Orbit orbit(box, z_up, lens, true);
    double largest = 0;
    for (int i = 0; i < 36; ++i, orbit.turn(10, 0))
        largest = std::max(largest, extent_of(orbit, lens, box));
    EXPECT_GT(largest, 0.95);
    EXPECT_LT(largest, 1);
}

TEST(Orbit, TurnsToTheRightAndUp) {
    Orbit orbit(glm::dvec3(0, 0, 100), glm::dvec3(0), y_up);
    orbit.turn(90, 0);
    expect_near(orbit.eye(), {100, 0, 0});
    orbit.turn(0, 30);
    expect_near(orbit.eye(), {100 * std::cos(M_PI / 6), 50, 0});
    orbit.turn(0, 1000); // ends at the pole
    expect_near(orbit.eye(), {0, 100, 0});

    Orbit upright(glm::dvec3(0, -100, 0), glm::dvec3(0), z_up);
    upright.turn(90, 0);
    expect_near(upright.eye(), {100, 0, 0});
}

TEST(Orbit, ZoomsAndFollowsTheCursorWhenPanned) {
    const Lens lens;
    Orbit orbit(glm::dvec3(30, -100, 40), glm::dvec3(1, 2, 3), z_up);
    const glm::dvec2 before = pixel_of(orbit.camera(lens), {1, 2, 3});
    orbit.pan(20, -10, lens);
    const glm::dvec2 after = pixel_of(orbit.camera(lens), {1, 2, 3});
    EXPECT_NEAR(after.x - before.x, 20, 1e-6);
    EXPECT_NEAR(after.y - before.y, -10, 1e-6);
    const double distance = glm::length(orbit.eye() - orbit.target());
    orbit.zoom(0.5);
    EXPECT_NEAR(glm::length(orbit.eye() - orbit.target()), distance / 2, 1e-9);
}

TEST(Orbit, KeepsTheGivenViewAlsoFromStraightAbove) {
    for (const glm::dvec3 &eye : {glm::dvec3(10, 20, 30), glm::dvec3(0, 0, 300), glm::dvec3(0, 0, -300)}) {
        const arhost_camera camera = Orbit(eye, glm::dvec3(0), z_up).camera({});
        expect_near(vector_of(camera.eye), eye);
        EXPECT_NEAR(glm::length(vector_of(camera.up)), 1, 1e-9);
        EXPECT_NEAR(glm::dot(vector_of(camera.up), eye), 0, 1e-6);
    }
}
