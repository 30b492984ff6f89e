// SPDX-License-Identifier: Apache-2.0
//
// Renders the same image with rt_vulkan and rt_embree, and measures the difference.
#pragma once

#include "tracer.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <limits>

namespace arhost::test {

// Reduces lavapipe's shader optimization: with Mesa 25, optimizing one of the shaders takes half a minute, much
// longer than tracing the small pictures of the tests.
inline const bool compiles_quickly =
    ::setenv("GALLIVM_PERF", "nopt", 0) == 0 && ::setenv("LP_NATIVE_VECTOR_WIDTH", "128", 0) == 0;

// Returns "" if rt_vulkan can be created with `path` on this machine, else the plugin's error message.
inline std::string no_vulkan(const std::string &path = "auto") {
    PluginUnderTest plugin("rt_vulkan");
    return plugin.create({{"path", path}}) == ARHOST_STATUS_OK ? "" : plugin.log();
}
#define ARHOST_REQUIRE_VULKAN(...)                                                                                   \
    if (const std::string missing = ::arhost::test::no_vulkan(__VA_ARGS__); !missing.empty())                        \
    GTEST_SKIP() << missing

struct Likeness {
    int pixels = 0, alphas_off = 0;
    // A pixel is "inside" if all its neighbours in the reference have the same alpha, to within 1 code.
    int alphas_off_inside = 0; // inside pixels whose alpha differs
    int inside = 0;            // inside pixels of alpha 255, whose colours are compared
    int colours_off = 0;       // inside pixels whose colour differs by more than 2 codes
    double squares = 0; // squared colour differences in codes², summed over the inside pixels and all channels

    // Returns the PSNR of the inside pixels in dB; infinite if their colours are equal.
    double psnr() const {
        return squares > 0 ? 10 * std::log10(255.0 * 255.0 * 3 * inside / squares)
                           : std::numeric_limits<double>::infinity();
    }
    // Adds the counts of another picture.
    Likeness &operator+=(const Likeness &other) {
        pixels += other.pixels;
        alphas_off += other.alphas_off;
        alphas_off_inside += other.alphas_off_inside;
        inside += other.inside;
        colours_off += other.colours_off;
        squares += other.squares;
        return *this;
    }
};
inline std::ostream &operator<<(std::ostream &stream, const Likeness &like) {
    // tools/likeness parses this text.
    return stream << like.pixels << " px, " << like.alphas_off << " alphas off (" << like.alphas_off_inside
                  << " of them inside), " << like.psnr() << " dB over " << like.inside << " px inside, "
                  << like.colours_off << " colours off";
}

// Compares two pictures. Pixels at the border of the picture do not count as inside.
inline Likeness likeness(const Picture &got, const Picture &reference) {
    Likeness like;
    for (std::uint32_t y = 0; y < got.height; ++y)
        for (std::uint32_t x = 0; x < got.width; ++x) {
            const Pixel a = got.at(x, y), b = reference.at(x, y);
            bool is_inside = x > 0 && y > 0 && x + 1 < got.width && y + 1 < got.height;
            for (std::uint32_t v = y - 1; is_inside && v <= y + 1; ++v)
                for (std::uint32_t u = x - 1; is_inside && u <= x + 1; ++u)
                    is_inside = std::abs(reference.alpha(u, v) - b[3]) <= 1;
            ++like.pixels;
            // A difference of one code is a rounding error of the mean over several samples.
            const bool off = std::abs(a[3] - b[3]) > 1;
            like.alphas_off += off;
            like.alphas_off_inside += off && is_inside;
            if (!is_inside || b[3] != 255 || a[3] != 255)
                continue;
            ++like.inside;
            int max_difference = 0;
            for (std::size_t i = 0; i < 3; ++i) {
                like.squares += (a[i] - b[i]) * (a[i] - b[i]);
                max_difference = std::max(max_difference, std::abs(a[i] - b[i]));
            }
            like.colours_off += max_difference > 2;
        }
    return like;
}

// Renders a picture with `plugin`. Callers pass the same `options` to both plugins, so both must support them.
inline Picture picture_by(const std::string &plugin, scene::ArenaBuilder scene, const arhost_camera &view,
                          const Options &options = {}) {
    return Tracer(std::move(scene), options, plugin).render(view);
}

} // namespace arhost::test
