// SPDX-License-Identifier: Apache-2.0
//
// The same image by rt_vulkan and by rt_embree, and how alike the two are.
#pragma once

#include "tracer.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <limits>

namespace arhost::test {

// Mesa 25's lavapipe spends half a minute on the best code for a shader of ours, which small pictures don't repay.
inline const bool compiles_quickly =
    ::setenv("GALLIVM_PERF", "nopt", 0) == 0 && ::setenv("LP_NATIVE_VECTOR_WIDTH", "128", 0) == 0;

// What rt_vulkan says against making it here, "" where there is a device that has the path.
inline std::string no_vulkan(const std::string &path = "auto") {
    PluginUnderTest plugin("rt_vulkan");
    return plugin.create({{"path", path}}) == ARHOST_STATUS_OK ? "" : plugin.log();
}
#define ARHOST_REQUIRE_VULKAN(...)                                                                                   \
    if (const std::string missing = ::arhost::test::no_vulkan(__VA_ARGS__); !missing.empty())                        \
    GTEST_SKIP() << missing

struct Likeness {
    int pixels = 0, alphas_off = 0;
    int alphas_off_inside = 0; // where the reference has one alpha class for a pixel round
    int inside = 0;            // pixels of alpha 255 amid others, which PSNR is of
    int colours_off = 0;       // of those inside, by more than 2 codes
    double squares = 0;        // the sum of the differences' of these, channel by channel, in codes

    // dB; infinite where they are the same.
    double psnr() const {
        return squares > 0 ? 10 * std::log10(255.0 * 255.0 * 3 * inside / squares)
                           : std::numeric_limits<double>::infinity();
    }
    // Of several pictures as of one.
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
    return stream << like.pixels << " px, " << like.alphas_off << " alphas off (" << like.alphas_off_inside
                  << " of them inside), " << like.psnr() << " dB over " << like.inside << " px inside, "
                  << like.colours_off << " colours off";
}

// Nothing is inside at the picture's border.
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
            // A code apart is how means round, not another class.
            const bool off = std::abs(a[3] - b[3]) > 1;
            like.alphas_off += off;
            like.alphas_off_inside += off && is_inside;
            if (!is_inside || b[3] != 255 || a[3] != 255)
                continue;
            ++like.inside;
            int most = 0;
            for (std::size_t i = 0; i < 3; ++i) {
                like.squares += (a[i] - b[i]) * (a[i] - b[i]);
                most = std::max(most, std::abs(a[i] - b[i]));
            }
            like.colours_off += most > 2;
        }
    return like;
}

// Both tracers take these options.
inline Picture picture_by(const std::string &plugin, scene::ArenaBuilder scene, const arhost_camera &view,
                          const Options &options = {}) {
    return Tracer(std::move(scene), options, plugin).render(view);
}

} // namespace arhost::test
