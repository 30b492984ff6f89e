// SPDX-License-Identifier: Apache-2.0
// Linear images: their memory, their numbers, and the light that they represent.
#include "conformance/expect.hpp"
#include "conformance/tracer.hpp"

#include <arhost/shading/scalar.hpp>

#include <array>
#include <vector>

namespace arhost::conformance {
namespace {

constexpr double rim = 1.5; // px on each side of a silhouette that are not checked
// A sphere of radius 30 at the origin, seen from (0, 0, 200): its silhouette has this radius.
const double silhouette = 200 * 30 / std::sqrt(200.0 * 200 - 30 * 30);
constexpr std::array channel_names = {"red", "green", "blue"};

void need_linear_images(Context &context) {
    need_capability(context, ARHOST_RAYTRACER_CAPABILITY_LINEAR_IMAGES, "LINEAR_IMAGES");
}

scene::ArenaBuilder emissive_sphere(const glm::vec3 &radiance) {
    scene::ArenaBuilder builder = path_scene();
    builder.add_object("sphere", builder.add_spheres({{0, 0, 0, 30}}), builder.add_material(emissive(radiance)));
    return builder;
}

// A ball above a catcher, in a room of the radiance 0.5 without lamps: the light on both is noisy.
scene::ArenaBuilder ball_in_a_room() {
    scene::ArenaBuilder builder = path_scene(0.5f);
    add_table(builder);
    builder.add_object("ball", builder.add_spheres({{0, 0, 25, 20}}), builder.add_material(diffuse(glm::vec3(0.8f))));
    return builder;
}

arhost_light sun(const glm::vec3 &direction, const glm::vec3 &intensity) {
    arhost_light light = scene::make_light(ARHOST_LIGHT_DIRECTIONAL);
    for (int axis = 0; axis < 3; ++axis) {
        light.direction[axis] = direction[axis];
        light.intensity[axis] = intensity[axis];
    }
    return light;
}

// A channel's mean over 5 × 5 pixels. `get`: LinearPicture::added or transmittance.
double mean_of(const LinearPicture &picture, double (LinearPicture::*get)(std::uint32_t, std::uint32_t, int) const,
               std::uint32_t x, std::uint32_t y, int channel) {
    double sum = 0;
    for (std::uint32_t j = y - 2; j <= y + 2; ++j)
        for (std::uint32_t i = x - 2; i <= x + 2; ++i)
            sum += (picture.*get)(i, j, channel) / 25;
    return sum;
}

// ---- Memory ----------------------------------------------------------------------------------------

struct Size {
    std::uint32_t width, height;
};
constexpr Size sizes[] = {{160, 120}, {1, 1}, {17, 13}, {1, 40}, {67, 1}};

void writes_every_pixel(Context &context) {
    need_linear_images(context);
    for (const Size &size : sizes) {
        const arhost_camera view = from_front(pinhole(size.width, size.height));
        Tracer tracer(context, emissive_sphere(glm::vec3(0.5f)));
        const LinearPicture on_zeros = tracer.render_linear(view, 0x00), on_ones = tracer.render_linear(view, 0xff);
        expect_pixels(on_zeros, [&](auto x, auto y) {
            const auto is_kept = [](std::uint16_t first, std::uint16_t second) {
                return first == 0 && second == 0xffff;
            };
            const LinearPixel p = on_zeros.at(x, y), q = on_ones.at(x, y);
            bool is_any_kept = is_kept(p.reserved_0, q.reserved_0) || is_kept(p.reserved_1, q.reserved_1);
            for (int channel = 0; channel < 3; ++channel)
                is_any_kept = is_any_kept || is_kept(p.added[channel], q.added[channel]) ||
                              is_kept(p.transmittance[channel], q.transmittance[channel]);
            return is_any_kept ? fmt::format("in a {}×{} image, render did not write all eight numbers: some kept "
                                             "their previous bytes (0x00, then 0xff)",
                                             size.width, size.height)
                               : std::string();
        });
    }
}

void writes_nothing_else(Context &context) {
    need_linear_images(context);
    for (const Size &size : sizes) {
        const LinearPicture picture = Tracer(context, emissive_sphere(glm::vec3(0.5f)))
                                          .render_linear(from_front(pinhole(size.width, size.height)));
        if (const std::string damage = picture.damage(); !damage.empty())
            throw Failure(fmt::format("for a {}×{} image, it overwrote {}", size.width, size.height, damage));
    }
}

void form(Context &context) {
    need_linear_images(context);
    Tracer tracer(context, emissive_sphere(glm::vec3(0.5f)));
    tracer.set_compositing(ARHOST_COMPOSITING_LINEAR);
    const auto is_hit = [](const GuardedImage &picture, auto x, auto y) {
        return distance_from_centre(picture, x, y) < silhouette - rim;
    };
    for (int start = 0; start < 2; ++start) {
        const LinearPicture linear = tracer.render_linear(from_front());
        expect_pixels(linear, [&](auto x, auto y) {
            const double light = linear.added(x, y, 0);
            return !is_hit(linear, x, y) || std::abs(light - 0.5) < 0.05
                       ? std::string()
                       : fmt::format("setup asks for a linear image, and the sphere has the radiance 0.5; expected "
                                     "the added light 0.5, it is {:.4g}",
                                     light);
        });
        const Picture straight = tracer.render(from_front());
        expect_pixels(straight, [&](auto x, auto y) {
            const Pixel p = straight.at(x, y);
            return !is_hit(straight, x, y) || (p[3] == 255 && std::abs(p[0] - 188) <= 8)
                       ? std::string()
                       : fmt::format("setup asks for a straight image, and the sphere has the radiance 0.5; expected "
                                     "(188, 188, 188, 255), it is {}",
                                     text_of(p));
        });
    }
}

void region(Context &context) {
    need_linear_images(context);
    bool reported = false;
    for (const glm::dvec3 &aside : {glm::dvec3(0), glm::dvec3(50, 30, 0), glm::dvec3(-70, -50, 0)}) {
        const glm::dvec3 eye = glm::dvec3(0, 0, 200) + aside;
        Tracer tracer(context, emissive_sphere(glm::vec3(0.5f)));
        const LinearPicture picture = tracer.render_linear(camera(eye, eye - glm::dvec3(0, 0, 200), {0, 1, 0}));
        const arhost_render_info &info = tracer.info();
        if (!info.has_region)
            continue;
        reported = true;
        expect_pixels(picture, [&](auto x, auto y) {
            // Left of or above the region, the subtraction wraps to a large number.
            const bool inside = x - info.region_x < info.region_width && y - info.region_y < info.region_height;
            return inside || picture.at(x, y) == untouched
                       ? std::string()
                       : fmt::format("it is {} outside the reported region ({}×{} at ({}, {})); the host leaves the "
                                     "video there as it is",
                                     text_of(picture.at(x, y)), info.region_width, info.region_height, info.region_x,
                                     info.region_y);
        });
    }
    if (!reported)
        throw Skip("it reports no region");
}

// ---- Numbers ---------------------------------------------------------------------------------------

void expect_untouched(const LinearPicture &picture, double min_radius, const char *why) {
    expect_pixels(picture, [&](auto x, auto y) {
        return distance_from_centre(picture, x, y) < min_radius || picture.at(x, y) == untouched
                   ? std::string()
                   : fmt::format("{}, but the pixel is {}; expected exactly (0, 0, 0, 0; 1, 1, 1, 0)", why,
                                 text_of(picture.at(x, y)));
    });
}

void leaves_untouched(Context &context) {
    need_linear_images(context);
    expect_untouched(Tracer(context, emissive_sphere(glm::vec3(0.5f))).render_linear(from_front()), silhouette + rim,
                     "no ray hit");
    expect_untouched(Tracer(context, path_scene(1)).render_linear(from_front()), 0, "the scene is empty");
    scene::ArenaBuilder real = path_scene(0.5f);
    add_table(real);
    real.add_object("post", real.add_triangles(box({10, 10, 30})), real.add_material(diffuse(glm::vec3(0.5f))),
                    ARHOST_ROLE_OCCLUDER);
    real.add_light(sun({0.6f, 0, -0.8f}, glm::vec3(1)));
    expect_untouched(Tracer(context, std::move(real)).render_linear(from_front()), 0,
                     "the scene has no virtual object");
}

void values(Context &context) {
    need_linear_images(context);
    struct Case {
        const char *name;
        scene::ArenaBuilder scene;
        bool has_catcher;
    };
    std::vector<Case> cases;
    const auto add = [&](const char *name, scene::ArenaBuilder scene, bool has_table) {
        if (has_table)
            add_table(scene);
        scene.add_object("ball", scene.add_spheres({{0, 0, 25, 20}}), scene.add_material(diffuse(glm::vec3(0.8f))));
        cases.push_back({name, std::move(scene), has_table});
    };
    add("a room", path_scene(0.5f), true);
    add("a scene without light", path_scene(), true);
    add("a scene without a catcher", path_scene(0.5f), false);
    scene::ArenaBuilder bright = path_scene();
    bright.add_light(sun({0, 0, -1}, glm::vec3(1e6f)));
    add("a scene under a lamp a million times as bright as white", std::move(bright), true);
    scene::ArenaBuilder lantern = path_scene();
    lantern.add_object("lantern", lantern.add_spheres({{30, 0, 10, 8}}),
                       lantern.add_material(emissive(glm::vec3(1e6f))));
    add("a scene with an object a million times as bright as white", std::move(lantern), true);
    for (Case &one : cases) {
        const LinearPicture picture =
            Tracer(context, std::move(one.scene), with_samples(context, 4)).render_linear(from_front());
        expect_pixels(picture, [&](auto x, auto y) -> std::string {
            const LinearPixel p = picture.at(x, y);
            const auto is_wrong = [](std::uint16_t half) { return half >= 0x7c00; }; // infinite, NaN or negative
            if (std::ranges::any_of(p.added, is_wrong) || std::ranges::any_of(p.transmittance, is_wrong))
                return fmt::format("in {}, it is {}; all numbers must be finite and not negative", one.name,
                                   text_of(p));
            if (p.reserved_0 != 0 || p.reserved_1 != 0)
                return fmt::format("in {}, it is {}; the fourth and the eighth number must be 0", one.name,
                                   text_of(p));
            if (!one.has_catcher && std::ranges::any_of(p.transmittance, [](auto t) { return t > half_of_one; }))
                return fmt::format("in {}, it is {}; only on catchers may the transmittance exceed 1", one.name,
                                   text_of(p));
            return {};
        });
    }
}

// ---- Light -----------------------------------------------------------------------------------------

void hit(Context &context) {
    need_linear_images(context);
    for (const glm::vec3 &radiance : {glm::vec3(0.02f, 0.1f, 0.5f), glm::vec3(4, 1, 0.25f)}) {
        const LinearPicture picture = Tracer(context, emissive_sphere(radiance)).render_linear(from_front());
        expect_pixels(picture, [&](auto x, auto y) -> std::string {
            if (distance_from_centre(picture, x, y) > silhouette - rim)
                return {};
            for (int channel = 0; channel < 3; ++channel) {
                if (picture.at(x, y).transmittance[channel] != 0)
                    return fmt::format("every ray hit the sphere, but the pixel is {}; expected the transmittance 0",
                                       text_of(picture.at(x, y)));
                const double light = picture.added(x, y, channel), expected = double{radiance[channel]};
                if (std::abs(light - expected) > 0.01 * expected)
                    return fmt::format("the {} radiance of the sphere is {}, but the added light is {:.4g}",
                                       channel_names[channel], expected, light);
            }
            return {};
        });
    }
}

void edge(Context &context) {
    need_linear_images(context);
    const LinearPicture picture =
        Tracer(context, emissive_sphere(glm::vec3(0.5f)), many_samples(context)).render_linear(from_front());
    int edges = 0;
    expect_pixels(picture, [&](auto x, auto y) {
        const double free = picture.transmittance(x, y, 1), light = picture.added(x, y, 1);
        if (free == 0 || free == 1)
            return std::string();
        ++edges;
        return std::abs(light - 0.5 * (1 - free)) < 0.005
                   ? ""
                   : fmt::format("the transmittance is {:.4g}, so the sphere of radiance 0.5 covers {:.1f} % of the "
                                 "pixel; expected the added light {:.4g}, it is {:.4g}",
                                 free, 100 * (1 - free), 0.5 * (1 - free), light);
    });
    if (edges == 0)
        throw Skip("no pixel is partially covered");
}

void catcher(Context &context) {
    need_linear_images(context);
    // Two suns of different colours. The shadow of a black ball at a height of 40 mm is 30 mm beside it.
    scene::ArenaBuilder builder = path_scene();
    add_table(builder);
    builder.add_object("ball", builder.add_spheres({{0, 0, 40, 10}}), builder.add_material(diffuse(glm::vec3(0))));
    builder.add_light(sun({0.6f, 0, -0.8f}, {0.75f, 0.5f, 0}));
    builder.add_light(sun({-0.6f, 0, -0.8f}, {0.25f, 0.5f, 1}));
    const LinearPicture shadows =
        Tracer(context, std::move(builder), many_samples(context)).render_linear(from_front());
    const double left[] = {0.75, 0.5, 0}, right[] = {0.25, 0.5, 1}; // without the second sun, without the first
    for (int channel = 0; channel < 3; ++channel)
        for (const bool is_right : {false, true}) {
            const std::uint32_t x = is_right ? 110 : 49, y = 59;
            const double light = mean_of(shadows, &LinearPicture::transmittance, x, y, channel);
            const double expected = is_right ? right[channel] : left[channel];
            if (std::abs(light - expected) > 0.05)
                throw Failure(fmt::format("pixel ({}, {}): a black ball hides one of two lamps, and {:.2f} of the {} "
                                          "light arrives; expected this transmittance, it is {:.3f}",
                                          x, y, expected, channel_names[channel], light))
                    .with("rendered", shadows.shown())
                    .at(x, y);
        }

    // A lantern lights the catcher beside it. The form factor of a distant sphere: (r / d)² · cosθ.
    scene::ArenaBuilder lit = path_scene();
    add_table(lit);
    lit.add_object("lantern", lit.add_spheres({{0, 0, 50, 15}}), lit.add_material(emissive(glm::vec3(4))));
    lit.add_light(sun({0, 0, -1}, glm::vec3(1)));
    const LinearPicture bright = Tracer(context, std::move(lit), many_samples(context)).render_linear(from_front());
    const double squared = 40 * 40 + 50 * 50, form_factor = 15 * 15 / squared * 50 / std::sqrt(squared);
    const double expected = 1 + 4 * form_factor, light = mean_of(bright, &LinearPicture::transmittance, 39, 59, 1);
    if (std::abs(light - expected) > 0.05)
        throw Failure(
            fmt::format("pixel (39, 59): a virtual lantern adds {:.2f} times the light of the lamp; expected "
                        "the transmittance {:.2f}, it is {:.3f}",
                        4 * form_factor, expected, light))
            .with("rendered", bright.shown())
            .at(39, 59);
}

// ---- Straight images -------------------------------------------------------------------------------

void straight(Context &context) {
    need_linear_images(context);
    const LinearPicture linear =
        Tracer(context, ball_in_a_room(), with_samples(context, 64)).render_linear(from_front());
    for (const bool is_srgb : {false, true}) {
        Tracer tracer(context, ball_in_a_room(), with_samples(context, 64));
        tracer.set_compositing(is_srgb ? ARHOST_COMPOSITING_SRGB : ARHOST_COMPOSITING_LINEAR);
        const Picture actual = tracer.render(from_front());
        Picture expected = linear.straight();
        for (std::uint32_t y = 0; is_srgb && y < expected.height(); ++y)
            for (std::uint32_t x = 0; x < expected.width(); ++x) {
                Pixel p = expected.at(x, y);
                p[3] = static_cast<int>(std::lround(255 * shading::alpha_of_light(1 - p[3] / 255.0)));
                expected.set(x, y, p);
            }
        // The colour under a small alpha is inexact; shadows of grey objects have none.
        const auto is_wrong = [&](auto x, auto y) {
            const Pixel p = actual.at(x, y), q = expected.at(x, y);
            return std::abs(p[3] - q[3]) > 3 || (q[3] > 250 && differs(p, q, 3));
        };
        const int count = count_pixels(actual, is_wrong);
        if (count <= 0.01 * actual.width() * actual.height()) // edges in the compositing space sRGB
            continue;
        for (std::uint32_t y = 0; y < actual.height(); ++y)
            for (std::uint32_t x = 0; x < actual.width(); ++x)
                if (is_wrong(x, y))
                    throw Failure(fmt::format("pixel ({}, {}): the straight image for blending in {} is {}; expected "
                                              "{}, as in the linear image. {} of {} pixels differ",
                                              x, y, is_srgb ? "sRGB codes" : "linear light", text_of(actual.at(x, y)),
                                              text_of(expected.at(x, y)), count, actual.width() * actual.height()))
                        .with("rendered", actual)
                        .with("expected", expected)
                        .with("difference × 5", difference(actual, expected))
                        .at(x, y);
    }
}

// ---- Random numbers --------------------------------------------------------------------------------

void deterministic(Context &context) {
    need_linear_images(context);
    Tracer tracer(context, ball_in_a_room()), other(context, ball_in_a_room());
    const auto render = [](Tracer &with, std::uint64_t sequence) {
        with.set_sequence(sequence);
        return with.render_linear(from_front());
    };
    const LinearPicture first = render(tracer, 7);
    expect_identical(render(tracer, 7), first, "the same request gives different bytes the second time");
    render(tracer, 8);
    expect_identical(render(tracer, 7), first, "the image depends on the previous frame");
    expect_identical(render(other, 7), first, "the same request gives different bytes in another instance");
    const arhost_option_descriptor *threads = context.library.option("threads");
    if (!threads || threads->type != ARHOST_OPTION_INTEGER)
        return;
    for (const char *count : {"1", "3"}) {
        Tracer some(context, ball_in_a_room(), {{"threads", count}});
        expect_identical(render(some, 7), first,
                         fmt::format("the image depends on the number of threads ({})", count));
    }
}

// The numbers of the image's pixels: six per pixel.
std::vector<double> numbers_of(const LinearPicture &picture) {
    std::vector<double> numbers;
    for (std::uint32_t y = 0; y < picture.height(); ++y)
        for (std::uint32_t x = 0; x < picture.width(); ++x)
            for (int channel = 0; channel < 3; ++channel) {
                numbers.push_back(picture.added(x, y, channel));
                numbers.push_back(picture.transmittance(x, y, channel));
            }
    return numbers;
}

void mean(Context &context) {
    need_linear_images(context);
    constexpr int frames = 64;
    if (with_samples(context, 1).empty())
        throw Skip("it has no integer option 'samples'");
    const arhost_camera view = from_front(pinhole(40, 30, 50));
    const LinearPicture fine = Tracer(context, ball_in_a_room(), with_samples(context, frames)).render_linear(view);
    const std::vector<double> expected = numbers_of(fine);
    Tracer tracer(context, ball_in_a_room(), with_samples(context, 1));
    std::vector<double> sum(expected.size());
    double error_of_one = 0, error = 0, bias = 0;
    for (int frame = 0; frame < frames; ++frame) {
        tracer.set_sequence(static_cast<std::uint64_t>(frame));
        const std::vector<double> numbers = numbers_of(tracer.render_linear(view));
        if (tracer.state_size() > 0)
            throw Skip("it has a state, so each image may be a mean already; use options with which it has none");
        for (std::size_t i = 0; i < sum.size(); ++i) {
            sum[i] += numbers[i];
            error_of_one += std::pow(numbers[i] - expected[i], 2) / (frames * static_cast<double>(sum.size()));
        }
    }
    for (std::size_t i = 0; i < sum.size(); ++i) {
        const double difference = sum[i] / frames - expected[i];
        error += difference * difference / static_cast<double>(sum.size());
        bias += difference / static_cast<double>(sum.size());
    }
    error = std::sqrt(error);
    error_of_one = std::sqrt(error_of_one);
    context.note = fmt::format("the RMS difference to an image of {} samples is {:.4f} for frames of one sample, "
                               "{:.4f} for their mean",
                               frames, error_of_one, error);
    constexpr double rounding = 0.002, max_bias = 0.01;
    if (error > rounding + 0.4 * error_of_one || std::abs(bias) > max_bias)
        throw Failure(
            fmt::format("the mean of {} frames with one sample each does not approach an image of {} "
                        "samples: the RMS difference is {:.4f}, that of one frame {:.4f}, and the mean "
                        "difference {:.4f}; expected at most 40 % of that of one frame, and {}. Seed random "
                        "numbers with the request's sequence",
                        frames, frames, error, error_of_one, bias, max_bias))
            .with("many samples", fine.shown());
}

constexpr const char *gate = "raytracer.render";
constexpr Test tests[] = {
    {"raytracer.linear-writes-every-pixel", "All eight numbers of every pixel of a linear image are written.", gate,
     20s, writes_every_pixel},
    {"raytracer.linear-writes-nothing-else", "No byte outside the pixels of a linear image is written.", gate, 20s,
     writes_nothing_else},
    {"raytracer.linear-form", "Images have the form that the setup asks for, also after a start with the other one.",
     gate, 20s, form},
    {"raytracer.linear-untouched",
     "In a linear image, pixels that virtual objects do not affect are exactly (0, 0, 0, 0; 1, 1, 1, 0).", gate, 20s,
     leaves_untouched},
    {"raytracer.linear-region", "A linear image leaves the video untouched outside the reported region.", gate, 20s,
     region},
    {"raytracer.linear-values",
     "The numbers of a linear image are finite and not negative, the reserved ones 0. Only on catchers does a "
     "transmittance exceed 1.",
     gate, 20s, values},
    {"raytracer.linear-hit",
     "On virtual objects, the transmittance is exactly 0 and the added light their radiance, even above white.", gate,
     20s, hit},
    {"raytracer.linear-edge",
     "At edges, the transmittance is the free share of the pixel, and the added light that of the rest.", gate, 20s,
     edge},
    {"raytracer.linear-catcher",
     "On catchers, the transmittance of each channel is the light with virtual objects divided by that without, also "
     "above 1.",
     gate, 30s, catcher},
    {"raytracer.linear-straight", "Straight and linear images of a scene agree within rounding.", gate, 30s,
     straight},
    {"raytracer.linear-deterministic",
     "The same request gives the same linear image, whatever the frames before, the instance or the threads.", gate,
     20s, deterministic},
    {"raytracer.linear-mean",
     "The mean of frames with one sample and successive sequence numbers approaches an image of many samples.", gate,
     60s, mean},
};

} // namespace

std::span<const Test> raytracer_linear_tests() {
    return tests;
}

} // namespace arhost::conformance
