// @NAME@: a ray tracer for arhost. Here is the plugin, from cameras to images; what is seen along a ray is in
// tracer.hpp.
#include "tracer.hpp"

#include <arhost-cpp/plugin.hpp>

#include <algorithm>
#include <cmath>
#include <optional>

namespace {

std::uint8_t byte(double share) {
    return static_cast<std::uint8_t>(255 * std::clamp(share, 0.0, 1.0) + 0.5);
}
double srgb(double linear) {
    return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

// Pixel centres are at integers, rows run downwards, the camera looks along -back.
class Camera {
public:
    explicit Camera(const arhost_camera &camera) : eye_(vec(camera.eye)), lens_(camera.intrinsics) {
        const Vec back = eye_ - vec(camera.look_at), up = vec(camera.up), right = cross(up, back);
        if (!(length(right) > 1e-9 * length(up) * length(back))) // nor is it where a number is not finite
            throw arhost::Failure(ARHOST_STATUS_ERROR_INVALID_ARGUMENT, "the camera's up is parallel to its view");
        back_ = normalised(back);
        right_ = normalised(right);
        up_ = cross(back_, right_);
    }
    Ray ray(double column, double row) const {
        const double x = (column - lens_.cx) / lens_.fx, y = (row - lens_.cy) / lens_.fy;
        return {eye_, normalised(x * right_ - y * up_ - back_)};
    }

private:
    Vec eye_, back_, right_, up_;
    const arhost_intrinsics &lens_;
};

class @CLASS@ {
public:
    @CLASS@(const arhost::Host &host, const arhost::Options &options)
        : host_(host), side_(std::sqrt(options.integer("samples"))) {}

    void start(const arhost_raytracer_setup &setup) { tracer_.emplace(*setup.scene); }
    void stop() { tracer_.reset(); }

    void render(const arhost_render_request &request, const arhost_image &image, arhost_render_info &) {
        const Camera camera(request.camera);
        if (request.motion)
            tracer_->move(*request.motion);
        for (std::uint32_t row = 0; row < image.height; ++row) {
            if (host_.cancelled()) // arhost wants to end: rows must not keep it waiting
                throw arhost::Failure(ARHOST_STATUS_ERROR_CANCELLED, "cancelled");
            std::uint8_t *pixel = image.rgba + std::size_t(row) * image.stride;
            for (std::uint32_t column = 0; column < image.width; ++column, pixel += 4)
                write(pixel, camera, column, row);
        }
    }

private:
    // The mean over a grid of rays. Alpha is straight: the colour is that of what was seen, not multiplied by how much
    // of the pixel it covers.
    void write(std::uint8_t *pixel, const Camera &camera, double column, double row) const {
        Vec sum; // of colours times alphas
        double alphas = 0;
        for (int i = 0; i < side_ * side_; ++i) {
            const double right = (i % side_ + 0.5) / side_ - 0.5, down = (i / side_ + 0.5) / side_ - 0.5;
            const Seen seen = tracer_->look(camera.ray(column + right, row + down));
            sum = sum + seen.alpha * seen.colour;
            alphas += seen.alpha;
        }
        const Vec colour = alphas > 0 ? 1 / alphas * sum : Vec{};
        pixel[0] = byte(srgb(colour.x));
        pixel[1] = byte(srgb(colour.y));
        pixel[2] = byte(srgb(colour.z));
        pixel[3] = byte(alphas / (side_ * side_));
    }

    arhost::Host host_;
    int side_; // of the grid of rays through a pixel
    std::optional<Tracer> tracer_;
};

// arhost checks the configuration against these before the constructor sees a value.
constexpr arhost_option_descriptor options[] = {
    arhost::option(ARHOST_OPTION_INTEGER, "samples", "1", "Rays a pixel: the largest square number up to it.", 1, 64),
};

constexpr arhost_descriptor descriptor = {
    sizeof(arhost_descriptor),
    ARHOST_KIND_RAYTRACER,
    "@NAME@", // the file's name
    "@NAME@",
    "0.1.0",
    "unknown", // FILL IN: you
    "NONE", // FILL IN: the licence (SPDX), "Apache-2.0"
    "Traces rays by brute force.",
    0, // FILL IN: ARHOST_CAPABILITY_LENS_DISTORTION, once rays go through the lens
    std::size(options),
    options,
    nullptr, // what of the machine it needs: arhost/plugin.h
};

} // namespace

ARHOST_RAYTRACER(@CLASS@, descriptor)
