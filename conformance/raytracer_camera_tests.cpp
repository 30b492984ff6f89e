// SPDX-License-Identifier: Apache-2.0
// Projection. With one sample per pixel, a centroid has an error of some hundredths of a pixel, so narrow bounds
// apply to means over several positions.
#include "conformance/expect.hpp"
#include "conformance/projection.hpp"
#include "conformance/tracer.hpp"

#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>

namespace arhost::conformance {
namespace {

glm::dvec2 find_centroid(const Picture &picture) {
    const auto at = centroid(picture);
    if (!at)
        throw Failure("a sphere in view is not visible: no alpha is 128 or more").with("rendered", picture);
    return *at;
}

void expect_near(const glm::dvec2 &actual, const glm::dvec2 &expected, double tolerance, const std::string &object,
                 const Picture &picture) {
    if (glm::length(actual - expected) > tolerance)
        throw Failure(fmt::format("{} is at ({:.3f}, {:.3f}) px; expected ({:.3f}, {:.3f})", object, actual.x,
                                  actual.y, expected.x, expected.y))
            .with("rendered", picture)
            .at(static_cast<unsigned>(std::max(0.0, std::round(actual.x))),
                static_cast<unsigned>(std::max(0.0, std::round(actual.y))));
}

void pixel_centres(Context &context) {
    // Cameras in pairs, symmetric about the axis: the mean centroid is on the axis even if the image is mirrored.
    constexpr int pairs = 10;
    Tracer tracer(context, one_sphere({0, 0, 0, 30}));
    glm::dvec2 sum(0);
    for (int i = 0; i < pairs; ++i) {
        const glm::dvec3 aside(context.uniform(-3, 3), context.uniform(-3, 3), 0);
        for (const double sign : {1.0, -1.0}) {
            const glm::dvec3 eye = glm::dvec3(0, 0, 200) + sign * aside;
            sum += find_centroid(tracer.render(camera(eye, eye - glm::dvec3(0, 0, 200), {0, 1, 0})));
        }
    }
    const glm::dvec2 mean = sum / (2.0 * pairs);
    if (std::abs(mean.x - 79.5) > 0.02 || std::abs(mean.y - 59.5) > 0.02)
        throw Failure(fmt::format("the mean centroid of spheres around the axis of a 160×120 image is ({:.3f}, "
                                  "{:.3f}); expected (79.5, 59.5): pixel centres are at integers",
                                  mean.x, mean.y));
}

void focal_length(Context &context) {
    arhost_intrinsics in = pinhole(200, 120, 200);
    in.fy = 150;
    Tracer tracer(context, one_sphere({0, 0, 0, 18}));
    const auto distance = [&](const glm::dvec3 &half) {
        const auto at = [&](const glm::dvec3 &aside) {
            const glm::dvec3 eye = glm::dvec3(0, 0, 200) + aside;
            const arhost_camera view = camera(eye, eye - glm::dvec3(0, 0, 200), {0, 1, 0}, in);
            return std::pair(find_centroid(tracer.render(view)), silhouette_centroid(view, {0, 0, 0}, 18));
        };
        const auto [actual_a, expected_a] = at(half);
        const auto [actual_b, expected_b] = at(-half);
        return std::pair(glm::length(actual_a - actual_b), glm::length(expected_a - expected_b));
    };
    for (const auto &[half, name] : {std::pair(glm::dvec3(75, 0, 0), "fx"), {glm::dvec3(0, 40, 0), "fy"}}) {
        const auto [actual, expected] = distance(half);
        if (std::abs(actual - expected) > 0.2)
            throw Failure(fmt::format("two positions of a sphere are {:.2f} px apart; expected {:.2f}: {} is not {}",
                                      actual, expected, name, name[1] == 'x' ? in.fx : in.fy));
    }
}

void orientation(Context &context) {
    const Picture picture = Tracer(context, one_sphere({35, 20, 0, 12})).render(from_front());
    const glm::dvec2 actual = find_centroid(picture);
    const glm::dvec2 expected = silhouette_centroid(from_front(), {35, 20, 0}, 12);
    if (glm::length(actual - expected) > 4)
        throw Failure(fmt::format("a sphere to the right of and above the axis is at ({:.1f}, {:.1f}) px; expected "
                                  "({:.1f}, {:.1f}): the first row is at the top",
                                  actual.x, actual.y, expected.x, expected.y))
            .with("rendered", picture)
            .at(static_cast<unsigned>(actual.x), static_cast<unsigned>(actual.y));
}

void principal_point(Context &context) {
    arhost_intrinsics in = pinhole();
    in.cx = 50;
    in.cy = 80;
    const Picture picture = Tracer(context, one_sphere({0, 0, 0, 20})).render(from_front(in));
    expect_near(find_centroid(picture), {50, 80}, 1, "the sphere on the axis", picture);
}

void eye_look_at_up(Context &context) {
    constexpr double radius = 18;
    const glm::dvec3 centre(12, -7, 21);
    Tracer tracer(context, one_sphere(glm::vec4(centre, radius)));
    const auto direction = [&] { // uniform on the unit sphere
        for (;;) {
            const glm::dvec3 d(context.uniform(-1, 1), context.uniform(-1, 1), context.uniform(-1, 1));
            if (const double length = glm::length(d); length > 0.1 && length <= 1)
                return d / length;
        }
    };
    constexpr int count = 16;
    glm::dvec2 sum(0);
    for (int i = 0; i < count;) {
        // The vectors are deliberately neither normalized nor perpendicular.
        const glm::dvec3 eye = centre + 200.0 * direction();
        const glm::dvec3 look_at = eye + (centre - eye) * context.uniform(0.1, 2) + 40.0 * direction();
        const arhost_camera view = camera(eye, look_at, direction() * context.uniform(0.1, 5));
        const glm::dvec3 seen = in_camera(view, centre);
        const glm::dvec2 expected = silhouette_centroid(view, centre, radius);
        const double off = glm::length(expected - glm::dvec2(79.5, 59.5));
        if (seen.z < 100 || std::abs(expected.x - 79.5) > 55 || std::abs(expected.y - 59.5) > 35 || off < 30 ||
            glm::length(glm::cross(glm::normalize(look_at - eye), glm::dvec3(view.up[0], view.up[1], view.up[2]))) <
                0.2)
            continue; // partially out of view, or too close to the axis to be significant
        const Picture picture = tracer.render(view);
        const glm::dvec2 actual = find_centroid(picture);
        expect_near(actual, expected, 0.25,
                    fmt::format("from eye ({:.1f}, {:.1f}, {:.1f}) the sphere", eye.x, eye.y, eye.z), picture);
        sum += actual - expected;
        ++i;
    }
    const glm::dvec2 mean = sum / static_cast<double>(count);
    if (glm::length(mean) > 0.04)
        throw Failure(fmt::format("over {} cameras, the mean offset of a sphere from its analytic projection is "
                                  "({:.3f}, {:.3f}) px; the limit is 0.04 px",
                                  count, mean.x, mean.y));
}

void lens(Context &context) {
    if (!(context.library.descriptor().capabilities & ARHOST_RAYTRACER_CAPABILITY_LENS_DISTORTION))
        throw Skip("ARHOST_RAYTRACER_CAPABILITY_LENS_DISTORTION is not declared");
    arhost_intrinsics in = pinhole();
    in.distortion = ARHOST_DISTORTION_BROWN;
    in.coefficient_count = 4;
    const double coefficients[] = {-0.3, 0.1, 0.02, -0.03};
    std::copy(std::begin(coefficients), std::end(coefficients), in.coefficients);
    Tracer tracer(context, one_sphere({0, 0, 0, 14}));
    for (const glm::dvec3 &aside : {glm::dvec3(48, 30, 0), {-48, 30, 0}, {50, -5, 0}, {-20, -33, 0}}) {
        const glm::dvec3 eye = glm::dvec3(0, 0, 200) + aside;
        const arhost_camera view = camera(eye, eye - glm::dvec3(0, 0, 200), {0, 1, 0}, in);
        const Picture picture = tracer.render(view);
        expect_near(find_centroid(picture), silhouette_centroid(view, {0, 0, 0}, 14), 0.3,
                    "with Brown's lens model, the sphere", picture);
    }
}

void crop(Context &context) {
    Tracer tracer(context, still_life());
    const Picture whole = tracer.render(still_life_camera());
    arhost_intrinsics part = pinhole();
    constexpr std::uint32_t x0 = 41, y0 = 30;
    part.width = 77;
    part.height = 61;
    part.cx -= x0;
    part.cy -= y0;
    const Picture cropped = tracer.render(still_life_camera(part));
    Picture expected(part.width, part.height);
    for (std::uint32_t y = 0; y < part.height; ++y)
        for (std::uint32_t x = 0; x < part.width; ++x)
            expected.set(x, y, whole.at(x + x0, y + y0));
    expect_alike(cropped, expected, "the image of a camera for a crop differs from that crop", 3, 0.01);
}

void moved_with_camera(Context &context) {
    glm::dmat4 moved = glm::translate(glm::dmat4(1), glm::dvec3(300, -200, 150));
    moved = glm::rotate(moved, context.uniform(0.5, 2), glm::normalize(glm::dvec3(1, -2, 0.5)));
    const Picture here = Tracer(context, still_life()).render(still_life_camera());
    const Picture there = Tracer(context, still_life(glm::mat4(moved))).render(still_life_camera(pinhole(), moved));
    expect_alike(there, here, "moving the scene together with its camera changes the image", 3, 0.01);
}

void moving_object(Context &context) {
    need_capability(context, ARHOST_RAYTRACER_CAPABILITY_MOTION, "MOTION");
    constexpr double radius = 15;
    scene::ArenaBuilder builder;
    builder.settings.ambient = glm::vec3(1);
    builder.settings.duration_s = 1;
    scene::MotionNode node;
    node.animated = true;
    scene::Motion motion;
    motion.moves = true;
    motion.node = builder.add_node(node);
    builder.add_object("ball", builder.add_spheres({{0, 0, 0, radius}}),
                       builder.add_material(glowing(glm::vec3(0.5f))), ARHOST_ROLE_VIRTUAL, glm::mat4x3(1), motion);
    Tracer tracer(context, std::move(builder));
    for (const double mm : {0.0, 15.0, 30.0})
        for (const glm::dvec3 &to : {glm::dvec3(mm, mm / 2, 0), glm::dvec3(-mm, -mm / 2, 0)}) {
            arhost_moved_object moved{0, 1, {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}};
            for (int i = 0; i < 3; ++i)
                moved.world_from_object[9 + i] = static_cast<float>(to[i]);
            const arhost_motion now{sizeof now, 1, &moved, nullptr, 0, 0};
            const Picture picture = tracer.render(from_front(), &now);
            const glm::dvec2 actual = find_centroid(picture) - glm::dvec2(79.5, 59.5);
            const double expected =
                glm::length(silhouette_centroid(from_front(), to, radius) - glm::dvec2(79.5, 59.5));
            if (std::abs(glm::length(actual) - expected) > 2)
                throw Failure(
                    fmt::format("an object moved by {:.1f} mm is {:.1f} px from the centre; expected {:.1f}",
                                glm::length(to), glm::length(actual), expected))
                    .with("rendered", picture);
            moved.is_visible = 0;
            const Picture hidden = tracer.render(from_front(), &now);
            for (std::uint32_t y = 0; y < hidden.height(); ++y)
                for (std::uint32_t x = 0; x < hidden.width(); ++x)
                    if (hidden.alpha(x, y) != 0)
                        throw Failure(fmt::format("an object that is not visible is drawn at ({}, {})", x, y))
                            .with("rendered", hidden);
        }
}

constexpr const char *gate = "raytracer.render";
constexpr Test tests[] = {
    {"raytracer.pixel-centres", "Rays pass through pixel centres, at integer coordinates, accurate to 0.02 px.", gate,
     30s, pixel_centres},
    {"raytracer.focal-length", "fx and fy of the intrinsics are used.", gate, 20s, focal_length},
    {"raytracer.orientation", "The image is not mirrored; its first row is at the top.", gate, 20s, orientation},
    {"raytracer.principal-point", "The optical axis projects to the principal point.", gate, 20s, principal_point},
    {"raytracer.eye-look-at-up", "For any eye, look-at and up, a sphere is at its analytic projection.", gate, 30s,
     eye_look_at_up},
    {"raytracer.lens", "If LENS_DISTORTION is declared, rays are distorted by Brown's model.", gate, 20s, lens},
    {"raytracer.crop", "A camera with the intrinsics of a crop renders that crop.", gate, 20s, crop},
    {"raytracer.moved-with-camera", "A scene moved together with its camera looks the same.", gate, 20s,
     moved_with_camera},
    {"raytracer.moving-object", "Objects move, and are hidden, as the request's motion specifies.", gate, 20s,
     moving_object},
};

} // namespace

std::span<const Test> raytracer_camera_tests() {
    return tests;
}

} // namespace arhost::conformance
