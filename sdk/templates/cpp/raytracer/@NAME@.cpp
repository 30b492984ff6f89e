// @NAME@: a ray tracer for arhost. It draws one sphere that fills the scene's bounds.
#include <arhost-cpp/plugin.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace {

struct Vec {
    double x = 0, y = 0, z = 0;
};
Vec operator+(Vec a, Vec b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
}
Vec operator*(double s, Vec a) {
    return {s * a.x, s * a.y, s * a.z};
}
Vec operator-(Vec a, Vec b) {
    return a + -1 * b;
}
double dot(Vec a, Vec b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
Vec cross(Vec a, Vec b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
Vec normalised(Vec a) {
    return 1 / std::sqrt(dot(a, a)) * a;
}
template <class Number> Vec vec(const Number (&a)[3]) {
    return {double(a[0]), double(a[1]), double(a[2])};
}

std::uint8_t srgb_byte(double linear) {
    const double encoded = linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
    return static_cast<std::uint8_t>(255 * std::clamp(encoded, 0.0, 1.0) + 0.5);
}

class @CLASS@ {
public:
    @CLASS@(const arhost::Host &host, const arhost::Options &options)
        : host_(host), colour_{options.real("red"), options.real("green"), options.real("blue")} {}

    void start(const arhost_raytracer_setup &setup) {
        // FILL IN: read setup.scene->objects and geometries (arhost/scene.h), build what makes rays fast.
        const Vec low = vec(setup.scene->bounds_min), high = vec(setup.scene->bounds_max);
        centre_ = 0.5 * (low + high);
        radius_ = 0.5 * std::min({high.x - low.x, high.y - low.y, high.z - low.z});
    }

    void render(const arhost_render_request &request, const arhost_image &image, arhost_render_info &) {
        const arhost_intrinsics &lens = request.camera.intrinsics;
        const Vec eye = vec(request.camera.eye);
        const Vec back = normalised(eye - vec(request.camera.look_at));
        const Vec right = normalised(cross(vec(request.camera.up), back));
        const Vec up = cross(back, right);
        for (std::uint32_t row = 0; row < image.height; ++row) {
            if (host_.cancelled()) // arhost wants to end: rows must not keep it waiting
                throw arhost::Failure(ARHOST_ERROR_CANCELLED, "cancelled");
            std::uint8_t *pixel = image.rgba + std::size_t(row) * image.stride;
            for (std::uint32_t column = 0; column < image.width; ++column, pixel += 4) {
                // Four samples a pixel. Pixel centres are at integers, rows run downwards, the camera looks
                // along -back.
                Vec sum;
                int hits = 0;
                for (const auto [dx, dy] : samples) {
                    const double x = (column + dx - lens.cx) / lens.fx, y = (row + dy - lens.cy) / lens.fy;
                    if (const auto colour = trace(eye, normalised(x * right - y * up - back))) {
                        sum = sum + *colour;
                        ++hits;
                    }
                }
                // Straight alpha: the colour of those that hit, not multiplied by how many did. Where none
                // did, alpha is exactly 0, and the video shows.
                const Vec colour = 1.0 / std::max(hits, 1) * sum;
                pixel[0] = srgb_byte(colour.x);
                pixel[1] = srgb_byte(colour.y);
                pixel[2] = srgb_byte(colour.z);
                pixel[3] = static_cast<std::uint8_t>((255 * hits + 2) / 4);
            }
        }
    }

private:
    static constexpr std::array<std::array<double, 2>, 4> samples = {
        {{-0.25, -0.25}, {0.25, -0.25}, {-0.25, 0.25}, {0.25, 0.25}}};

    // What is seen along a ray of unit direction, in linear light; nothing where it misses.
    std::optional<Vec> trace(Vec origin, Vec direction) const {
        const Vec from_centre = origin - centre_;
        const double b = dot(from_centre, direction);
        const double discriminant = b * b - dot(from_centre, from_centre) + radius_ * radius_;
        const double distance = discriminant < 0 ? -1 : -b - std::sqrt(discriminant);
        if (distance <= 0)
            return std::nullopt;
        // FILL IN: your shading. This is a lamp at the camera.
        const Vec normal = 1 / radius_ * (from_centre + distance * direction);
        return (0.1 - 0.9 * dot(normal, direction)) * colour_;
    }

    arhost::Host host_;
    Vec colour_, centre_;
    double radius_ = 0; // mm, as all of the scene
};

// arhost checks the configuration against these before the constructor sees a value.
constexpr arhost_option_descriptor options[] = {
    arhost::option(ARHOST_OPTION_REAL, "red", "0.8", "Share of red light reflected.", 0, 1),
    arhost::option(ARHOST_OPTION_REAL, "green", "0.3", "Likewise green.", 0, 1),
    arhost::option(ARHOST_OPTION_REAL, "blue", "0.1", "Likewise blue.", 0, 1),
};

constexpr arhost_descriptor descriptor = {
    sizeof(arhost_descriptor),
    ARHOST_KIND_RAYTRACER,
    "@NAME@", // the file's name
    "@NAME@",
    "0.1.0",
    "unknown", // FILL IN: you
    "NONE", // FILL IN: the licence (SPDX), "Apache-2.0"
    "Draws a sphere.",
    0,
    std::size(options),
    options,
    nullptr, // what of the machine it needs: arhost/plugin.h
};

} // namespace

ARHOST_RAYTRACER(@CLASS@, descriptor)
