// SPDX-License-Identifier: Apache-2.0
//
// A ray tracer that writes linear images and reads the video. Draws a square of 16 px in the top left corner: R and G
// are B and G of the video's first pixel, in which source_counter encodes the frame number, and B is 170, as with
// rt_counter. In the last pixel, the light of the video is halved if `shades` is set, and NaN if `writes_nan` is.
#include "faults.hpp"

#include <arhost-cpp/linear_pixel.hpp>
#include <arhost/shading/scalar.hpp>

#include <algorithm>
#include <limits>

namespace {

using namespace arhost;

class Light {
public:
    Light(const Host &, const Options &options)
        : faults_(options), shades_(options.boolean("shades")), writes_nan_(options.boolean("writes_nan")) {}

    void start(const arhost_raytracer_setup &setup) {
        if (setup.form != ARHOST_IMAGE_FORM_LINEAR || setup.compositing != ARHOST_COMPOSITING_LINEAR ||
            !setup.video_format)
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "needs linear images and video");
    }

    void render(const arhost_render_request &request, const arhost_image &image, arhost_render_info &) {
        faults_.at(request.sequence);
        const std::uint8_t *video = request.video->plane[0];
        const LinearPixel square = linear_pixel({light_of(video[0]), light_of(video[1]), light_of(170)}, {0, 0, 0});
        LinearPixel last = shades_ ? linear_pixel({0, 0, 0}, {0.5f, 0.5f, 0.5f}) : untouched;
        if (writes_nan_)
            std::fill_n(last.transmittance, 3, half_of(std::numeric_limits<float>::quiet_NaN()));
        for (std::uint32_t y = 0; y < image.height; ++y) {
            LinearPixel *row = linear_row(image, y);
            for (std::uint32_t x = 0; x < image.width; ++x)
                row[x] = x < 16 && y < 16 ? square : untouched;
        }
        linear_row(image, image.height - 1)[image.width - 1] = last;
    }

    void stop() {}

private:
    static float light_of(std::uint8_t code) { return static_cast<float>(shading::srgb_decode(code / 255.0)); }

    test::Faults faults_;
    bool shades_, writes_nan_;
};

constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_BOOL, "shades", "false", "Halves the light of the last pixel"),
    option(ARHOST_OPTION_BOOL, "writes_nan", "false", "Writes a NaN in the last pixel"), ARHOST_FAULT_OPTIONS};
constexpr arhost_descriptor descriptor = {sizeof(arhost_descriptor),
                                          ARHOST_KIND_RAYTRACER,
                                          "org.arhost.test.rt_light",
                                          "Light",
                                          "0.1.0",
                                          "arhost",
                                          "Apache-2.0",
                                          "Mirrors the video in a linear image, for tests.",
                                          ARHOST_RAYTRACER_CAPABILITY_LINEAR_IMAGES |
                                              ARHOST_RAYTRACER_CAPABILITY_VIDEO |
                                              ARHOST_RAYTRACER_CAPABILITY_SCALED_IMAGES,
                                          std::size(options),
                                          options,
                                          nullptr};

} // namespace

ARHOST_RAYTRACER(Light, descriptor)
