// SPDX-License-Identifier: Apache-2.0
//
// Colours and brightness, against the formulas of arhost/scene.h.
#include "conformance/expect.hpp"
#include "conformance/tracer.hpp"

#include <arhost/shading/srgb8.hpp>

#include <glm/geometric.hpp>

namespace arhost::conformance {
namespace {

using shading::srgb8_exact;

Pixel centre_of(const Picture &picture) {
    return picture.at(picture.width() / 2, picture.height() / 2);
}

void colour_order(Context &context) {
    constexpr const char *names[] = {"red", "green", "blue"};
    for (int channel = 0; channel < 3; ++channel) {
        glm::vec3 colour(0);
        colour[channel] = 1;
        const Picture picture = Tracer(context, one_sphere({0, 0, 0, 30}, glowing(colour))).render(from_front());
        const Pixel p = centre_of(picture);
        for (int other = 0; other < 3; ++other)
            if (other == channel ? p[other] < 128 : p[other] > 20)
                throw Failure(fmt::format("pixel (80, 60): a {} sphere is {}; the byte order is R, G, B, A",
                                          names[channel], text_of(p)))
                    .with("rendered", picture)
                    .at(80, 60);
    }
}

void srgb(Context &context) {
    for (const float value : {0.0f, 0.002f, 0.02f, 0.1f, 0.2f, 0.5f, 0.8f, 1.0f}) {
        const Picture picture =
            Tracer(context, one_sphere({0, 0, 0, 30}, glowing(glm::vec3(value)))).render(from_front());
        const int code = centre_of(picture)[1], expected = srgb8_exact(double{value});
        if (std::abs(code - expected) > 1)
            throw Failure(fmt::format("pixel (80, 60): linear light of {} is encoded as {}; expected {} (sRGB)",
                                      value, code, expected))
                .with("rendered", picture)
                .at(80, 60);
    }
}

// Renders a lit plane and compares its brightness with `irradiance(point)`.
template <class Irradiance> void expect_plane(Context &context, const arhost_light &light, Irradiance &&irradiance) {
    scene::ArenaBuilder builder;
    builder.settings.ambient = glm::vec3(0.1f);
    // One triangle per side: a fast ray tracer may leave a gap between triangles that share an edge.
    const scene::TriangleMesh plane{
        {{-600, -300, 1}, {600, -300, 1}, {0, 900, 1}, {-600, -300, -1}, {600, -300, -1}, {0, 900, -1}},
        {},
        {},
        {{0, 1, 2}, {5, 4, 3}}};
    builder.add_object("plane", builder.add_triangles(plane), builder.add_material(diffuse(glm::vec3(0.8f))));
    for (const float side : {1.0f, -1.0f}) { // same light on both sides
        arhost_light one = light;
        one.position[2] *= side;
        one.direction[2] *= side;
        builder.add_light(one);
    }
    const Picture picture = Tracer(context, std::move(builder)).render(from_front());
    expect_pixels(picture, [&](auto x, auto y) {
        const double scale = 199.0 / 200; // mm per px at the plane's upper side, z = 1
        const glm::dvec3 at((x - 79.5) * scale, (59.5 - y) * scale, 1);
        const int expected = srgb8_exact(double{0.8f} * (double{0.1f} + irradiance(at)));
        const int code = picture.at(x, y)[0];
        return std::abs(code - expected) <= 1
                   ? ""
                   : fmt::format("a lit plane has the code {}; expected {} by Lambert's law", code, expected);
    });
}

void lambert(Context &context) {
    expect_plane(context, lamp({0, 0, 120}, 0.9f), [](const glm::dvec3 &at) {
        const glm::dvec3 to_light = glm::dvec3(0, 0, 120) - at;
        return double{0.9f} * to_light.z / glm::length(to_light);
    });
}

void inverse_square(Context &context) {
    arhost_light light = lamp({0, 0, 150}, 18000);
    light.falloff = ARHOST_FALLOFF_INVERSE_SQUARE;
    expect_plane(context, light, [](const glm::dvec3 &at) {
        const glm::dvec3 to_light = glm::dvec3(0, 0, 150) - at;
        return 18000 * to_light.z / std::pow(glm::length(to_light), 3);
    });
}

void directional(Context &context) {
    arhost_light light = scene::make_light(ARHOST_LIGHT_DIRECTIONAL);
    light.falloff = ARHOST_FALLOFF_NONE;
    const float direction[] = {0.6f, 0, -0.8f};
    std::copy_n(direction, 3, light.direction);
    std::fill_n(light.intensity, 3, 0.75f);
    expect_plane(context, light, [](const glm::dvec3 &) { return 0.75 * double{0.8f}; });
}

void shadow_on_object(Context &context) {
    scene::ArenaBuilder builder;
    builder.settings.ambient = glm::vec3(0.2f);
    builder.add_object("plane", builder.add_triangles(square(150, 0)),
                       builder.add_material(diffuse(glm::vec3(0.8f))));
    builder.add_object("ball", builder.add_spheres({{30, 0, 40, 12}}),
                       builder.add_material(diffuse(glm::vec3(0.8f))));
    builder.add_light(lamp({150, 0, 200}, 0.8f));
    const Picture picture = Tracer(context, std::move(builder)).render(from_front());
    const int shadowed = picture.at(79, 59)[1], lit = picture.at(79, 99)[1];
    if (2 * shadowed > lit + shadowed || shadowed > 120) // about 89 from ambient light alone, 195 if lit
        throw Failure(
            fmt::format("pixel (79, 59): a ball is between lamp and plane, but the code is {}; the lit plane has {}",
                        shadowed, lit))
            .with("rendered", picture)
            .at(79, 59);
}

constexpr const char *gate = "raytracer.render";
constexpr arhost_kind kind = ARHOST_KIND_RAYTRACER;
constexpr Test tests[] = {
    {"raytracer.colour-order", "The bytes of a pixel are red, green, blue, alpha.", kind, gate, 20s, colour_order},
    {"raytracer.srgb", "Colours are sRGB-encoded, within one code.", kind, gate, 20s, srgb},
    {"raytracer.lambert", "A plane under a lamp follows Lambert's law, within one code.", kind, gate, 20s, lambert},
    {"raytracer.inverse-square", "A light with inverse-square falloff follows the inverse-square law.", kind, gate,
     20s, inverse_square},
    {"raytracer.directional-light", "A directional light comes from its direction.", kind, gate, 20s, directional},
    {"raytracer.shadow-on-object", "Objects cast shadows on other objects.", kind, gate, 20s, shadow_on_object},
};

} // namespace

std::span<const Test> raytracer_light_tests() {
    return tests;
}

} // namespace arhost::conformance
