// SPDX-License-Identifier: Apache-2.0
//
// Colours and brightness, against the formulas of arhost/scene.h.
#include "conformance/expect.hpp"
#include "conformance/tracer.hpp"

#include <arhost/shading/srgb8.hpp>

#include <glm/geometric.hpp>

#include <numbers>

namespace arhost::conformance {
namespace {

using shading::srgb8_exact;

double linear_light(int code) {
    return shading::srgb_decode(code / 255.0);
}

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

// The light of a glass ball's shadow on an object, relative to the light without a ball.
void glass_shadow(Context &context) {
    need_capability(context, ARHOST_RAYTRACER_CAPABILITY_GLASS, "GLASS");
    const glm::vec3 attenuation(0.9f, 0.6f, 0.3f);
    arhost_material material = glass();
    std::copy_n(&attenuation.x, 3, material.shadow_attenuation);
    scene::ArenaBuilder builder;
    builder.settings.ambient = glm::vec3(0);
    builder.add_object("plane", builder.add_triangles(square(150, 0)), builder.add_material(diffuse(glm::vec3(1))));
    builder.add_object("ball", builder.add_spheres({{30, 0, 40, 12}}), builder.add_material(material));
    builder.add_light(lamp({150, 0, 200}, 1));
    const Picture picture = Tracer(context, std::move(builder)).render(from_front());
    const Pixel p = picture.at(79, 59);
    for (int channel = 0; channel < 3; ++channel) {
        const double cosine = 0.8, transmittance = double{attenuation[channel]} * double{attenuation[channel]};
        const int expected = srgb8_exact(cosine * transmittance);
        if (std::abs(p[channel] - expected) > 2)
            throw Failure(fmt::format("pixel (79, 59): the lamp shines through the centre of a glass ball, whose two "
                                      "surfaces transmit {:.2f} of its {} light; the code is {}, expected {}",
                                      transmittance, std::array{"red", "green", "blue"}[channel], p[channel],
                                      expected))
                .with("rendered", picture)
                .at(79, 59);
    }
}

// Lamps of radiance 0.5 that are seen in a mirror or through a pane of glass without refraction and reflection.
void visible_lamps(Context &context) {
    need_capability(context, ARHOST_RAYTRACER_CAPABILITY_AREA_LIGHTS, "AREA_LIGHTS");
    arhost_material pane = glass();
    pane.index = 1;
    pane.fresnel_minimum = pane.fresnel_maximum = 0;
    struct Way {
        const char *name;
        std::uint64_t capability;
        arhost_material material;
        float lamp_z; // between camera and mirror, or behind the pane; its lower or upper side is visible
    };
    bool is_checked = false;
    for (const Way &way : {Way{"in a mirror", ARHOST_RAYTRACER_CAPABILITY_REFLECTION, mirror(1), 100},
                           Way{"through a pane of glass", ARHOST_RAYTRACER_CAPABILITY_GLASS, pane, -100}})
        for (const arhost_light_type type : {ARHOST_LIGHT_SPHERE, ARHOST_LIGHT_RECTANGLE}) {
            if (!has_capability(context, way.capability))
                continue;
            is_checked = true;
            arhost_light light = scene::make_light(type);
            light.falloff = ARHOST_FALLOFF_INVERSE_SQUARE;
            light.position[2] = way.lamp_z;
            light.direction[2] = way.lamp_z > 0 ? -1.0f : 1.0f;
            light.radius = light.axis_u[0] = light.axis_v[1] = 20;
            const double area = type == ARHOST_LIGHT_SPHERE ? 400 * std::numbers::pi : 1600;
            std::fill_n(light.intensity, 3, static_cast<float>(0.5 * area / std::numbers::pi));
            scene::ArenaBuilder builder;
            builder.settings.background = glm::vec3(0);
            // No pixel centre is on a diagonal: a fast ray tracer may leave a gap between triangles that share an
            // edge.
            builder.add_object("surface", builder.add_triangles(box({60, 61, 0.5f})),
                               builder.add_material(way.material));
            builder.add_light(light);
            const Picture picture = Tracer(context, std::move(builder)).render(from_front());
            expect_pixels(picture, [&](auto x, auto y) {
                // Seen from 300 mm, a lamp's half side of 20 mm is 13.3 px long, the half diagonal 18.9 px.
                const double r = distance_from_centre(picture, x, y);
                const int code = picture.at(x, y)[1], expected = r < 12 ? srgb8_exact(0.5) : 0;
                return (r >= 12 && r < 20) || r > 50 || std::abs(code - expected) <= 2
                           ? ""
                           : fmt::format("a {} lamp of radiance 0.5 is {}visible {}: the code is {}, expected {}",
                                         type == ARHOST_LIGHT_SPHERE ? "spherical" : "rectangular",
                                         r < 12 ? "" : "not ", way.name, code, expected);
            });
        }
    if (!is_checked)
        throw Skip(
            "neither ARHOST_RAYTRACER_CAPABILITY_REFLECTION nor ARHOST_RAYTRACER_CAPABILITY_GLASS is declared");
}

// A coarse ball whose normals are those of a sphere.
void shadow_terminator(Context &context) {
    constexpr double radius = 45;
    scene::TriangleMesh mesh = ball(8, 12);
    for (glm::vec3 &position : mesh.positions)
        position *= radius;
    scene::ArenaBuilder builder;
    builder.settings.ambient = glm::vec3(0);
    builder.add_object("ball", builder.add_triangles(mesh), builder.add_material(diffuse(glm::vec3(1))));
    arhost_light sun = scene::make_light(ARHOST_LIGHT_DIRECTIONAL);
    const glm::vec3 to_sun(0.8f, 0.36f, 0.48f);
    for (int axis = 0; axis < 3; ++axis)
        sun.direction[axis] = -to_sun[axis];
    builder.add_light(sun);
    const Picture picture = Tracer(context, std::move(builder)).render(from_front());
    expect_pixels(picture, [&](auto x, auto y) {
        const glm::dvec3 eye(0, 0, 200), ray = glm::normalize(glm::dvec3(x - 79.5, 59.5 - y, -200));
        const double middle = -glm::dot(eye, ray), aside = 200.0 * 200 - middle * middle;
        if (aside > 0.9 * radius * radius) // beside the ball, or close to its silhouette
            return std::string();
        const glm::dvec3 normal = (eye + (middle - std::sqrt(radius * radius - aside)) * ray) / radius;
        const double expected = std::max(glm::dot(normal, glm::dvec3(to_sun)), 0.0);
        const double light = linear_light(picture.at(x, y)[1]);
        return std::abs(light - expected) < 0.1
                   ? ""
                   : fmt::format(
                         "a smooth mesh approximates a ball that has the light {:.2f} here, but it has {:.2f}",
                         expected, light);
    });
}

// Renders a slanted edge between a black surface and one of radiance `brightness`. Returns by how many pixels it
// seems to be displaced towards the black one, from the mean linear light of 100 rows.
double edge_displacement(Context &context, float brightness) {
    scene::ArenaBuilder builder;
    builder.settings.ambient = glm::vec3(brightness);
    const scene::TriangleMesh left{{{-30, -300, 0}, {30, 300, 0}, {-600, 0, 0}}, {}, {}, {{0, 1, 2}}};
    builder.add_object("bright", builder.add_triangles(left), builder.add_material(glowing(glm::vec3(1))));
    builder.add_object("black", builder.add_triangles(square(300, -0.1f)),
                       builder.add_material(glowing(glm::vec3(0))));
    const Picture picture = Tracer(context, std::move(builder), many_samples(context)).render(from_front());
    double light = 0; // of 100 rows of 20 px around the edge, which is at 74.5 to 84.5 px
    for (std::uint32_t y = 10; y < 110; ++y)
        for (std::uint32_t x = 70; x < 90; ++x)
            light += linear_light(picture.at(x, y)[1]);
    if (count_pixels(picture, [&](auto x, auto y) { return picture.at(x, y)[1] % 255 != 0; }) == 0)
        throw Skip("no pixel is a mean of several samples");
    return light / 100 - 10;
}

void linear_samples(Context &context) {
    if (const double white = edge_displacement(context, 1); std::abs(white) > 0.1)
        throw Failure(fmt::format("an edge between white and black seems to be displaced by {:.2f} px; expected 0: "
                                  "samples are averaged in linear light",
                                  white));
    constexpr double expected = 0.375; // a pixel is white if a quarter of it is covered
    if (const double bright = edge_displacement(context, 4); std::abs(bright - expected) > 0.15)
        throw Failure(fmt::format("an edge between 4 times white and black seems to be displaced by {:.2f} px; "
                                  "expected {}: samples brighter than white count in full",
                                  bright, expected));
}

constexpr const char *gate = "raytracer.render";
constexpr Test tests[] = {
    {"raytracer.colour-order", "The bytes of a pixel are red, green, blue, alpha.", gate, 20s, colour_order},
    {"raytracer.srgb", "Colours are sRGB-encoded, within one code.", gate, 20s, srgb},
    {"raytracer.lambert", "A plane under a lamp follows Lambert's law, within one code.", gate, 20s, lambert},
    {"raytracer.inverse-square", "A light with inverse-square falloff follows the inverse-square law.", gate, 20s,
     inverse_square},
    {"raytracer.directional-light", "A directional light comes from its direction.", gate, 20s, directional},
    {"raytracer.shadow-on-object", "Objects cast shadows on other objects.", gate, 20s, shadow_on_object},
    {"raytracer.shadow-terminator", "A smooth mesh is lit up to the terminator of its normals, without facets.", gate,
     20s, shadow_terminator},
    {"raytracer.glass-shadow", "Glass tints the light that it lets through to objects by shadow_attenuation.", gate,
     20s, glass_shadow},
    {"raytracer.visible-lamps", "Area lights are visible in mirrors and through glass, with their radiance.", gate,
     20s, visible_lamps},
    {"raytracer.linear-samples",
     "Samples are averaged in linear light, in which samples brighter than white count in full.", gate, 20s,
     linear_samples},
};

} // namespace

std::span<const Test> raytracer_light_tests() {
    return tests;
}

} // namespace arhost::conformance
