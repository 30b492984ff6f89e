// SPDX-License-Identifier: Apache-2.0
//
// A ray tracer that writes linear images and reads the video. Draws a square of 16 px in the top left corner: R and G
// are B and G of the video's first pixel, in which source_counter encodes the frame number, and B is 170, as with
// rt_counter. In the last pixel, the light of the video is halved if `shades` is set.
#include "faults.hpp"

#include <arhost/shading/scalar.hpp>

#include <cstring>

namespace {

using namespace arhost;

class Light {
public:
    Light(const Host &, const Options &options) : faults_(options), shades_(options.boolean("shades")) {}

    void start(const arhost_raytracer_setup &setup) {
        if (setup.form != ARHOST_IMAGE_FORM_LINEAR || setup.compositing != ARHOST_COMPOSITING_LINEAR ||
            !setup.video_format)
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "needs linear images and video");
    }

    void render(const arhost_render_request &request, const arhost_image &image, arhost_render_info &) {
        faults_.at(request.sequence);
        const std::uint8_t *video = request.video->plane[0];
        const float square[] = {light_of(video[0]), light_of(video[1]), light_of(170), 0, 0, 0, 0, 0};
        const float empty[] = {0, 0, 0, 0, 1, 1, 1, 0}, shade[] = {0, 0, 0, 0, 0.5f, 0.5f, 0.5f, 0};
        for (std::uint32_t y = 0; y < image.height; ++y)
            for (std::uint32_t x = 0; x < image.width; ++x) {
                const bool is_last = x + 1 == image.width && y + 1 == image.height;
                const float *from = x < 16 && y < 16 ? square : is_last && shades_ ? shade : empty;
                std::uint16_t *pixel = image.linear + std::size_t{y} * image.stride / 2 + std::size_t{8} * x;
                for (int i = 0; i < 8; ++i)
                    pixel[i] = half_of(from[i]);
            }
    }

    void stop() {}

private:
    static float light_of(std::uint8_t code) { return static_cast<float>(shading::srgb_decode(code / 255.0)); }
    // Only for 0 and for normal numbers.
    static std::uint16_t half_of(float number) {
        std::uint32_t bits;
        std::memcpy(&bits, &number, sizeof bits);
        bits += 0x1000; // rounds to nearest
        return number == 0 ? std::uint16_t{0} : static_cast<std::uint16_t>((bits >> 13) - ((127 - 15) << 10));
    }

    test::Faults faults_;
    bool shades_;
};

constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_BOOL, "shades", "false", "Halves the light of the last pixel"), ARHOST_FAULT_OPTIONS};
constexpr arhost_descriptor descriptor = {sizeof(arhost_descriptor),
                                          ARHOST_KIND_RAYTRACER,
                                          "rt_light",
                                          "Light",
                                          "0.1.0",
                                          "arhost",
                                          "Apache-2.0",
                                          "Mirrors the video in a linear image, for tests.",
                                          ARHOST_CAPABILITY_LINEAR_IMAGES | ARHOST_CAPABILITY_VIDEO,
                                          std::size(options),
                                          options,
                                          nullptr};

} // namespace

ARHOST_RAYTRACER(Light, descriptor)
