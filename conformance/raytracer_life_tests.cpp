// SPDX-License-Identifier: Apache-2.0
// Life cycle of a ray tracer: restarts, rejected input, cancellation and unusual scenes.
#include "conformance/cancelling.hpp"
#include "conformance/expect.hpp"
#include "conformance/frame_times.hpp"
#include "conformance/process_usage.hpp"
#include "conformance/tracer.hpp"

#include <glm/gtc/matrix_transform.hpp>

#include <limits>

namespace arhost::conformance {
namespace {

void start(Context &context) {
    Tracer tracer(context, one_sphere({0, 0, 0, 30}));
    tracer.start(pinhole());
}

void render(Context &context) {
    Tracer(context, one_sphere({0, 0, 0, 30})).render(from_front());
}

void start_again(Context &context) {
    Tracer tracer(context, one_sphere({0, 0, 0, 30}));
    tracer.render(from_front());
    tracer.change_scene(still_life());
    const arhost_intrinsics smaller = pinhole(90, 70, 110);
    expect_alike(tracer.render(still_life_camera(smaller)),
                 Tracer(context, still_life()).render(still_life_camera(smaller)),
                 "restarted with another scene and size, its image differs from that of a new instance", 1);
}

void leaks(Context &context) {
    Tracer tracer(context, still_life());
    expect_no_leak([&](int frames) {
        for (int frame = 0; frame < frames; ++frame)
            tracer.render(still_life_camera(pinhole(40, 30, 50)));
        tracer.stop();
    });
}

// ---- Rejected input --------------------------------------------------------------------------------

void parallel_up(Context &context) {
    Tracer tracer(context, one_sphere({0, 0, 0, 30}));
    tracer.start(pinhole());
    Picture picture(160, 120);
    arhost_render_info info;
    for (const glm::dvec3 &up : {glm::dvec3(0, 0, 1), {0, 0, -3}, {0, 0, 0}})
        if (const arhost_status status = tracer.try_render(camera({0, 0, 200}, {0, 0, 0}, up), picture, info);
            status != ARHOST_STATUS_ERROR_INVALID_ARGUMENT)
            throw Failure(
                fmt::format("looking along −z with up (0, 0, {}), render returned {}; expected INVALID_ARGUMENT",
                            up.z, status_name(status)));
    tracer.render(from_front()); // must still work
}

void not_finite(Context &context) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN(),
                     infinity = std::numeric_limits<double>::infinity();
    Tracer tracer(context, one_sphere({0, 0, 0, 30}));
    const Picture before = tracer.render(from_front());
    Picture picture(160, 120);
    arhost_render_info info;
    for (const arhost_camera &view :
         {camera({nan, 0, 200}, {0, 0, 0}, {0, 1, 0}), camera({0, 0, 200}, {0, infinity, 0}, {0, 1, 0}),
          camera({0, 0, 200}, {0, 0, 0}, {0, nan, 0})})
        if (const arhost_status status = tracer.try_render(view, picture, info);
            status != ARHOST_STATUS_ERROR_INVALID_ARGUMENT && status != ARHOST_STATUS_OK)
            throw Failure(fmt::format(
                "with a camera with non-finite numbers, render returned {}; expected INVALID_ARGUMENT or OK",
                status_name(status)));
    expect_alike(tracer.render(from_front()), before, "after a camera with non-finite numbers, the image differs", 1);
}

void cancelled(Context &context) {
    Tracer running(context, still_life()), starting(context, still_life());
    running.start(pinhole());
    running.instance().host().cancel();
    Picture picture(160, 120);
    arhost_render_info info;
    expect_ok_or_cancelled("render", running.try_render(still_life_camera(), picture, info));
    starting.instance().host().cancel();
    expect_ok_or_cancelled("start", starting.try_start(pinhole()));
}

// The inside of a mirror sphere, where every ray reaches the maximum depth.
scene::ArenaBuilder hall_of_mirrors() {
    scene::ArenaBuilder builder = one_sphere({0, 0, 0, 300}, mirror(1));
    builder.settings.max_depth = scene::max_depth_limit;
    return builder;
}

void cancel_while_rendering(Context &context) {
    for (const char *const *need = context.library.descriptor().needs; need && *need; ++need)
        if (*need == std::string_view("gpu"))
            throw Skip("it needs 'gpu', and work submitted to a GPU cannot be cancelled");
    const arhost_intrinsics large = pinhole(1920, 1440, 1600); // takes seconds on a CPU
    Tracer tracer(context, hall_of_mirrors());
    tracer.start(large);
    Picture picture(large.width, large.height);
    arhost_render_info info;
    expect_to_be_cancelled(context, tracer.instance().host(), "render",
                           [&] { return tracer.try_render(from_front(large), picture, info); });
}

// ---- Quality ---------------------------------------------------------------------------------------

void max_samples(Context &context) {
    Tracer tracer(context, still_life(), many_samples(context));
    const Picture whole = tracer.render(still_life_camera());
    const std::uint32_t full = tracer.info().full_samples;
    if (full == 0)
        throw Skip("it ignores max_samples: its full_samples is 0");
    const auto render = [&](std::uint32_t limit) {
        tracer.limit_samples(limit);
        Picture picture = tracer.render(still_life_camera());
        if (const std::uint32_t now = tracer.info().full_samples; now != full)
            throw Failure(
                fmt::format("with max_samples {}, full_samples is {}; without a limit, it was {}", limit, now, full));
        return picture;
    };
    if (full > 1 && !first_difference(render(1), whole, 0))
        throw Failure(fmt::format("its full_samples is {}, but an image with max_samples 1 is the same", full));
    for (const std::uint32_t limit : {0u, full, std::max(full, full + 1)})
        expect_alike(render(limit), whole,
                     fmt::format("with max_samples {} instead of 0, the image differs, although full_samples is {}",
                                 limit, full));
}

// Each face of the box has another brightness, and the lamp is so near that the brightness varies on each.
scene::ArenaBuilder box_near_a_lamp() {
    scene::ArenaBuilder builder = path_scene();
    const glm::mat4 turned = glm::rotate(glm::mat4(1), 0.5f, glm::vec3(0, 0, 1));
    builder.add_object("box", builder.add_triangles(box({35, 25, 20})),
                       builder.add_material(diffuse(glm::vec3(0.8f))), ARHOST_ROLE_VIRTUAL, glm::mat4x3(turned));
    builder.add_light(lamp({60, -120, 90}, 1));
    return builder;
}

void shading(Context &context) {
    Tracer tracer(context, box_near_a_lamp(), many_samples(context));
    tracer.set_compositing(ARHOST_COMPOSITING_LINEAR);
    std::optional<std::uint32_t> coarsest;
    const auto render = [&](std::uint32_t shading_px) {
        tracer.set_shading(shading_px);
        Picture picture = tracer.render(still_life_camera());
        const std::uint32_t now = tracer.info().coarsest_shading_px;
        if (now != coarsest.value_or(now))
            throw Failure(fmt::format("with shading_px {}, coarsest_shading_px is {}; before, it was {}", shading_px,
                                      now, *coarsest));
        coarsest = now;
        return picture;
    };
    const Picture whole = render(0);
    if (*coarsest < 2)
        throw Skip(fmt::format("it ignores shading_px: its coarsest_shading_px is {}", *coarsest));
    const Picture coarse = render(2);
    if (!first_difference(coarse, whole, 0))
        throw Failure(
            fmt::format("its coarsest_shading_px is {}, but an image with shading_px 2 is the same", *coarsest));
    expect_alike(coarse, whole,
                 "with shading_px 2, edges must keep their resolution, and pixels that are not shaded have about the "
                 "colour of those around",
                 40);
    for (const std::uint32_t all : {1u, 0u})
        expect_alike(render(all), whole,
                     fmt::format("after an image with shading_px 2, one with shading_px {} differs", all));
}

// ---- Unusual scenes --------------------------------------------------------------------------------

// Expects that only a sphere of this radius, at the image's centre, is visible.
void expect_sphere(const Picture &picture, double radius_px, const char *scene) {
    expect_pixels(picture, [&](auto x, auto y) {
        const double r = distance_from_centre(picture, x, y);
        const int alpha = picture.alpha(x, y);
        if (r < radius_px - 2 && alpha < 250)
            return fmt::format("{}, the sphere is not visible: alpha is {}", scene, alpha);
        if (r > radius_px + 2 && alpha > 2)
            return fmt::format("{}, something is visible outside the sphere: alpha is {}", scene, alpha);
        return std::string();
    });
}

void degenerate(Context &context) {
    scene::ArenaBuilder builder = one_sphere({0, 0, 0, 30});
    scene::TriangleMesh slivers{
        {{-50, 45, 40}, {0, 45, 40}, {50, 45, 40}, {45, 20, 0}}, {}, {}, {{3, 3, 3}, {0, 0, 1}, {2, 1, 2}}};
    const std::uint32_t material = builder.add_material(diffuse(glm::vec3(1)));
    builder.add_object("slivers", builder.add_triangles(slivers), material);
    slivers.normals.assign(4, {0, 0, 1});
    builder.add_object("smooth slivers", builder.add_triangles(slivers), material);
    builder.add_light(lamp({0, 0, 200}, 1));
    expect_sphere(Tracer(context, std::move(builder)).render(from_front()), 30,
                  "with degenerate triangles in the scene");
}

void far_away(Context &context) {
    // Distance and size have the same factor, so the image is the same.
    constexpr double factor = 5000;
    const arhost_camera view = camera(glm::dvec3(0, 0, 200) * factor, {0, 0, 0}, {0, 1, 0});
    expect_sphere(Tracer(context, one_sphere(glm::vec4(0, 0, 0, 30) * static_cast<float>(factor))).render(view), 30,
                  "in a scene scaled to 1 km");
}

// ---- Speed -----------------------------------------------------------------------------------------

void speed(Context &context) {
    Tracer tracer(context, still_life());
    const arhost_camera view = still_life_camera(pinhole(640, 480, 800));
    tracer.render(view);
    check_speed(context, 640, 480, frame_times_ms([&] { return tracer.render(view), true; }), 250);
}

constexpr Test tests[] = {
    {"raytracer.start", "It starts on a scene in read-only memory, and stops.", "abi.create", 30s, start},
    {"raytracer.render", "It renders an image of a scene in read-only memory.", "raytracer.start", 30s, render},
    {"raytracer.start-again", "After stop, it starts with another scene and another size.", "raytracer.render", 30s,
     start_again},
    {"raytracer.leaks", "Frames, starts and stops leak no descriptors, threads or memory.", "raytracer.render", 60s,
     leaks},
    {"raytracer.parallel-up", "An up vector parallel to the view is rejected with INVALID_ARGUMENT.",
     "raytracer.render", 20s, parallel_up},
    {"raytracer.not-finite",
     "A camera with non-finite numbers is rejected or rendered, and the next image is correct.", "raytracer.render",
     20s, not_finite},
    {"raytracer.cancelled", "After cancellation, start and render promptly return OK or CANCELLED.",
     "raytracer.render", 20s, cancelled},
    {"raytracer.cancel-while-rendering",
     "When cancelled during a large image, render returns within 2 s; not checked on GPUs.", "raytracer.cancelled",
     30s, cancel_while_rendering},
    {"raytracer.max-samples",
     "With `max_samples`, an image takes the smaller of this number and `full_samples`, which does not depend on it.",
     "raytracer.render", 20s, max_samples},
    {"raytracer.shading",
     "With `shading_px` 2, edges keep their resolution; `coarsest_shading_px` and later images do not depend on it.",
     "raytracer.render", 20s, shading},
    {"raytracer.degenerate", "Degenerate triangles do not affect the image.", "raytracer.render", 20s, degenerate},
    {"raytracer.far-away", "Scaling scene and camera from 0.2 m to 1 km does not change the image.",
     "raytracer.render", 20s, far_away},
    {"raytracer.speed", "The median time of render at 640×480 is at most 250 ms; otherwise a warning.",
     "raytracer.render", 120s, speed},
};

} // namespace

std::span<const Test> raytracer_life_tests() {
    return tests;
}

} // namespace arhost::conformance
