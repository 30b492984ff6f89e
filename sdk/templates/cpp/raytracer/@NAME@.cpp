// @NAME@: a ray tracer for arhost. This file is the plugin: it turns cameras into rays and samples into images.
// tracer.hpp traces the rays.
#include "tracer.hpp"

#include <arhost-cpp/plugin.hpp>
#include <arhost/shading/scalar.hpp>

#include <algorithm>
#include <cmath>
#include <optional>

namespace {

// Pixel centres are at integer coordinates, rows go downwards, the camera looks along -back.
class Camera {
public:
    explicit Camera(const arhost_camera &camera) : eye_(vec(camera.eye)), lens_(camera.intrinsics) {
        const Vec back = eye_ - vec(camera.look_at), up = vec(camera.up), right = cross(up, back);
        if (!(length(right) > 1e-9 * length(up) * length(back))) // false for NaN too
            throw arhost::Failure(ARHOST_STATUS_ERROR_INVALID_ARGUMENT,
                                  "the camera's up vector is parallel to its viewing direction");
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

    void start(const arhost_raytracer_setup &setup) {
        scene_ = setup.scene;
        tracer_.emplace(*scene_);
    }
    void stop() { tracer_.reset(); }

    void render(const arhost_render_request &request, const arhost_image &image, arhost_render_info &) {
        const Camera camera(request.camera);
        if (request.motion)
            tracer_->update(*request.motion);
        for (std::uint32_t row = 0; row < image.height; ++row) {
            if (host_.cancelled()) // arhost wants this call to return soon
                throw arhost::Failure(ARHOST_STATUS_ERROR_CANCELLED, "cancelled");
            std::uint8_t *pixel = image.rgba + std::size_t(row) * image.stride;
            for (std::uint32_t column = 0; column < image.width; ++column, pixel += 4)
                write(pixel, camera, column, row);
        }
    }

private:
    // Averages a grid of rays in linear light. Objects and shadows are averaged separately and then blended by their
    // shares of the alpha. Alpha is straight: the colour is not multiplied by alpha.
    void write(std::uint8_t *pixel, const Camera &camera, double column, double row) const {
        Vec colour;
        double hits = 0, opaque = 0, translucent = 0;
        const int count = side_ * side_;
        for (int i = 0; i < count; ++i) {
            const double right = (i % side_ + 0.5) / side_ - 0.5, down = (i / side_ + 0.5) / side_ - 0.5;
            const Sample sample = tracer_->trace(camera.ray(column + right, row + down));
            hits += sample.is_virtual;
            colour = colour + sample.colour;
            opaque += sample.opaque;
            translucent += sample.translucent;
        }
        const double coverage = hits / count, others = std::max(count - hits, 1.0);
        const double shadow =
            arhost::shading::shadow_alpha(opaque / others, translucent / others, scene_->shadow_alpha_opaque,
                                          scene_->shadow_alpha_translucent);
        const double alpha = coverage + (1 - coverage) * shadow;
        const double share = alpha > 0 ? coverage / alpha : 0; // shadows are black
        const auto to_byte = [](double value) { return static_cast<std::uint8_t>(arhost::shading::code_8bit(value)); };
        const auto encode = [&](double sum) {
            return to_byte(share * arhost::shading::srgb_encode(sum / std::max(hits, 1.0)));
        };
        pixel[0] = encode(colour.x);
        pixel[1] = encode(colour.y);
        pixel[2] = encode(colour.z);
        pixel[3] = to_byte(alpha);
    }

    arhost::Host host_;
    int side_; // rays per pixel: side × side
    const arhost_scene *scene_ = nullptr;
    std::optional<Tracer> tracer_;
};

// arhost validates the configuration against these before it calls the constructor.
constexpr arhost_option_descriptor options[] = {
    arhost::option(ARHOST_OPTION_INTEGER, "samples", "1", "Rays per pixel, rounded down to a square number.", 1, 64),
};

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_RAYTRACER,
    .id = "org.example.@NAME@", // FILL IN: your domain in reverse order; ends with the file name
    .name = "@NAME@",
    .version = "0.1.0",
    .vendor = "unknown", // FILL IN: your name
    .licence = "NONE",   // FILL IN: SPDX identifier, e.g. "Apache-2.0"
    .description = "Brute-force ray tracer.",
    // FILL IN: what you implement, such as ARHOST_RAYTRACER_CAPABILITY_TEXTURES or ARHOST_RAYTRACER_CAPABILITY_LENS_DISTORTION. arhost warns if
    // a scene needs more.
    .capabilities = ARHOST_RAYTRACER_CAPABILITY_REFLECTION | ARHOST_RAYTRACER_CAPABILITY_MOTION,
    .option_count = std::size(options),
    .options = options,
    .needs = nullptr, // permissions from the sandbox: arhost/plugin.h
};

} // namespace

ARHOST_RAYTRACER(@CLASS@, descriptor)
