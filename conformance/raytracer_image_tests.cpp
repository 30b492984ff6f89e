// SPDX-License-Identifier: Apache-2.0
// The image's memory, determinism, and the reference image.
#include "conformance/expect.hpp"
#include "conformance/tracer.hpp"

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
                       : fmt::format("of a {}×{} image, it keeps what was there before, zeros or ones", size.width,
                                     size.height);
        });
    }
}

void writes_nothing_else(Context &context) {
    for (const Size &size : {Size{160, 120}, {1u, 1u}, {17u, 13u}, {33u, 65u}}) {
        const Picture picture =
            Tracer(context, one_sphere({0, 0, 0, 30})).render(from_front(pinhole(size.width, size.height)));
        if (const std::string damage = picture.damage(); !damage.empty())
            throw Failure(fmt::format("of a {}×{} image, it wrote {}", size.width, size.height, damage));
    }
}

void sizes(Context &context) {
    for (const Size &size : {Size{1, 1}, {17u, 13u}, {3u, 5u}, {31u, 1u}, {1u, 31u}}) {
        const Picture picture =
            Tracer(context, one_sphere({0, 0, 0, 30})).render(from_front(pinhole(size.width, size.height, 100)));
        expect_pixels(picture, [&](auto x, auto y) {
            const bool hit = distance_from_centre(picture, x, y) < 100 * 30 / 200.0 - 2;
            const int alpha = picture.alpha(x, y);
            return !hit || alpha >= 250 ? ""
                                        : fmt::format("of a {}×{} image, the sphere is here but alpha is {}",
                                                      size.width, size.height, alpha);
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
            throw Failure(fmt::format("the region ends at ({}, {}), beyond an image of {}×{}", right, bottom,
                                      picture.width(), picture.height()));
        expect_pixels(picture, [&](auto x, auto y) {
            const bool inside = x >= info.region_x && x < right && y >= info.region_y && y < bottom;
            const int alpha = picture.alpha(x, y);
            return inside || alpha <= 2
                       ? ""
                       : fmt::format("outside the reported region, {}×{} at ({}, {}), alpha is {}", info.region_width,
                                     info.region_height, info.region_x, info.region_y, alpha);
        });
    }
    if (!reported)
        throw Skip("it reports no region");
}

void device_time(Context &context) {
    bool reported = false;
    Tracer tracer(context, still_life());
    for (int image = 1; image <= 3; ++image) { // several, because a device time may accumulate
        tracer.render(still_life_camera());
        const auto ms = [](auto ns) { return 1e-6 * static_cast<double>(ns); };
        const double device_ms = ms(tracer.info().device_time_ns), took_ms = ms(tracer.duration().count());
        if (device_ms > took_ms)
            throw Failure(fmt::format("for image {} it reports a device time of {:.3f} ms, but render took {:.3f} ms",
                                      image, device_ms, took_ms));
        reported = reported || device_ms > 0;
    }
    if (!reported)
        throw Skip("it reports no device time");
}

// ---- Sameness --------------------------------------------------------------------------------------

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
    expect_alike(tracer.render(here), first, "an image depends on the frame before it", 1);
    if (!first_difference(first, second, 1))
        throw Failure("two different cameras give the same image").with("rendered", first);
}

void threads(Context &context) {
    const arhost_option_descriptor *option = context.library.option("threads");
    if (!option || option->type != ARHOST_OPTION_INTEGER)
        throw Skip("it has no integer option 'threads'");
    const Picture one = Tracer(context, still_life(), {{"threads", "1"}}).render(still_life_camera());
    for (const char *count : {"2", "3"})
        expect_alike(Tracer(context, still_life(), {{"threads", count}}).render(still_life_camera()), one,
                     fmt::format("{} threads give another image than one", count), 1);
}

// ---- The reference ---------------------------------------------------------------------------------

void reference(Context &context) {
    if (!std::filesystem::is_regular_file(context.reference))
        throw std::runtime_error("the reference '" + context.reference.string() +
                                 "' does not exist; give --reference FILE");
    PluginLibrary library(context.reference, {}, context.library.calls());
    Context of_reference{library, context.reference, context.random};
    const Picture should = Tracer(of_reference, still_life()).render(still_life_camera());
    const Picture is = Tracer(context, still_life()).render(still_life_camera());
    // Edges, and reflections of edges, may lie a pixel elsewhere.
    double squares = 0;
    int compared = 0, alphas = 0;
    std::optional<std::array<unsigned, 2>> worst;
    int worst_difference = -1;
    for (std::uint32_t y = 0; y < is.height(); ++y)
        for (std::uint32_t x = 0; x < is.width(); ++x) {
            if (!should.is_smooth(x, y))
                continue;
            const Pixel p = is.at(x, y), q = should.at(x, y);
            int largest = std::abs(p[3] - q[3]);
            if (largest > 1) // exactness is for other tests
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
    const double psnr = squares == 0 ? 99 : 10 * std::log10(255.0 * 255.0 * compared / squares);
    constexpr double least_psnr = 40;
    if (psnr >= least_psnr && alphas == 0)
        return;
    throw Failure(
        fmt::format("beside {}, inside of objects the PSNR is {:.1f} dB and must be {} or more, and {} pixels "
                    "away from edges have another alpha; most at ({}, {}): {} and {}",
                    context.reference.stem().string(), psnr, least_psnr, alphas, (*worst)[0], (*worst)[1],
                    text_of(is.at((*worst)[0], (*worst)[1])), text_of(should.at((*worst)[0], (*worst)[1]))))
        .with("rendered", is)
        .with("reference", should)
        .with("difference × 5", difference(is, should))
        .at((*worst)[0], (*worst)[1]);
}

constexpr const char *gate = "raytracer.render";
constexpr arhost_kind kind = ARHOST_KIND_RAYTRACER;
constexpr Test tests[] = {
    {"raytracer.writes-every-pixel", "Every pixel is written.", kind, gate, 20s, writes_every_pixel},
    {"raytracer.writes-nothing-else", "No byte outside the pixels is written.", kind, gate, 20s, writes_nothing_else},
    {"raytracer.sizes", "Images of one pixel, one row, one column and odd sizes are correct.", kind, gate, 20s,
     sizes},
    {"raytracer.region", "Alpha is 0 outside the reported region.", kind, gate, 20s, region},
    {"raytracer.device-time", "The reported device time is at most the duration of render.", kind, gate, 20s,
     device_time},
    {"raytracer.deterministic", "The same request gives the same bytes, repeatedly and in another instance.", kind,
     gate, 20s, deterministic},
    {"raytracer.frames-before", "An image does not depend on the frames before it.", kind, gate, 20s, frames_before},
    {"raytracer.threads", "The image does not depend on the number of threads.", kind, gate, 20s, threads},
    {"raytracer.reference",
     "The image matches the reference ray tracer's: 40 dB inside objects, the same alpha except at edges.", kind,
     gate, 30s, reference},
};

} // namespace

std::span<const Test> raytracer_image_tests() {
    return tests;
}

} // namespace arhost::conformance
