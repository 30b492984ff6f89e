// SPDX-License-Identifier: Apache-2.0
//
// Used by all ray tracer benchmarks: the test mesh, an arhost_host that prints log messages, and setups.
#pragma once

#include "scene/arena_builder.hpp"
#include "scene/mesh_loader.hpp"

#include <arhost/plugin.h>
#include <arhost/raytracer.h>

#include <glm/common.hpp>
#include <glm/gtc/constants.hpp>

#include <cmath>
#include <cstdio>
#include <filesystem>

namespace arhost::bench {

// Returns a ball of about `triangles` triangles with dents that occlude each other.
inline scene::TriangleMesh dented_ball(unsigned triangles) {
    scene::TriangleMesh mesh;
    const auto rings = static_cast<unsigned>(std::lround(std::sqrt(triangles / 2.0))), sides = rings + 1;
    for (unsigned ring = 0; ring <= rings; ++ring)
        for (unsigned side = 0; side <= sides; ++side) {
            const float theta = glm::pi<float>() * static_cast<float>(ring) / static_cast<float>(rings),
                        phi = glm::two_pi<float>() * static_cast<float>(side) / static_cast<float>(sides);
            const float r = 50 + 6 * std::sin(9 * theta) * std::cos(8 * phi);
            mesh.positions.push_back(
                r * glm::vec3(std::sin(theta) * std::cos(phi), std::cos(theta), std::sin(theta) * std::sin(phi)));
            if (ring < rings && side < sides) {
                const unsigned a = ring * (sides + 1) + side, b = a + sides + 1;
                mesh.triangles.push_back({a, a + 1, b});
                mesh.triangles.push_back({a + 1, b + 1, b});
            }
        }
    mesh.normals = scene::smooth_normals(mesh);
    return mesh;
}

struct NamedMesh {
    scene::TriangleMesh mesh;
    const char *name;
};

// Returns the Stanford bunny from `shared_data`, or a dented ball if the bunny's file is missing. Either is 100 mm
// high and stands on the plane y = 0.
inline NamedMesh bunny(const std::filesystem::path &shared_data) {
    const std::filesystem::path file = shared_data / "meshes/bunny_69451.ply.gz";
    const bool exists = std::filesystem::exists(file);
    NamedMesh named{exists ? scene::load_mesh(file, {.smooth = true}) : dented_ball(69'451),
                    exists ? "bunny" : "dented ball"};
    std::vector<glm::vec3> &positions = named.mesh.positions;
    glm::vec3 low = positions[0], high = low;
    for (const glm::vec3 &p : positions) {
        low = glm::min(low, p);
        high = glm::max(high, p);
    }
    for (glm::vec3 &p : positions)
        p = (p - glm::vec3((low.x + high.x) / 2, low.y, (low.z + high.z) / 2)) * (100 / (high.y - low.y));
    return named;
}

// Returns an arhost_host that prints log messages to stderr.
inline arhost_host printing_host(const char *name) {
    return {sizeof(arhost_host),
            ARHOST_ABI_VERSION,
            name,
            "0",
            nullptr,
            [](const arhost_host *, arhost_severity, const char *text) { std::fprintf(stderr, "%s\n", text); },
            [](const arhost_host *, double, const char *) {},
            [](const arhost_host *) { return 0; },
            [](const arhost_host *, const char *) -> const void * { return nullptr; }};
}

// Returns the intrinsics of a camera without distortion, whose principal point is in the middle of the image.
inline arhost_intrinsics centred_pinhole(std::uint32_t width, std::uint32_t height, double focal_px) {
    return {sizeof(arhost_intrinsics),
            width,
            height,
            ARHOST_DISTORTION_NONE,
            focal_px,
            focal_px,
            (width - 1) / 2.0,
            (height - 1) / 2.0,
            0,
            0,
            {},
            {}};
}

// Returns the setup for linear images. Refers to both arguments.
inline arhost_raytracer_setup linear_setup(const arhost_scene &scene, const arhost_intrinsics &intrinsics) {
    arhost_raytracer_setup setup{};
    setup.struct_size = sizeof setup;
    setup.width = intrinsics.width;
    setup.height = intrinsics.height;
    setup.form = ARHOST_IMAGE_FORM_LINEAR;
    setup.scene = &scene;
    setup.intrinsics = &intrinsics;
    setup.compositing = ARHOST_COMPOSITING_LINEAR;
    return setup;
}

} // namespace arhost::bench
