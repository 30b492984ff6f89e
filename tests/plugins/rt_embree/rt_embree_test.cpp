// SPDX-License-Identifier: Apache-2.0
#include "large_surfaces.hpp"
#include "ray_table.hpp"
#include "rejected_input.hpp"

#include <arhost/shading/lens.hpp>

#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>

#include <cmath>
#include <functional>

namespace arhost::test {
namespace {

using shading::srgb8_exact;

constexpr Pixel nothing_alpha{0, 0, 0, 0};

SceneBuilder one_sphere(glm::vec4 sphere, const arhost_material &material = flat(0.2f, 0.4f, 0.8f)) {
    SceneBuilder builder({.ambient = glm::vec3(1)});
    builder.add_ball("sphere", sphere, material);
    return builder;
}

// Returns a camera at the origin that looks along +z, with −y up, so that the world axes equal OpenCV's camera axes.
arhost_camera opencv_axes(const arhost_intrinsics &in) {
    return camera({0, 0, 0}, {0, 0, 1}, {0, -1, 0}, in);
}

// ---- Silhouettes -----------------------------------------------------------------------------------

struct Silhouette {
    double area, x, y;
};

Silhouette measured(const Picture &picture) {
    Silhouette s{0, 0, 0};
    for (std::uint32_t y = 0; y < picture.height; ++y)
        for (std::uint32_t x = 0; x < picture.width; ++x) {
            const double share = picture.alpha(x, y) / 255.0;
            s.area += share;
            s.x += share * x;
            s.y += share * y;
        }
    s.x /= s.area;
    s.y /= s.area;
    return s;
}

// Returns the expected silhouette of a sphere: samples the sphere's tangent cone, projects it with OpenCV, and
// computes area and centroid of the resulting polygon (Bourke 1988).
Silhouette expected(const arhost_intrinsics &in, glm::dvec3 centre, double radius) {
    const glm::dvec3 axis = glm::normalize(centre);
    const glm::dvec3 a = glm::normalize(glm::cross(axis, glm::dvec3(0, 1, 0))), b = glm::cross(axis, a);
    const double angle = std::asin(radius / glm::length(centre));
    std::vector<cv::Point3d> cone;
    for (int i = 0; i < 4000; ++i) {
        const double phi = 2 * CV_PI * i / 4000;
        const glm::dvec3 d = axis * std::cos(angle) + (a * std::cos(phi) + b * std::sin(phi)) * std::sin(angle);
        cone.emplace_back(d.x, d.y, d.z);
    }
    const cv::Mat matrix = (cv::Mat_<double>(3, 3) << in.fx, 0, in.cx, 0, in.fy, in.cy, 0, 0, 1);
    const std::vector<double> k(in.coefficients, in.coefficients + in.coefficient_count);
    std::vector<cv::Point2d> p;
    if (in.distortion == ARHOST_DISTORTION_FISHEYE)
        cv::fisheye::projectPoints(cone, p, cv::Vec3d(0, 0, 0), cv::Vec3d(0, 0, 0), matrix, k);
    else
        cv::projectPoints(cone, cv::Vec3d(0, 0, 0), cv::Vec3d(0, 0, 0), matrix, k, p);
    Silhouette s{0, 0, 0};
    for (std::size_t i = 0; i < p.size(); ++i) {
        const cv::Point2d &q = p[i], &r = p[(i + 1) % p.size()];
        const double twice = q.x * r.y - r.x * q.y;
        s.area += twice / 2;
        s.x += (q.x + r.x) * twice / 6;
        s.y += (q.y + r.y) * twice / 6;
    }
    return {std::abs(s.area), s.x / s.area, s.y / s.area};
}

arhost_intrinsics off_centre(arhost_distortion distortion, const std::vector<double> &coefficients) {
    arhost_intrinsics in = pinhole(320, 240, 260);
    in.fy = 250;
    in.cx = 172.3;
    in.cy = 97.6;
    return with_lens(in, distortion, coefficients);
}

TEST(Silhouette, SphereMatchesTheLensModel) {
    for (const arhost_intrinsics &in :
         {off_centre(ARHOST_DISTORTION_NONE, {}), off_centre(ARHOST_DISTORTION_BROWN, {-0.3, 0.1, 0.002, -0.001}),
          off_centre(ARHOST_DISTORTION_BROWN, {0.2, -0.1, 0, 0, 0.01}),
          off_centre(ARHOST_DISTORTION_FISHEYE, {0.05, -0.01, 0.004, -0.001})})
        for (const glm::vec4 &sphere :
             {glm::vec4(0, 0, 300, 60), glm::vec4(-130, 60, 400, 45), glm::vec4(70, 90, 350, 30)}) {
            Tracer tracer(one_sphere(sphere), {{"samples", "64"}});
            const Silhouette is = measured(tracer.render(opencv_axes(in)));
            const Silhouette should = expected(in, glm::dvec3(sphere), sphere.w);
            EXPECT_NEAR(is.area / should.area, 1, 2e-3);
            EXPECT_NEAR(is.x, should.x, 0.02);
            EXPECT_NEAR(is.y, should.y, 0.02);
        }
}

TEST(Silhouette, SphereBehindAFisheyeCameraIsVisible) {
    const arhost_intrinsics in = with_lens(pinhole(300, 300, 60), ARHOST_DISTORTION_FISHEYE, {0, 0, 0, 0});
    const Picture picture = Tracer(one_sphere({100, 0, -40, 20})).render(opencv_axes(in));
    const double theta = std::atan2(100, -40);
    EXPECT_EQ(picture.alpha(static_cast<int>(in.cx + 60 * theta), 150), 255);
}

// ---- Changes of options ----------------------------------------------------------------------------

TEST(Option, CanBeChangedWhileRunning) {
    expect_changed_options_apply("rt_embree", {}, pinhole());
    expect_changed_options_apply("rt_embree", {{"accumulate", "true"}}, pinhole());
}

// ---- Scaled images ---------------------------------------------------------------------------------

TEST(ScaledImage, EqualsThatOfARendererOfThisSize) {
    const arhost_intrinsics full = off_centre(ARHOST_DISTORTION_BROWN, {-0.3, 0.1, 0.002, -0.001});
    Tracer tracer(one_sphere({-30, 20, 300, 60}), {{"samples", "4"}});
    const std::vector<Pixel> full_size = tracer.render(opencv_axes(full)).pixels();
    for (const double scale : {0.5, 0.71, 0.1}) {
        const arhost_intrinsics small =
            arhost_scaled_intrinsics(full, static_cast<std::uint32_t>(std::lround(scale * full.width)),
                                     static_cast<std::uint32_t>(std::lround(scale * full.height)));
        ASSERT_EQ(tracer.start(full), ARHOST_STATUS_OK);
        const std::vector<Pixel> scaled = tracer.render_next(opencv_axes(small)).pixels();
        EXPECT_EQ(tracer.render_next(opencv_axes(full)).pixels(), full_size)
            << "the renderer must return to the full size";
        EXPECT_EQ(scaled, tracer.render(opencv_axes(small)).pixels()) << scale;
    }
}

TEST(ScaledImage, MustBeTheScaledViewAndNotLarger) {
    Tracer tracer(one_sphere({0, 0, 300, 60}));
    ASSERT_EQ(tracer.start(pinhole()), ARHOST_STATUS_OK);
    arhost_intrinsics wrong = arhost_scaled_intrinsics(pinhole(), 100, 75);
    wrong.fx *= 1.01;
    for (const arhost_intrinsics &in : {wrong, arhost_scaled_intrinsics(pinhole(), 201, 150)}) {
        Picture picture(in);
        EXPECT_EQ(tracer.try_render(opencv_axes(in), picture), ARHOST_STATUS_ERROR_INVALID_ARGUMENT);
    }
}

// ---- Alpha classes ---------------------------------------------------------------------------------

SceneBuilder sphere_over_catcher(arhost_role floor_role = ARHOST_ROLE_CATCHER) {
    SceneBuilder builder({.ambient = glm::vec3(0.3f)});
    builder.add_mesh("floor", square(80), diffuse(0.8f, 0.8f, 0.8f), floor_role);
    builder.add_ball("ball", {0, 0, 25, 12}, diffuse(0.9f, 0.1f, 0.1f));
    builder.add_light(light(60, -20, 200, 0.7f));
    return builder;
}

TEST(Alpha, ShadowIsWhereTheLightIsBlocked) {
    const arhost_camera view = from_the_side();
    const Picture picture = Tracer(sphere_over_catcher()).render(view);
    // The line from the light through the ball's centre hits the floor at the parameter t = 200 / 175.
    const glm::dvec3 from(60, -20, 200), hit = from + (glm::dvec3(0, 0, 25) - from) * (200.0 / 175);
    const glm::dvec3 w = glm::normalize(glm::dvec3(0, -150, 110)), u(1, 0, 0), v = glm::cross(w, u);
    const glm::dvec3 d = hit - glm::dvec3(0, -150, 110);
    const double x = 99.5 + 200 * glm::dot(d, u) / -glm::dot(d, w), y = 74.5 - 200 * glm::dot(d, v) / -glm::dot(d, w);
    const Pixel shadow = picture.at(static_cast<int>(std::lround(x)), static_cast<int>(std::lround(y)));
    EXPECT_EQ(shadow, (Pixel{0, 0, 0, 153})) << "black, at " << x << " " << y;
}

TEST(Alpha, CatcherFacingAwayIsInvisible) {
    SceneBuilder builder = sphere_over_catcher();
    const auto counts = Tracer(std::move(builder)).render(camera({0, -150, -110}, {0, 0, 0}, {0, 0, 1})).alphas();
    EXPECT_EQ(counts.count(153), 0u);
    EXPECT_GT(counts.at(255), 300) << "the ball is visible through the floor";
}

// The scene is a mirror ball in a closed room whose walls are catchers that face inwards.
TEST(Alpha, InwardFacingCatchersAreInvisibleFromOutsideButReflected) {
    // The background must not be visible, because the room is closed.
    SceneBuilder builder({.ambient = glm::vec3(1), .background = glm::vec3(0, 0, 1)});
    scene::TriangleMesh room = cube(100);
    for (auto &triangle : room.triangles)
        std::swap(triangle[1], triangle[2]);
    builder.add_mesh("room", room, flat(0.5f, 0.25f, 0), ARHOST_ROLE_CATCHER);
    builder.add_ball("ball", {0, 0, 0, 30}, mirror(1));
    Tracer tracer(std::move(builder));
    for (const double distance : {350.0, 90.0}) { // outside the room and inside
        const Picture picture = tracer.render(camera({0, -distance, 0}, {0, 0, 0}, {0, 0, 1}));
        EXPECT_EQ(picture.alpha(2, 2), 0) << distance;
        EXPECT_EQ(picture.alphas().size(), 2u) << "only the ball is opaque; all else is transparent";
        EXPECT_EQ(picture.alpha(99, 74), 255);
        for (const std::uint32_t x : {90, 99, 108}) {
            const Pixel pixel = picture.at(x, 74);
            EXPECT_TRUE(is_code_of(pixel[0], 0.5) && is_code_of(pixel[1], 0.25) && pixel[2] == 0) << distance;
        }
    }
}

TEST(Alpha, SceneSetsShadowAlpha) {
    SceneBuilder builder({.shadow_alpha_opaque = 0.8f, .shadow_alpha_translucent = 0.1f});
    builder.add_mesh("floor", square(80), flat(1, 1, 1), ARHOST_ROLE_CATCHER);
    builder.add_ball("glass", {-20, 0, 25, 12}, glass_of(1.5f));
    builder.add_ball("ball", {20, 0, 25, 12}, flat(1, 0, 0));
    builder.add_light(light(0, -20, 300, 1));
    const auto counts = Tracer(std::move(builder)).render(from_the_side()).alphas();
    EXPECT_EQ(counts.size(), 4u);
    EXPECT_GT(counts.at(26), 100);
    EXPECT_GT(counts.at(204), 100);
}

TEST(Alpha, OnlyTheFirstCatcherAlongARayReceivesTheShadow) {
    // The ball's shadow falls on both floors, because the upper floor does not block light. Seen from the camera, the
    // upper floor hides the lower floor.
    SceneBuilder builder = sphere_over_catcher();
    const double with_upper_only = Tracer(std::move(builder)).render(from_the_side()).alphas().at(153);
    builder = sphere_over_catcher();
    builder.add_mesh("lower floor", square(300, -60), diffuse(1, 1, 1), ARHOST_ROLE_CATCHER);
    EXPECT_EQ(Tracer(std::move(builder)).render(from_the_side()).alphas().at(153), with_upper_only);
}

TEST(Alpha, VirtualObjectBehindACatcherIsVisible) {
    SceneBuilder builder = sphere_over_catcher();
    builder.add_ball("sunken", {40, 0, -20, 10}, flat(1, 0, 0));
    const Picture with = Tracer(std::move(builder)).render(from_the_side());
    const Picture without = Tracer(sphere_over_catcher()).render(from_the_side());
    EXPECT_GT(with.alphas().at(255), without.alphas().at(255) + 100);
}

// Linear light of mid-grey video (sRGB 0.5) under a black overlay, relative to the light of the video.
double light_left(double alpha) {
    return shading::srgb_decode(0.5 * (1 - alpha)) / shading::srgb_decode(0.5);
}

TEST(Alpha, LightsThatAreHiddenInPartLeaveTheirShareOfLinearLight) {
    SceneBuilder builder = sphere_over_catcher();
    builder.add_light(light(-60, -20, 200, 0.35f)); // half as strong as the other light, without falloff
    // A shadow of both lights leaves the light that alpha 0.6 leaves; a shadow of one light removes about 2/3 or 1/3
    // of what the shadow of both removes. The cosines change it slightly.
    int strong = 0, weak = 0, both = 0;
    for (const auto &[alpha, count] : Tracer(std::move(builder)).render(from_the_side()).alphas()) {
        if (alpha == 0 || alpha == 255)
            continue;
        const double removed = (1 - light_left(alpha / 255.0)) / (1 - light_left(0.6));
        const bool is_strong = std::abs(removed - 2.0 / 3) < 0.05, is_weak = std::abs(removed - 1.0 / 3) < 0.05;
        (alpha == 153 ? both : is_strong ? strong : weak) += count;
        EXPECT_TRUE(alpha == 153 || is_strong || is_weak) << alpha << " " << removed;
    }
    EXPECT_GT(strong, 50);
    EXPECT_GT(weak, 50);
    EXPECT_GT(both, 20);
}

TEST(Alpha, OfSamplesPartlyInShadowLeavesTheirShareOfLinearLight) {
    // The shadow of a roof covers the left half of a single pixel, which 64 samples show. The lamp is far away, so
    // that the shadow is below the roof.
    SceneBuilder builder;
    builder.add_mesh("floor", square(10), diffuse(1, 1, 1), ARHOST_ROLE_CATCHER);
    builder.add_mesh("roof", quad({-900, -900, 300}, {0, -900, 300}, {0, 900, 300}, {-900, 900, 300}),
                     diffuse(1, 1, 1));
    builder.add_light(sun());
    const Picture picture = Tracer(std::move(builder), {{"samples", "64"}})
                                .render(camera({0, 0, 20}, {0, 0, 0}, {0, 1, 0}, pinhole(1, 1, 20)));
    EXPECT_EQ(picture.at(0, 0)[0], 0);
    EXPECT_NEAR(light_left(picture.alpha(0, 0) / 255.0), (1 + light_left(0.6)) / 2, 0.005);
}

TEST(Alpha, LightBehindACatcherCastsNoShadowOnIt) {
    SceneBuilder builder;
    builder.add_mesh("floor", square(80), diffuse(1, 1, 1), ARHOST_ROLE_CATCHER);
    builder.add_ball("ball", {0, 0, -40, 20}, diffuse(1, 0, 0));
    builder.add_light(light(0, 0, -200, 1));
    const auto counts = Tracer(std::move(builder)).render(from_the_side()).alphas();
    EXPECT_EQ(counts.count(153), 0u);
}

TEST(Alpha, OccluderHidesObjectsAndShadowsBehindIt) {
    SceneBuilder builder = sphere_over_catcher();
    const arhost_camera view = from_the_side();
    // The occluder is a screen in front of the camera that covers the left half of the picture.
    builder.add_mesh("screen", quad({-50, -140, 0}, {0, -140, 0}, {0, -140, 200}, {-50, -140, 200}), diffuse(1, 1, 1),
                     ARHOST_ROLE_OCCLUDER);
    const Picture with = Tracer(std::move(builder)).render(view);
    const Picture without = Tracer(sphere_over_catcher()).render(view);
    int hidden = 0;
    for (std::uint32_t y = 0; y < with.height; ++y)
        for (std::uint32_t x = 0; x < with.width; ++x) {
            if (x < 99) {
                ASSERT_EQ(with.alpha(x, y), 0);
                hidden += without.alpha(x, y) != 0;
            } else if (x > 101) {
                ASSERT_EQ(with.alpha(x, y), without.alpha(x, y)) << "an occluder casts no shadow on the catcher";
            }
        }
    EXPECT_GT(hidden, 300);
}

TEST(Alpha, OccluderBehindAnObjectHidesNothing) {
    SceneBuilder builder = one_sphere({0, 0, 200, 40});
    builder.add_mesh("wall", square(500, 300), flat(1, 1, 1), ARHOST_ROLE_OCCLUDER);
    EXPECT_EQ(Tracer(std::move(builder)).render(opencv_axes(pinhole())).pixels(),
              Tracer(one_sphere({0, 0, 200, 40})).render(opencv_axes(pinhole())).pixels());
}

TEST(Alpha, EmptySceneIsTransparent) {
    const Picture picture = Tracer(SceneBuilder()).render(from_the_side());
    EXPECT_EQ(picture.alphas(), (std::map<int, int>{{0, 200 * 150}}));
    EXPECT_EQ(picture.info.has_region, 1);
    EXPECT_EQ(picture.info.region_width, 0u);
}

// ---- Light -----------------------------------------------------------------------------------------

TEST(Light, PlaneFollowsLambert) {
    for (const arhost_falloff falloff : {ARHOST_FALLOFF_NONE, ARHOST_FALLOFF_INVERSE_SQUARE}) {
        SceneBuilder builder({.ambient = glm::vec3{0.1f, 0.2f, 0.3f}});
        const double intensity = falloff == ARHOST_FALLOFF_NONE ? 0.75 : 5000;
        arhost_material material = diffuse(0.8f, 0.5f, 0.3f);
        material.ambient[0] = 0.4f;
        builder.add_mesh("plane", square(200), material);
        builder.add_light(light(30, -20, 90, static_cast<float>(intensity), falloff));
        const Picture picture = Tracer(std::move(builder)).render(from_above());
        for (int y = 0; y < 150; y += 3)
            for (int x = 0; x < 200; x += 3) {
                const glm::dvec3 to_light = glm::dvec3(30, -20, 90) - on_the_floor(x, y);
                const double d = glm::length(to_light), cosine = to_light.z / d;
                const double e = intensity * cosine / (falloff == ARHOST_FALLOFF_NONE ? 1 : d * d);
                const Pixel pixel = picture.at(x, y);
                ASSERT_TRUE(is_code_of(pixel[0], double{0.4f} * double{0.1f} + double{0.8f} * e));
                ASSERT_TRUE(is_code_of(pixel[1], double{0.5f} * double{0.2f} + double{0.5f} * e));
                ASSERT_TRUE(is_code_of(pixel[2], double{0.3f} * double{0.3f} + double{0.3f} * e));
                ASSERT_EQ(pixel[3], 255);
            }
    }
}

TEST(Light, SpecularPlaneAddsPhongLobe) {
    SceneBuilder builder;
    builder.add_mesh("plane", square(200), shiny(0.2f, 0.5f, 20));
    builder.add_light(light(30, -20, 90, 0.9f));
    const Picture picture = Tracer(std::move(builder)).render(from_above());
    for (int y = 0; y < 150; y += 3)
        for (int x = 0; x < 200; x += 3) {
            const glm::dvec3 p = on_the_floor(x, y), l = glm::normalize(glm::dvec3(30, -20, 90) - p);
            const glm::dvec3 reflected(-l.x, -l.y, l.z), to_eye = glm::normalize(glm::dvec3(0, 0, 200) - p);
            const double value = 0.9 * (0.2 * l.z + 0.5 * std::pow(std::max(glm::dot(reflected, to_eye), 0.0), 20));
            ASSERT_TRUE(is_code_of(picture.at(x, y)[0], value)) << x << " " << y;
        }
}

TEST(Light, CatchersAndOccludersShadowObjects) {
    for (const arhost_role role : {ARHOST_ROLE_CATCHER, ARHOST_ROLE_OCCLUDER}) {
        SceneBuilder builder = one_sphere({0, 0, 20, 20}, diffuse(0.5f, 0.5f, 0.5f));
        builder.settings.ambient = glm::vec3(0.2f);
        builder.add_light(light(0, 0, 300, 0.8f));
        builder.add_mesh("lid", square(90, 120), diffuse(1, 1, 1), role);
        const Picture picture = Tracer(std::move(builder)).render(from_the_side());
        for (const Pixel &pixel : picture.pixels())
            if (pixel[3] == 255) {
                ASSERT_EQ(pixel[0], srgb8_exact(0.1)) << "ambient light only";
            }
        EXPECT_GT(picture.alphas().at(255), 300);
    }
}

TEST(Light, SurfacesDoNotShadowThemselves) {
    // The plane is far from the origin, where the rounding errors of floats are large, and the light is grazing.
    SceneBuilder builder;
    builder.add_mesh("plane", square(2000), diffuse(0.8f, 0.8f, 0.8f), ARHOST_ROLE_VIRTUAL,
                     glm::mat4x3(glm::translate(glm::mat4(1), glm::vec3(30000, -20000, 10000))));
    builder.add_light(light(31000, -20000, 10100, 1));
    const Picture picture =
        Tracer(std::move(builder)).render(camera({30000, -20000, 10200}, {30000, -20000, 10000}, {0, 1, 0}));
    for (const Pixel &pixel : picture.pixels())
        ASSERT_GT(pixel[0], 40);
}

TEST(Light, SmoothMeshHasASmoothShadowTerminator) {
    for (const bool is_instance : {false, true}) {
        SceneBuilder builder({.ambient = glm::vec3(0)});
        const glm::mat4x3 place(is_instance ? glm::scale(glm::mat4(1), glm::vec3(60)) : glm::mat4(1));
        builder.add_mesh("ball", coarse_ball(is_instance ? 1 : 60), diffuse(1, 1, 1), ARHOST_ROLE_VIRTUAL, place);
        builder.add_light(sun(-0.8f, -0.36f, -0.48f));
        const Picture picture = Tracer(std::move(builder)).render(from_above());
        int near_terminator = 0;
        for (int y = 0; y < 150; ++y)
            for (int x = 0; x < 200; ++x) {
                // Where the ray hits the ball that the facets approximate.
                const glm::dvec3 eye(0, 0, 200), d = glm::normalize(on_the_floor(x, y) - eye);
                const double b = glm::dot(eye, d), root = b * b - (200.0 * 200 - 57 * 57);
                if (root < 0)
                    continue;
                const glm::dvec3 normal = glm::normalize(eye + d * (-b - std::sqrt(b * b - (200.0 * 200 - 60 * 60))));
                const double expected = glm::dot(normal, glm::dvec3(0.8, 0.36, 0.48));
                near_terminator += std::abs(expected) < 0.25;
                ASSERT_NEAR(shading::srgb_decode(picture.at(x, y)[0] / 255.0), std::max(expected, 0.0), 0.03)
                    << x << " " << y;
            }
        EXPECT_GT(near_terminator, 1000);
    }
}

// ---- Mirrors ---------------------------------------------------------------------------------------

SceneBuilder mirror_and_ball(std::uint32_t max_depth = 5) {
    SceneBuilder builder(
        {.max_depth = max_depth, .ambient = glm::vec3(1), .background = glm::vec3{0.1f, 0.2f, 0.9f}});
    builder.add_mesh("mirror", square(400), mirror(0.8f));
    builder.add_ball("ball", {0, 260, 120, 60}, flat(0.9f, 0.3f, 0.1f));
    return builder;
}

TEST(Mirror, ShowsWhatTheReflectedRayHits) {
    const arhost_camera view = camera({0, -200, 200}, {0, 0, 0}, {0, 0, 1});
    const Picture picture = Tracer(mirror_and_ball()).render(view);
    const glm::dvec3 eye(0, -200, 200), w = glm::normalize(eye), u(1, 0, 0), v = glm::cross(w, u);
    int balls = 0, backgrounds = 0;
    for (int y = 0; y < 150; ++y)
        for (int x = 0; x < 200; ++x) {
            const glm::dvec3 d = glm::normalize(u * ((x - 99.5) / 200) - v * ((y - 74.5) / 200) - w);
            const glm::dvec3 hit = eye - d * (eye.z / d.z), reflected(d.x, d.y, -d.z);
            const auto distance_of_ball = [](glm::dvec3 from, glm::dvec3 along) {
                const glm::dvec3 to = glm::dvec3(0, 260, 120) - from;
                return glm::dot(to, along) > 0 ? glm::length(to - along * glm::dot(to, along)) : 1e9;
            };
            if (distance_of_ball(eye, d) < 62 || std::abs(hit.x) > 395 || std::abs(hit.y) > 395)
                continue; // the primary ray hits the ball or misses the mirror
            const double distance = distance_of_ball(hit, reflected);
            const Pixel pixel = picture.at(x, y);
            if (distance < 59.5) {
                ++balls;
                ASSERT_TRUE(is_code_of(pixel[0], 0.8 * 0.9) && is_code_of(pixel[2], 0.8 * 0.1)) << x << " " << y;
            } else if (distance > 60.5) {
                ++backgrounds;
                ASSERT_TRUE(is_code_of(pixel[0], 0.8 * 0.1) && is_code_of(pixel[2], 0.8 * 0.9)) << x << " " << y;
            }
        }
    EXPECT_GT(balls, 200);
    EXPECT_GT(backgrounds, 2000);
}

TEST(Mirror, ReflectsTheBackgroundWhichIsOtherwiseTransparent) {
    // Pixels whose primary ray hits nothing are transparent, regardless of the background colour.
    const Picture picture = Tracer(one_sphere({0, 0, 300, 30}, mirror(1))).render(opencv_axes(pinhole()));
    EXPECT_EQ(picture.at(0, 0), nothing_alpha);
    EXPECT_EQ(picture.at(99, 74), (Pixel{255, 255, 255, 255})) << "the default background is white";
}

TEST(Mirror, ConservesEnergy) {
    SceneBuilder builder({.max_depth = 100, .background = glm::vec3(0.6f)});
    builder.add_object("balls", builder.add_spheres({{-30, 0, 20, 20}, {30, 0, 20, 20}, {0, 40, 20, 20}}),
                       builder.add_material(mirror(1)));
    for (const Pixel &pixel : Tracer(std::move(builder)).render(from_the_side()).pixels())
        if (pixel[3] == 255) {
            ASSERT_TRUE(is_code_of(pixel[0], 0.6, 1e-4));
        }
}

TEST(Mirror, TracesAtMostMaxDepthBounces) {
    // The ray bounces between two parallel mirrors of reflectivity 0.5 and escapes after five bounces.
    const auto brightness = [](std::uint32_t max_depth) {
        SceneBuilder builder({.max_depth = max_depth, .background = glm::vec3(1)});
        builder.add_mesh("below", square(1000), mirror(0.5f));
        builder.add_mesh("above", {{{-1000, -100, 100}, {1000, -100, 100}, {0, 250, 100}}, {}, {}, {{0, 2, 1}}},
                         mirror(0.5f));
        // The ray starts at (0, −150, 50) and goes down at 45°. It hits the floor at y = −100, 100 and 300 and the
        // ceiling at y = 0 and 200.
        const arhost_camera view = camera({0, -150, 50}, {0, -149, 49}, {0, 0, 1}, pinhole(1, 1));
        return Tracer(std::move(builder)).render(view).at(0, 0)[0];
    };
    EXPECT_EQ(brightness(5), srgb8_exact(0.03125));
    EXPECT_EQ(brightness(4), 0);
    EXPECT_EQ(brightness(0), 0);
    EXPECT_EQ(brightness(100), srgb8_exact(0.03125));
}

TEST(Mirror, ShowsCatchersWithTheirMaterialAndTheShadowsOnThem) {
    SceneBuilder builder = sphere_over_catcher();
    // The mirror stands upright behind the ball and faces the camera.
    builder.add_mesh("mirror", quad({-80, 70, 0}, {80, 70, 0}, {80, 70, 120}, {-80, 70, 120}), mirror(1));
    const Picture picture = Tracer(std::move(builder)).render(from_the_side());
    const int lit_at_least = srgb8_exact(0.8 * 0.3 + 0.8 * 0.7 * 0.8), ambient_only = srgb8_exact(0.8 * 0.3);
    int lit = 0, shadowed = 0;
    for (const Pixel &p : picture.pixels()) {
        const bool grey = p[3] == 255 && p[0] == p[1] && p[1] == p[2];
        lit += grey && p[0] >= lit_at_least && p[0] < 250;
        shadowed += grey && p[0] == ambient_only;
    }
    EXPECT_GT(lit, 300);
    EXPECT_GT(shadowed, 30);
}

// ---- Samples ---------------------------------------------------------------------------------------

TEST(Samples, EdgesKeepTheObjectsColour) {
    const Picture picture = Tracer(one_sphere({10, 5, 200, 40}), {{"samples", "16"}}).render(opencv_axes(pinhole()));
    int edges = 0;
    for (const Pixel &pixel : picture.pixels()) {
        if (pixel[3] == 0)
            continue;
        edges += pixel[3] < 255;
        ASSERT_EQ(pixel, (Pixel{srgb8_exact(0.2f), srgb8_exact(0.4f), srgb8_exact(0.8f), pixel[3]}));
    }
    EXPECT_GT(edges, 100);
}

double over(const Pixel &pixel, int channel, double background) {
    const double alpha = pixel[3] / 255.0;
    return background * (1 - alpha) + pixel[channel] * alpha;
}

SceneBuilder under_a_bulb() {
    SceneBuilder builder = sphere_over_catcher();
    builder.add_light(bulb({-60, -20, 200}, 40));
    return builder;
}

TEST(Samples, AccumulateWhileTheCameraIsStatic) {
    Tracer tracer(under_a_bulb(), {{"accumulate", "true"}});
    const arhost_camera still = from_the_side(), other = camera({0, -150, 112}, {0, 0, 0}, {0, 0, 1});
    const auto first = tracer.render(still).pixels();
    auto last = first;
    for (int i = 0; i < 255; ++i)
        last = tracer.render_next(still).pixels();
    const auto truth = Tracer(under_a_bulb(), {{"samples", "64"}, {"light_samples", "16"}}).render(still).pixels();
    const auto distance = [&](const std::vector<Pixel> &a) {
        double sum = 0;
        for (std::size_t i = 0; i < a.size(); ++i)
            sum += std::abs(a[i][3] - truth[i][3]);
        return sum / static_cast<double>(a.size());
    };
    EXPECT_LT(distance(last), 0.1);
    EXPECT_GT(distance(first), 5 * distance(last));
    EXPECT_NE(tracer.render_next(other).pixels(), last);
    EXPECT_EQ(tracer.render_next(still).pixels(), first) << "the accumulation must restart";
}

TEST(Samples, StopChangingTheImageAtTheAccumulationLimit) {
    Tracer tracer(under_a_bulb(), {{"accumulate", "true"}, {"samples", "64"}});
    const arhost_camera still = from_the_side(pinhole(8, 8, 10));
    const auto after = [&](int frames) {
        for (int i = 1; i < frames; ++i)
            tracer.render_next(still);
        return tracer.render_next(still).pixels();
    };
    const auto first = tracer.render(still).pixels(), enough = after(65536 / 64 - 1);
    EXPECT_NE(first, enough);
    EXPECT_EQ(after(1), enough);
    EXPECT_EQ(after(20), enough);
}

// Renders a single pixel. The rectangle from x = −½ to `edge` has the colour `left`, the rest of the pixel `right`.
Pixel pixel_of_two(const arhost_material &left, const arhost_material &right, float edge, const char *samples) {
    const auto rectangle = [](float x0, float x1) { return quad({x0, -1, 0}, {x1, -1, 0}, {x1, 1, 0}, {x0, 1, 0}); };
    SceneBuilder builder({.ambient = glm::vec3(1)});
    builder.add_mesh("left", rectangle(-1, edge), left);
    builder.add_mesh("right", rectangle(edge, 1), right);
    return Tracer(std::move(builder), {{"samples", samples}})
        .render(camera({0, 0, 20}, {0, 0, 0}, {0, 1, 0}, pinhole(1, 1, 20)))
        .at(0, 0);
}

arhost_material glowing(float radiance) {
    arhost_material material = metallic_roughness(glm::vec3(0), 1, 0);
    set3(material.emission, radiance, radiance, radiance);
    return material;
}

TEST(Samples, AreAveragedInLinearLightOfUpTo100TimesWhite) {
    EXPECT_EQ(pixel_of_two(flat(0, 0, 0), flat(1, 0.5f, 0.1f), 0, "64"),
              (Pixel{srgb8_exact(0.5), srgb8_exact(0.25), srgb8_exact(0.05), 255}));
    EXPECT_EQ(pixel_of_two(flat(0, 0, 0), glowing(2), 0.25f, "64")[0], srgb8_exact(0.5)) << "brighter than white";
    // One of 256 samples shows a strip that is brighter than 100 times white.
    EXPECT_TRUE(is_code_of(pixel_of_two(glowing(1e6f), flat(0, 0, 0), -0.5f + 1 / 256.0f, "256")[0], 100 / 256.0));
}

// A camera that sees at its pixels' centres what pinhole() sees at this position in its pixels.
arhost_intrinsics shifted_by(const raytracer_common::Sample &sample) {
    arhost_intrinsics shifted = pinhole();
    shifted.cx -= sample.x;
    shifted.cy -= sample.y;
    return shifted;
}

// Composites in sRGB as the compositor does. At an edge, the composite must be between those of the two sides.
TEST(Samples, EdgesHaveNoHaloOnAnyBackground) {
    const auto scene = [] {
        SceneBuilder builder = sphere_over_catcher();
        builder.add_ball("lamp", {30, -20, 20, 10}, glowing(30));
        return builder;
    };
    const arhost_intrinsics in = pinhole();
    const Picture all = Tracer(scene(), {{"samples", "16"}}).render(from_the_side(in));
    std::vector<Picture> singles;
    for (const raytracer_common::Sample &sample : raytracer_common::sample_positions(16))
        singles.push_back(Tracer(scene()).render(from_the_side(shifted_by(sample))));
    int edges = 0;
    for (const double background : {0.0, 60.0, 130.0, 255.0})
        for (std::uint32_t y = 0; y < in.height; ++y)
            for (std::uint32_t x = 0; x < in.width; ++x)
                for (int channel = 0; channel < 3; ++channel) {
                    double low = 255, high = 0;
                    for (const Picture &single : singles) {
                        low = std::min(low, over(single.at(x, y), channel, background));
                        high = std::max(high, over(single.at(x, y), channel, background));
                    }
                    edges += high - low > 20;
                    const double composite = over(all.at(x, y), channel, background);
                    // The tolerance is for the rounding errors of the alpha, of the colour and of the single images.
                    ASSERT_GE(composite, low - 1.5) << x << " " << y << " over " << background;
                    ASSERT_LE(composite, high + 1.5) << x << " " << y << " over " << background;
                }
    EXPECT_GT(edges, 1000);
}

TEST(Samples, CoverageIsTheShareOfSamplesThatHitAnObject) {
    constexpr int count = 8;
    const arhost_intrinsics in = pinhole();
    const Picture all =
        Tracer(one_sphere({10, 5, 200, 40}), {{"samples", std::to_string(count)}}).render(opencv_axes(in));
    std::vector<double> coverage(std::size_t{in.width} * in.height);
    for (const raytracer_common::Sample &sample : raytracer_common::sample_positions(count)) {
        const Picture single = Tracer(one_sphere({10, 5, 200, 40})).render(opencv_axes(shifted_by(sample)));
        for (std::uint32_t i = 0; i < coverage.size(); ++i)
            coverage[i] += single.alpha(i % in.width, i / in.width) / static_cast<double>(count);
    }
    for (std::uint32_t i = 0; i < coverage.size(); ++i)
        ASSERT_NEAR(all.alpha(i % in.width, i / in.width), coverage[i], 0.5) << i;
}

// ---- Equivalence -----------------------------------------------------------------------------------

SceneBuilder busy_scene(const glm::mat4 &moved = glm::mat4(1)) {
    SceneBuilder builder({.ambient = glm::vec3(0.2f), .background = glm::vec3{0.5f, 0.6f, 0.7f}});
    const auto place = [&](glm::vec3 to, float degrees, glm::vec3 scale) {
        glm::mat4 m = glm::translate(moved, to);
        m = glm::rotate(m, glm::radians(degrees), glm::vec3(0.2f, 0.3f, 0.9f));
        return glm::mat4x3(glm::scale(m, scale));
    };
    const std::uint32_t box = builder.add_triangles(cube(1)), ball = builder.add_spheres({{0, 0, 0, 1}});
    const std::uint32_t grey = builder.add_material(diffuse(0.7f, 0.7f, 0.7f));
    const std::uint32_t glossy = builder.add_material(shiny(0.4f, 0.7f, 40));
    const std::uint32_t glass = builder.add_material(mirror(0.9f));
    builder.add_object("floor", builder.add_triangles(square(100)), grey, ARHOST_ROLE_CATCHER,
                       place({0, 0, 0}, 0, {1, 1, 1}));
    builder.add_object("box", box, glossy, ARHOST_ROLE_VIRTUAL, place({-30, 10, 20}, 30, {12, 15, 20}));
    builder.add_object("ball", ball, glass, ARHOST_ROLE_VIRTUAL, place({20, 0, 22}, 0, {20, 20, 20}));
    builder.add_object("egg", ball, grey, ARHOST_ROLE_VIRTUAL, place({10, -45, 12}, 50, {6, 9, 12}));
    builder.add_object("post", box, grey, ARHOST_ROLE_OCCLUDER, place({60, -20, 30}, 10, {4, 4, 30}));
    const glm::vec4 at = moved * glm::vec4(40, -80, 160, 1);
    builder.add_light(light(at.x, at.y, at.z, 0.8f));
    return builder;
}

const std::vector<std::function<SceneBuilder()>> varied_scenes{[] { return busy_scene(); }, rich_scene};

TEST(Equivalence, IsIdenticalForAnyThreadCountAndRepeatedFrames) {
    for (const auto &scene : varied_scenes)
        for (const Options &options :
             {Options{{"samples", "1"}}, Options{{"samples", "4"}}, Options{{"samples", "2"}, {"glass", "path"}}}) {
            const auto trace = [&](const std::string &threads) {
                Options all = options;
                all["threads"] = threads;
                Tracer tracer(scene(), all);
                const auto first = tracer.render(from_the_side()).pixels();
                for (int i = 0; i < 5; ++i)
                    EXPECT_EQ(tracer.render_next(from_the_side()).pixels(), first) << threads << " threads";
                return first;
            };
            const auto one = trace("1");
            EXPECT_EQ(trace("2"), one);
            EXPECT_EQ(trace("3"), one);
        }
}

TEST(Equivalence, IsIdenticalForEveryInstructionSet) {
    for (const auto &scene : varied_scenes) {
        const auto trace = [&](const std::string &instruction_set) {
            Tracer tracer(scene(), {{"instruction_set", instruction_set}, {"samples", "3"}});
            return tracer.render(from_the_side()).pixels();
        };
        for (const std::string &set : instruction_sets())
            EXPECT_EQ(trace(set), trace("base")) << set;
    }
}

// Returns the fraction of pixels that differ by more than rounding. It is small but not 0 if silhouettes shift by a
// pixel.
double fraction_of_differing_pixels(const Picture &a, const Picture &b) {
    const auto p = a.pixels(), q = b.pixels();
    double differ = 0;
    for (std::size_t i = 0; i < p.size(); ++i)
        differ += !std::ranges::equal(p[i], q[i], [](int c, int d) { return std::abs(c - d) <= 1; });
    return differ / static_cast<double>(p.size());
}

TEST(Equivalence, MovingSceneAndCameraTogetherChangesNothing) {
    glm::mat4 moved = glm::translate(glm::mat4(1), glm::vec3(300, -200, 150));
    moved = glm::rotate(moved, 1.1f, glm::normalize(glm::vec3(1, -2, 0.5f)));
    const auto apply = [&](glm::dvec4 p) {
        const glm::dvec4 q = glm::dmat4(moved) * p;
        return std::array<double, 3>{q.x, q.y, q.z};
    };
    const Picture here = Tracer(busy_scene()).render(from_the_side());
    const Picture there =
        Tracer(busy_scene(moved)).render(camera(apply({0, -150, 110, 1}), apply({0, 0, 0, 1}), apply({0, 0, 1, 0})));
    EXPECT_LT(fraction_of_differing_pixels(here, there), 0.003);
}

TEST(Equivalence, InstancesLookLikeWorldSpaceVertices) {
    const glm::mat4 m = glm::scale(
        glm::rotate(glm::translate(glm::mat4(1), glm::vec3(5, -10, 15)), 0.7f, glm::normalize(glm::vec3(1, 2, 3))),
        glm::vec3(30, 20, 12));
    const auto build = [&](bool baked) {
        SceneBuilder builder({.ambient = glm::vec3(0.1f)});
        scene::TriangleMesh mesh = cube(1);
        for (const glm::vec3 &p : mesh.positions)
            mesh.normals.push_back(glm::normalize(p)); // smooth shading
        if (baked)
            for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
                mesh.positions[i] = glm::vec3(m * glm::vec4(mesh.positions[i], 1));
                mesh.normals[i] = glm::normalize(glm::transpose(glm::inverse(glm::mat3(m))) * mesh.normals[i]);
            }
        builder.add_mesh("box", mesh, diffuse(0.8f, 0.6f, 0.4f), ARHOST_ROLE_VIRTUAL,
                         baked ? glm::mat4x3(1) : glm::mat4x3(m));
        builder.add_light(light(100, -100, 200, 0.8f));
        return Tracer(std::move(builder)).render(from_the_side());
    };
    // Baked normals are normalized before interpolation, those of instances after it, so colours may differ slightly.
    const Picture baked = build(true), instanced = build(false);
    EXPECT_GT(baked.alphas().at(255), 500);
    EXPECT_LT(std::abs(baked.alphas().at(255) - instanced.alphas().at(255)), 5);
    const auto p = baked.pixels(), q = instanced.pixels();
    int far = 0;
    for (std::size_t i = 0; i < p.size(); ++i)
        far += p[i][3] == q[i][3] && std::abs(p[i][0] - q[i][0]) > 40;
    EXPECT_LT(far, 10);
}

TEST(Equivalence, TriangleSoupLooksLikeTheIndexedMesh) {
    const scene::TriangleMesh indexed = cube(25);
    scene::TriangleMesh soup;
    for (const auto &triangle : indexed.triangles) {
        const auto first = static_cast<std::uint32_t>(soup.positions.size());
        for (int corner = 0; corner < 3; ++corner)
            soup.positions.push_back(indexed.positions[triangle[corner]]);
        soup.triangles.push_back({first, first + 1, first + 2});
    }
    const auto build = [](const scene::TriangleMesh &mesh) {
        SceneBuilder builder({.ambient = glm::vec3(0.1f)});
        builder.add_mesh("box", mesh, diffuse(0.8f, 0.6f, 0.4f));
        builder.add_light(light(100, -100, 200, 0.8f));
        return Tracer(std::move(builder)).render(from_the_side()).pixels();
    };
    EXPECT_TRUE(build(soup) == build(indexed));
}

TEST(Equivalence, RobustTraversalMatchesTheFastOne) {
    EXPECT_LT(fraction_of_differing_pixels(Tracer(busy_scene(), {{"robust", "true"}}).render(from_the_side()),
                                           Tracer(busy_scene()).render(from_the_side())),
              0.001);
}

// ---- Regions and sizes -----------------------------------------------------------------------------

TEST(Region, ContainsAllAlphaTightly) {
    for (const glm::vec4 &sphere :
         {glm::vec4(0, 0, 300, 20), glm::vec4(-150, 60, 300, 30), glm::vec4(60, 0, 200, 90)}) {
        const Picture picture = Tracer(one_sphere(sphere), {{"samples", "4"}}).render(opencv_axes(pinhole()));
        ASSERT_EQ(picture.info.has_region, 1);
        const auto [x0, y0, x1, y1] = picture.bounds();
        const arhost_render_info &info = picture.info;
        EXPECT_LE(info.region_x, x0);
        EXPECT_LE(info.region_y, y0);
        EXPECT_GE(info.region_x + info.region_width, x1);
        EXPECT_GE(info.region_y + info.region_height, y1);
        EXPECT_LE(info.region_x + info.region_width, picture.width);
        EXPECT_LE(info.region_y + info.region_height, picture.height);
        EXPECT_LT(info.region_width, x1 - x0 + 8);
        EXPECT_LT(info.region_height, y1 - y0 + 8);
    }
}

TEST(Region, SkippedTilesAreEmpty) {
    // Spheres are in many places; some are behind the camera, some intersect the plane through the camera. Compares
    // each pixel with the exact result.
    SceneBuilder builder({.ambient = glm::vec3(1)});
    const std::vector<glm::vec4> spheres = {
        {200, 40, 3, 60}, {-90, -70, 100, 9}, {30, 66, 120, 15}, {0, 0, -100, 40}, {-4, 9, 700, 3}};
    for (const glm::vec4 &sphere : spheres)
        builder.add_ball("ball", sphere, flat(1, 1, 1));
    const arhost_intrinsics in = off_centre(ARHOST_DISTORTION_BROWN, {-0.3, 0.1, 0.002, -0.001});
    const Picture picture = Tracer(std::move(builder)).render(opencv_axes(in));
    const shading::Lens lens(in);
    for (std::uint32_t y = 0; y < in.height; ++y)
        for (std::uint32_t x = 0; x < in.width; ++x) {
            const auto ray = lens.ray({static_cast<double>(x), static_cast<double>(y)});
            if (!ray) {
                ASSERT_EQ(picture.alpha(x, y), 0);
                continue;
            }
            const glm::dvec3 d = glm::normalize(glm::dvec3(ray->x, ray->y, ray->z));
            double margin = 1e9; // signed distance to the nearest sphere's silhouette, negative inside
            for (const glm::vec4 &s : spheres) {
                const glm::dvec3 c(s);
                const double along = glm::dot(c, d);
                if (along > 0)
                    margin = std::min(margin, glm::length(c - d * along) - s.w);
            }
            if (std::abs(margin) > 1e-3) {
                ASSERT_EQ(picture.alpha(x, y), margin < 0 ? 255 : 0) << x << " " << y;
            }
        }
}

TEST(Sizes, OddImageSizesAreWrittenExactly) {
    for (const auto &[width, height] :
         {std::pair{1u, 1u}, {3u, 5u}, {5u, 2u}, {33u, 65u}, {31u, 1u}, {1u, 100u}, {67u, 35u}})
        for (const char *samples : {"1", "2"}) {
            const Picture picture = Tracer(one_sphere({0, 0, 50, 45}), {{"samples", samples}})
                                        .render(opencv_axes(pinhole(width, height, 20)));
            EXPECT_EQ(picture.alpha(width / 2, height / 2), 255) << width << "x" << height;
            for (const Pixel &pixel : picture.pixels())
                ASSERT_NE(pixel[3], 0xa5) << "the plugin did not write this pixel";
        }
}

// ---- Unusual scenes --------------------------------------------------------------------------------

TEST(UnusualScenes, DegenerateTrianglesAreHarmless) {
    SceneBuilder builder = one_sphere({0, 0, 200, 30});
    scene::TriangleMesh sliver{
        {{0, 0, 100}, {50, 0, 100}, {100, 0, 100}, {7, 7, 90}}, {}, {}, {{0, 1, 2}, {3, 3, 3}, {0, 0, 1}}};
    builder.add_mesh("slivers", sliver, diffuse(1, 1, 1));
    sliver.normals.assign(4, {0, 0, 1});
    builder.add_mesh("smooth slivers", sliver, diffuse(1, 1, 1));
    builder.add_light(light(0, 0, 0, 1));
    const auto counts = Tracer(std::move(builder)).render(opencv_axes(pinhole())).alphas();
    EXPECT_GT(counts.at(255), 2000);
    EXPECT_LT(counts.at(255), 3500);
}

// The normals of such small triangles underflow in single precision; rays with invalid directions make Embree abort.
TEST(UnusualScenes, FacetsTooSmallForTheirNormalsAreRendered) {
    for (const float side : {1e-12f, 1e-16f, 1e-20f})
        for (const arhost_material &material : {mirror(1), glass_of(1.5f)}) {
            SceneBuilder builder({.background = glm::vec3(0.5f)});
            builder.add_mesh("speck", square(side), material);
            builder.add_light(light(0, 0, 150, 0.5f));
            SCOPED_TRACE(side);
            Tracer(std::move(builder)).render(camera({0, 0, 4.0 * side}, {0, 0, 0}, {0, 1, 0}));
        }
}

TEST(UnusualScenes, NormalsThatCancelOutFallBackToTheFacet) {
    scene::TriangleMesh mesh = square(200);
    mesh.normals = {{1, 0, 0}, {-1, 0, 0}, {1, 0, 0}, {-1, 0, 0}};
    SceneBuilder builder;
    builder.add_mesh("plane", mesh, diffuse(1, 1, 1));
    builder.add_light(light(0, 0, 150, 0.5f));
    // A NaN in the shading would make pixels black.
    const int ambient = arhost::shading::srgb8_exact(0.2);
    for (const Pixel &pixel : Tracer(std::move(builder)).render(from_above()).pixels()) {
        ASSERT_EQ(pixel[3], 255);
        ASSERT_GE(pixel[0], ambient);
    }
}

TEST(UnusualScenes, CameraInsideAnObjectSeesItsInside) {
    const Picture picture = Tracer(one_sphere({0, 0, 0, 50}, diffuse(1, 1, 1))).render(opencv_axes(pinhole()));
    EXPECT_EQ(picture.alphas(), (std::map<int, int>{{255, 200 * 150}}));
    EXPECT_EQ(picture.info.region_width, 200u);
    EXPECT_EQ(picture.info.region_height, 150u);
}

TEST(UnusualScenes, CameraInsideGlassSeesThroughIt) {
    // Rays from the centre of a ball leave it without refraction.
    for (const char *mode : {"tree", "path"}) {
        SceneBuilder builder({.max_depth = 40, .background = glm::vec3(0.5f)});
        arhost_material glass = glass_of(1.5f);
        set3(glass.cutoff_colour, 0.5f, 0.5f, 0.5f);
        glass.reflection_depth = glass.refraction_depth = 40;
        builder.add_ball("ball", {0, 0, 0, 50}, glass);
        const Picture picture = Tracer(std::move(builder), {{"glass", mode}}).render(opencv_axes(pinhole()));
        for (const Pixel &pixel : picture.pixels()) {
            ASSERT_EQ(pixel[3], 255) << mode;
            ASSERT_TRUE(is_code_of(pixel[0], 0.5, 2e-3)) << mode;
        }
    }
}

// ---- Rejected input --------------------------------------------------------------------------------

TEST(Render, RejectsInvalidCameras) {
    expect_invalid_cameras_are_rejected("rt_embree", 1e19);
}

TEST(Render, RejectsInvalidIntrinsics) {
    expect_invalid_intrinsics_are_rejected("rt_embree");
}

TEST(Render, FailsOnceCancelled) {
    expect_cancelled_calls_fail("rt_embree");
}

TEST(Plugin, DeclaresLensDistortionSupport) {
    const arhost_descriptor &descriptor = PluginUnderTest("rt_embree").descriptor();
    EXPECT_EQ(descriptor.kind, ARHOST_KIND_RAYTRACER);
    EXPECT_STREQ(descriptor.id, "org.arhost.rt_embree");
    EXPECT_TRUE(descriptor.capabilities & ARHOST_RAYTRACER_CAPABILITY_LENS_DISTORTION);
}

TEST(Plugin, CanBeRestartedAfterStop) {
    Tracer tracer(busy_scene());
    const auto first = tracer.render(from_the_side()).pixels();
    tracer.render(opencv_axes(pinhole(64, 48)));
    EXPECT_EQ(tracer.render(from_the_side()).pixels(), first);
}

} // namespace

class LargeSurfaces : public testing::TestWithParam<LargeSurface> {};
INSTANTIATE_TEST_SUITE_P(All, LargeSurfaces, testing::ValuesIn(large_surfaces),
                         [](const auto &info) { return info.param.name; });

TEST_P(LargeSurfaces, DoNotShadowThemselves) {
    EXPECT_EQ(pixels_out_of_light(GetParam(), "rt_embree"), 0);
}

TEST(LargeFloor, KeepsShadowsOfThinObjectsOnIt) {
    for (const float side_mm : {1e2f, 1e6f})
        EXPECT_TRUE(has_its_shadow(Tracer(plate_on_floor(side_mm)).render(camera_over_plate()))) << side_mm;
}

} // namespace arhost::test
