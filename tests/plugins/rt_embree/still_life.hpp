// SPDX-License-Identifier: Apache-2.0
//
// Path-traced scenes of a few objects, with which the denoiser is tested.
#pragma once

#include "linear_tracer.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <numbers>

namespace arhost::test {

// Settings of a scene whose surroundings send this light from everywhere.
inline scene::Settings path_traced(float background) {
    scene::Settings settings;
    settings.integrator = ARHOST_INTEGRATOR_PATH;
    settings.ambient = glm::vec3(0);
    settings.background = glm::vec3(background);
    return settings;
}

// Objects of several materials on a table, in soft light.
inline SceneBuilder still_life(const arhost_material &of_table = diffuse(0.4f, 0.4f, 0.4f)) {
    SceneBuilder scene(path_traced(0.4f));
    scene.add_mesh("table", square(2000), of_table, ARHOST_ROLE_CATCHER);
    scene.add_ball("red", {-35, 0, 25, 25}, diffuse(0.7f, 0.2f, 0.1f));
    scene.add_mesh("box", moved(cube(15), {30, 20, 15}), diffuse(0.7f, 0.7f, 0.7f));
    scene.add_ball("gold", {25, -30, 15, 15}, metallic_roughness({0.9f, 0.7f, 0.3f}, 1, 0.4f));
    scene.add_light(bulb({-150, -100, 250}, 60, 5e4f, ARHOST_FALLOFF_INVERSE_SQUARE));
    return scene;
}
inline arhost_camera turned(double degrees, const arhost_intrinsics &in = pinhole()) {
    const double angle = degrees * std::numbers::pi / 180;
    return camera({180 * std::sin(angle), -180 * std::cos(angle), 110}, {0, 0, 10}, {0, 0, 1}, in);
}

inline SceneBuilder with_mirror_and_glass(const arhost_material &of_table = diffuse(0.4f, 0.4f, 0.4f)) {
    SceneBuilder scene = still_life(of_table);
    scene.add_ball("mirror", {-10, 60, 25, 25}, mirror(0.9f));
    scene.add_ball("glass", {-45, -50, 14, 14}, glass_of());
    return scene;
}

// Root mean square of the differences over the pixels and channels of which use(x, y) is true, in what the host shows
// over white paper in linear light.
inline double difference(
    const LinearPicture &a, const LinearPicture &b,
    const std::function<bool(std::uint32_t, std::uint32_t)> &use = [](auto, auto) { return true; }) {
    double sum = 0;
    std::size_t count = 0;
    for (std::uint32_t y = 0; y < a.height; ++y)
        for (std::uint32_t x = 0; x < a.width; ++x)
            for (std::size_t c = 0; c < 3 && use(x, y); ++c, ++count) {
                const auto shown = [&](const LinearPicture &of) {
                    return std::min(double{of.value(x, y, c)} + double{of.value(x, y, 4 + c)}, 1.5);
                };
                sum += std::pow(shown(a) - shown(b), 2);
            }
    return std::sqrt(sum / static_cast<double>(count));
}

} // namespace arhost::test
