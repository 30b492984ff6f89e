// SPDX-License-Identifier: Apache-2.0
// The video of the request. All other tests of ray tracers run without video.
#include "conformance/expect.hpp"
#include "conformance/projection.hpp"
#include "conformance/tracer.hpp"

#include <array>
#include <cstring>

namespace arhost::conformance {
namespace {

void need_video(Context &context) {
    need_capability(context, ARHOST_RAYTRACER_CAPABILITY_VIDEO, "VIDEO");
    need_capability(context, ARHOST_RAYTRACER_CAPABILITY_REFLECTION, "REFLECTION");
}

// A mirror that stands upright on a filmed table, under a lamp that shines straight down: it neither shadows nor
// lights the table.
scene::ArenaBuilder mirror_on_a_table() {
    scene::ArenaBuilder builder = path_scene();
    add_table(builder);
    builder.add_object("mirror",
                       builder.add_triangles({{{-60, 40, 0}, {60, 40, 0}, {0, 40, 120}}, {}, {}, {{0, 1, 2}}}),
                       builder.add_material(mirror(1)));
    arhost_light sun = scene::make_light(ARHOST_LIGHT_DIRECTIONAL);
    sun.falloff = ARHOST_FALLOFF_NONE;
    builder.add_light(sun);
    return builder;
}

arhost_camera view() {
    return camera({0, -150, 100}, {0, 0, 0}, {0, 0, 1});
}

// Brighter to the right, bluer to the bottom.
Video ramps(arhost_pixel_format format, bool is_dark = false) {
    return Video(format, view().intrinsics.width, view().intrinsics.height, [=](std::uint32_t x, std::uint32_t y) {
        const auto code = [](std::uint32_t value) { return static_cast<std::uint8_t>(value); };
        return is_dark ? Video::Rgb{20, 40, 10} : Video::Rgb{code(60 + x), 90, code(60 + y)};
    });
}

// An image in the form that the host would ask for, over mid-grey video.
Picture seen(Context &context, Tracer &tracer) {
    tracer.set_compositing(ARHOST_COMPOSITING_LINEAR);
    return has_capability(context, ARHOST_RAYTRACER_CAPABILITY_LINEAR_IMAGES) ? tracer.render_linear(view()).shown()
                                                                              : tracer.render(view());
}

void expect_mirrored(Context &context, const Video &video, const char *format) {
    Tracer tracer(context, mirror_on_a_table());
    tracer.set_video(&video);
    const Picture picture = seen(context, tracer);
    for (const double x : {-20.0, 20.0})
        for (const double y : {0.0, 15.0}) {
            // Behind the mirror at y = 40, the table before it seems to be at 80 − y.
            const auto pixel_of = [&](double at) {
                const glm::dvec2 p = project(view().intrinsics, in_camera(view(), {x, at, 0}));
                return std::array{static_cast<std::uint32_t>(std::lround(p.x)),
                                  static_cast<std::uint32_t>(std::lround(p.y))};
            };
            const auto [at_x, at_y] = pixel_of(80 - y);
            const auto [of_x, of_y] = pixel_of(y);
            const Video::Rgb expected = video.colour(of_x, of_y);
            const Pixel actual = picture.at(at_x, at_y);
            for (std::size_t channel = 0; channel < 3; ++channel)
                if (std::abs(actual[channel] - expected[channel]) > 5)
                    throw Failure(
                        fmt::format("pixel ({}, {}): a mirror shows the filmed table at pixel ({}, {}) of "
                                    "the {} video, whose codes there are ({}, {}, {}); expected them, it is "
                                    "{}",
                                    at_x, at_y, of_x, of_y, format, expected[0], expected[1], expected[2],
                                    text_of(actual)))
                        .with("rendered", picture)
                        .at(at_x, at_y);
        }
}

void mirrors_the_video(Context &context) {
    need_video(context);
    expect_mirrored(context, ramps(ARHOST_PIXEL_FORMAT_BGR8), "BGR8");
    expect_mirrored(context, ramps(ARHOST_PIXEL_FORMAT_BGR8, true), "BGR8");
}

void formats(Context &context) {
    need_video(context);
    struct Format {
        arhost_pixel_format format;
        const char *name;
    };
    for (const Format &one : {Format{ARHOST_PIXEL_FORMAT_RGB8, "RGB8"},
                              {ARHOST_PIXEL_FORMAT_GREY8, "GREY8"},
                              {ARHOST_PIXEL_FORMAT_YUYV, "YUYV (BT.601, full range)"},
                              {ARHOST_PIXEL_FORMAT_NV12, "NV12 (BT.709, limited range)"},
                              {ARHOST_PIXEL_FORMAT_I420, "I420 (BT.601, full range)"}})
        expect_mirrored(context, ramps(one.format), one.name);
}

void own_frame(Context &context) {
    need_video(context);
    const Video bright = ramps(ARHOST_PIXEL_FORMAT_BGR8), dark = ramps(ARHOST_PIXEL_FORMAT_BGR8, true);
    const auto render = [&](Tracer &tracer, const Video *video) {
        tracer.set_video(video);
        return seen(context, tracer);
    };
    const auto render_anew = [&](const Video *video) {
        Tracer tracer(context, mirror_on_a_table());
        return render(tracer, video);
    };
    const Picture of_bright = render_anew(&bright), of_dark = render_anew(&dark), of_none = render_anew(nullptr);
    Tracer tracer(context, mirror_on_a_table());
    expect_alike(render(tracer, &bright), of_bright,
                 "the same request with video gives different bytes in another instance");
    expect_alike(render(tracer, &dark), of_dark, "the image depends on the video of the previous request");
    expect_alike(render(tracer, &bright), of_bright,
                 "the same request with video gives different bytes the second time");
    expect_alike(render(tracer, nullptr), of_none, "restarted without video, the image depends on the video before");
}

// A white triangle that fills the view, in an environment of one colour.
scene::ArenaBuilder in_an_environment(const std::array<float, 3> &radiance, bool follows_video) {
    scene::ArenaBuilder builder = path_scene();
    builder.add_object(
        "white", builder.add_triangles({{{-900, 40, -900}, {900, 40, -900}, {0, 40, 900}}, {}, {}, {{0, 1, 2}}}),
        builder.add_material(diffuse(glm::vec3(0.8f))));
    const std::array<float, 4> texel{radiance[0], radiance[1], radiance[2], 1};
    scene::TexelImage image{ARHOST_TEXEL_RGBA32F, 1, 1, scene::Texels::of_size(sizeof texel)};
    std::memcpy(image.texels.bytes.get(), texel.data(), sizeof texel);
    builder.environment.texture = builder.add_texture("sky", std::move(image), {.wrap_v = ARHOST_WRAP_CLAMP});
    builder.environment.rows = builder.environment.columns = {1};
    builder.environment.follows_video = follows_video;
    return builder;
}

void environment(Context &context) {
    need_capability(context, ARHOST_RAYTRACER_CAPABILITY_ENVIRONMENT, "ENVIRONMENT");
    const auto expect_scale = [&](const Video *video, const std::array<float, 3> &scale, const char *violation) {
        Tracer following(context, in_an_environment({0.5f, 0.5f, 0.5f}, true)),
            fixed(context, in_an_environment({0.5f * scale[0], 0.5f * scale[1], 0.5f * scale[2]}, false));
        following.set_video(video);
        fixed.set_video(video);
        expect_alike(seen(context, following), seen(context, fixed), violation, 2);
    };
    expect_scale(nullptr, {0.18f, 0.18f, 0.18f},
                 "without video, an environment that follows it is not 0.18 times its map");
    if (!has_capability(context, ARHOST_RAYTRACER_CAPABILITY_VIDEO))
        return;
    const Video video(ARHOST_PIXEL_FORMAT_BGR8, view().intrinsics.width, view().intrinsics.height,
                      [](std::uint32_t, std::uint32_t) {
                          return Video::Rgb{220, 188, 137};
                      });
    // srgb_decode() of 220, 188 and 137, divided by 255: 0.716, 0.503 and 0.250. Their luminance is 0.530.
    expect_scale(&video, {0.623f, 0.517f, 0.390f},
                 "an environment that follows the video does not have half the saturation of its mean colour");
}

constexpr const char *gate = "raytracer.render";
constexpr Test tests[] = {
    {"raytracer.video-mirror", "If VIDEO is declared, mirrors show the video where they reflect filmed surfaces.",
     gate, 20s, mirrors_the_video},
    {"raytracer.video-formats", "Video of every pixel format, YUV matrix and range has its colours.", gate, 20s,
     formats},
    {"raytracer.video-frame", "An image depends on the video of its own request only.", gate, 20s, own_frame},
    {"raytracer.video-environment",
     "Environments that follow the video are multiplied by its mean colour with half the saturation, or by 0.18 "
     "without "
     "video.",
     gate, 20s, environment},
};

} // namespace

std::span<const Test> raytracer_video_tests() {
    return tests;
}

} // namespace arhost::conformance
