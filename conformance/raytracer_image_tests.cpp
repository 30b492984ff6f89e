// SPDX-License-Identifier: Apache-2.0
// The image's memory, determinism, and the reference image.
#include "conformance/expect.hpp"
#include "conformance/tracer.hpp"

#include <list>
#include <type_traits>

namespace arhost::conformance {
namespace {

struct Size {
    std::uint32_t width, height;
};

void writes_every_pixel(Context &context) {
    for (const Size &size : {Size{160, 120}, {1u, 1u}, {17u, 13u}, {1u, 40u}, {67u, 1u}}) {
        const arhost_camera view = from_front(pinhole(size.width, size.height));
        Tracer tracer(context, one_sphere({0, 0, 0, 30}));
        const Picture on_zeros = tracer.render(view, nullptr, 0x00), on_ones = tracer.render(view, nullptr, 0xff);
        expect_pixels(on_zeros, [&](auto x, auto y) {
            const Pixel none{0, 0, 0, 0}, all{255, 255, 255, 255};
            return on_zeros.at(x, y) != none || on_ones.at(x, y) != all
                       ? ""
                       : fmt::format("in a {}×{} image, render did not write this pixel: it kept its previous value "
                                     "(0x00, then 0xff)",
                                     size.width, size.height);
        });
    }
}

void writes_nothing_else(Context &context) {
    for (const Size &size : {Size{160, 120}, {1u, 1u}, {17u, 13u}, {33u, 65u}}) {
        const Picture picture =
            Tracer(context, one_sphere({0, 0, 0, 30})).render(from_front(pinhole(size.width, size.height)));
        if (const std::string damage = picture.damage(); !damage.empty())
            throw Failure(fmt::format("for a {}×{} image, it overwrote {}", size.width, size.height, damage));
    }
}

void sizes(Context &context) {
    for (const Size &size : {Size{1, 1}, {17u, 13u}, {3u, 5u}, {31u, 1u}, {1u, 31u}}) {
        const Picture picture =
            Tracer(context, one_sphere({0, 0, 0, 30})).render(from_front(pinhole(size.width, size.height, 100)));
        expect_pixels(picture, [&](auto x, auto y) {
            const bool hit = distance_from_centre(picture, x, y) < 100 * 30 / 200.0 - 2;
            const int alpha = picture.alpha(x, y);
            return !hit || alpha >= 250
                       ? ""
                       : fmt::format("in a {}×{} image, the sphere covers this pixel, but alpha is {}", size.width,
                                     size.height, alpha);
        });
    }
}

void region(Context &context) {
    bool reported = false;
    for (const glm::dvec3 &aside : {glm::dvec3(0), glm::dvec3(50, 30, 0), glm::dvec3(-70, -50, 0)}) {
        const glm::dvec3 eye = glm::dvec3(0, 0, 200) + aside;
        Tracer tracer(context, one_sphere({0, 0, 0, 25}));
        const Picture picture = tracer.render(camera(eye, eye - glm::dvec3(0, 0, 200), {0, 1, 0}));
        const arhost_render_info &info = tracer.info();
        if (!info.has_region)
            continue;
        reported = true;
        const std::uint64_t right = std::uint64_t{info.region_x} + info.region_width,
                            bottom = std::uint64_t{info.region_y} + info.region_height;
        if (right > picture.width() || bottom > picture.height())
            throw Failure(fmt::format("the region ends at ({}, {}), outside the {}×{} image", right, bottom,
                                      picture.width(), picture.height()));
        expect_pixels(picture, [&](auto x, auto y) {
            const bool inside = x >= info.region_x && x < right && y >= info.region_y && y < bottom;
            const int alpha = picture.alpha(x, y);
            return inside || alpha <= 2
                       ? ""
                       : fmt::format(
                             "alpha is {} outside the reported region ({}×{} at ({}, {})); expected at most 2", alpha,
                             info.region_width, info.region_height, info.region_x, info.region_y);
        });
    }
    if (!reported)
        throw Skip("it reports no region");
}

void device_time(Context &context) {
    bool reported = false;
    Tracer tracer(context, still_life());
    for (int image = 1; image <= 3; ++image) { // several, to detect accumulated times
        tracer.render(still_life_camera());
        const auto ms = [](auto ns) { return 1e-6 * static_cast<double>(ns); };
        const double device_ms = ms(tracer.info().device_time_ns), duration_ms = ms(tracer.duration().count());
        if (device_ms > duration_ms)
            throw Failure(fmt::format("for image {} it reports a device time of {:.3f} ms, but render took {:.3f} ms",
                                      image, device_ms, duration_ms));
        reported = reported || device_ms > 0;
    }
    if (!reported)
        throw Skip("it reports no device time");
}

// ---- Determinism -----------------------------------------------------------------------------------

void deterministic(Context &context) {
    Tracer tracer(context, still_life()), other(context, still_life());
    const Picture first = tracer.render(still_life_camera());
    expect_alike(tracer.render(still_life_camera()), first, "the same request gives different bytes the second time");
    expect_alike(tracer.render(still_life_camera()), first, "the same request gives different bytes the third time");
    expect_alike(other.render(still_life_camera()), first,
                 "the same request gives different bytes in another instance");
}

void frames_before(Context &context) {
    Tracer tracer(context, still_life());
    const arhost_camera here = still_life_camera(), there = camera({120, -90, 160}, {0, 0, 10}, {0, 0, 1});
    const Picture first = tracer.render(here);
    const Picture second = tracer.render(there);
    expect_alike(tracer.render(here), first, "an image depends on the previous frame", 1);
    if (!first_difference(first, second, 1))
        throw Failure("two different cameras give the same image").with("rendered", first);
}

struct StatefulRequests {
    std::string name;
    arhost_integrator integrator = ARHOST_INTEGRATOR_WHITTED;
    bool has_video = false, is_scaled = false;
};

Picture render(Tracer &tracer, const arhost_camera &view, const Picture *) {
    return tracer.render(view);
}
LinearPicture render(Tracer &tracer, const arhost_camera &view, const LinearPicture *) {
    return tracer.render_linear(view);
}
void expect_same(const Picture &actual, const Picture &expected, const std::string &violation) {
    expect_alike(actual, expected, violation);
}
void expect_same(const LinearPicture &actual, const LinearPicture &expected, const std::string &violation) {
    expect_identical(actual, expected, violation);
}

// Checks that a new instance that gets the state of another one continues as that one does. Returns false if there is
// no state. Image: Picture or LinearPicture.
template <class Image> bool continues_from_state(Context &context, const StatefulRequests &requests) {
    const arhost_camera here = still_life_camera(), there = camera({120, -90, 160}, {0, 0, 10}, {0, 0, 1});
    const auto scene = [&] {
        scene::ArenaBuilder builder = still_life();
        builder.settings.integrator = requests.integrator;
        return builder;
    };
    std::list<Video> videos;
    Tracer tracer(context, scene());
    std::vector<std::byte> before;
    std::uint64_t number = 0;
    for (arhost_camera view : {here, here, there, here}) {
        const std::string when =
            fmt::format("in image {} of {}, with the state of the image before it,", number + 1, requests.name);
        if (requests.is_scaled && number % 2 == 1)
            view.intrinsics = arhost_scaled_intrinsics(here.intrinsics, 80, 60);
        const Video &video = videos.emplace_back(
            ARHOST_PIXEL_FORMAT_BGR8, here.intrinsics.width, here.intrinsics.height, [=](auto x, auto) {
                return Video::Rgb{static_cast<std::uint8_t>(x + 20 * number), 90, 60};
            });
        const auto next = [&](Tracer &one, std::byte filler) {
            one.set_full_size(here.intrinsics);
            if (std::is_same_v<Image, LinearPicture>)
                one.set_compositing(ARHOST_COMPOSITING_LINEAR);
            one.set_video(requests.has_video ? &video : nullptr);
            one.set_state(before, number, filler);
            return render(one, view, static_cast<const Image *>(nullptr));
        };
        constexpr std::byte filler{0xa5}, other_filler{0x3c};
        const Image expected = next(tracer, filler);
        if (tracer.state_size() == 0)
            return false;
        const std::vector<std::byte> after = tracer.state_after();
        Tracer other(context, scene()), with_other_filler(context, scene());
        expect_same(next(other, filler), expected, when + " a new instance gives different bytes");
        if (other.state_after() != after)
            throw Failure(when + " a new instance writes another state_after");
        expect_same(next(with_other_filler, other_filler), expected,
                    when + " and with other initial content of state_after, a new instance gives different bytes");
        if (with_other_filler.state_after() != after)
            throw Failure(when + " a new instance leaves bytes of state_after unwritten");
        before = after;
        ++number;
    }
    return true;
}

void state(Context &context) {
    const bool writes_linear = has_capability(context, ARHOST_RAYTRACER_CAPABILITY_LINEAR_IMAGES),
               is_scalable = has_capability(context, ARHOST_RAYTRACER_CAPABILITY_SCALED_IMAGES),
               knows_video = has_capability(context, ARHOST_RAYTRACER_CAPABILITY_VIDEO);
    bool has_state = false;
    const auto check = [&](const std::string &form, arhost_integrator integrator, auto continues) {
        const auto check_one = [&](const StatefulRequests &requests) {
            const bool has = continues(context, requests); // maybe for scenes of one integrator only
            has_state = has_state || has;
        };
        check_one({form + " images", integrator});
        if (is_scalable)
            check_one({form + " images of two sizes", integrator, false, true});
        if (knows_video)
            check_one({form + " images with video", integrator, true, false});
    };
    check("straight", ARHOST_INTEGRATOR_WHITTED, continues_from_state<Picture>);
    if (writes_linear) {
        check("path-traced straight", ARHOST_INTEGRATOR_PATH, continues_from_state<Picture>);
        check("linear", ARHOST_INTEGRATOR_PATH, continues_from_state<LinearPicture>);
    }
    if (!has_state)
        throw Skip("it has no state");
}

void threads(Context &context) {
    const arhost_option_descriptor *option = context.library.option("threads");
    if (!option || option->type != ARHOST_OPTION_INTEGER)
        throw Skip("it has no integer option 'threads'");
    const Picture one = Tracer(context, still_life(), {{"threads", "1"}}).render(still_life_camera());
    for (const char *count : {"2", "3"})
        expect_alike(Tracer(context, still_life(), {{"threads", count}}).render(still_life_camera()), one,
                     fmt::format("the image with {} threads differs from that with one", count), 1);
}

// ---- The reference ---------------------------------------------------------------------------------

void reference(Context &context) {
    if (!std::filesystem::is_regular_file(context.reference))
        throw std::runtime_error("the reference '" + context.reference.string() +
                                 "' does not exist; give --reference FILE");
    PluginLibrary library(context.reference, {}, context.library.calls());
    Context of_reference{library, context.reference, context.random};
    const bool is_matte = !has_capability(context, ARHOST_RAYTRACER_CAPABILITY_REFLECTION);
    const auto scene = [&] { return still_life(glm::mat4(1), is_matte); };
    const Picture expected = Tracer(of_reference, scene()).render(still_life_camera());
    const Picture actual = Tracer(context, scene()).render(still_life_camera());
    // Edges and their reflections may be off by a pixel.
    double squares = 0;
    int compared = 0, alphas = 0;
    std::optional<std::array<unsigned, 2>> worst;
    int worst_difference = -1;
    for (std::uint32_t y = 0; y < actual.height(); ++y)
        for (std::uint32_t x = 0; x < actual.width(); ++x) {
            if (!expected.is_smooth(x, y))
                continue;
            const Pixel p = actual.at(x, y), q = expected.at(x, y);
            int largest = std::abs(p[3] - q[3]);
            if (largest > 1) // other tests check for exact values
                ++alphas;
            if (q[3] == 255)
                for (int channel = 0; channel < 3; ++channel) {
                    const int d = std::abs(p[channel] - q[channel]);
                    squares += d * d;
                    ++compared;
                    largest = std::max(largest, d);
                }
            if (largest > worst_difference) {
                worst_difference = largest;
                worst = {x, y};
            }
        }
    const double psnr_db = squares == 0 ? 99 : 10 * std::log10(255.0 * 255.0 * compared / squares);
    constexpr double min_psnr_db = 40;
    if (psnr_db >= min_psnr_db && alphas == 0)
        return;
    throw Failure(
        fmt::format("compared with {}, the PSNR inside objects is {:.1f} dB (minimum: {} dB), and alpha differs in "
                    "{} pixels away from edges; the largest difference is at ({}, {}): {} instead of {}",
                    context.reference.stem().string(), psnr_db, min_psnr_db, alphas, (*worst)[0], (*worst)[1],
                    text_of(actual.at((*worst)[0], (*worst)[1])), text_of(expected.at((*worst)[0], (*worst)[1]))))
        .with("rendered", actual)
        .with("reference", expected)
        .with("difference × 5", difference(actual, expected))
        .at((*worst)[0], (*worst)[1]);
}

constexpr const char *gate = "raytracer.render";
constexpr Test tests[] = {
    {"raytracer.writes-every-pixel", "Every pixel is written.", gate, 20s, writes_every_pixel},
    {"raytracer.writes-nothing-else", "No byte outside the pixels is written.", gate, 20s, writes_nothing_else},
    {"raytracer.sizes", "Images of one pixel, one row, one column and odd sizes are correct.", gate, 20s, sizes},
    {"raytracer.region", "Alpha is 0 outside the reported region.", gate, 20s, region},
    {"raytracer.device-time", "The reported device time is at most the duration of render.", gate, 20s, device_time},
    {"raytracer.deterministic", "The same request gives the same bytes, repeatedly and in another instance.", gate,
     20s, deterministic},
    {"raytracer.frames-before", "An image does not depend on previous frames.", gate, 20s, frames_before},
    {"raytracer.state",
     "Image and state_after depend only on the request and state_before, also for linear images, video and two "
     "sizes.",
     "raytracer.deterministic", 60s, state},
    {"raytracer.threads", "The image does not depend on the number of threads.", gate, 20s, threads},
    {"raytracer.reference",
     "The image matches that of the reference ray tracer: a PSNR of 40 dB inside objects, equal alpha except at "
     "edges.",
     gate, 30s, reference},
};

} // namespace

std::span<const Test> raytracer_image_tests() {
    return tests;
}

} // namespace arhost::conformance
