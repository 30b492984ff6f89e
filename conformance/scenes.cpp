// SPDX-License-Identifier: Apache-2.0
#include "conformance/scenes.hpp"

#include <glm/gtc/constants.hpp>
#include <glm/gtc/matrix_transform.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

namespace arhost::conformance {
namespace {

void copy(const glm::vec3 &from, float (&to)[3]) {
    std::copy_n(&from.x, 3, to);
}

} // namespace

arhost_intrinsics pinhole(std::uint32_t width, std::uint32_t height, double focal) {
    arhost_intrinsics in{};
    in.struct_size = sizeof in;
    in.width = width;
    in.height = height;
    in.distortion = ARHOST_DISTORTION_NONE;
    in.fx = in.fy = focal;
    in.cx = (width - 1) / 2.0;
    in.cy = (height - 1) / 2.0;
    return in;
}

arhost_camera camera(const glm::dvec3 &eye, const glm::dvec3 &look_at, const glm::dvec3 &up,
                     const arhost_intrinsics &intrinsics) {
    arhost_camera c{sizeof c, 0, {}, {}, {}, intrinsics, {}};
    std::copy_n(&eye.x, 3, c.eye);
    std::copy_n(&look_at.x, 3, c.look_at);
    std::copy_n(&up.x, 3, c.up);
    return c;
}

arhost_camera from_front(const arhost_intrinsics &intrinsics) {
    return camera({0, 0, 200}, {0, 0, 0}, {0, 1, 0}, intrinsics);
}

arhost_material glowing(const glm::vec3 &colour) {
    arhost_material material = scene::make_material(ARHOST_MATERIAL_DIFFUSE);
    copy(colour, material.ambient);
    return material;
}
arhost_material diffuse(const glm::vec3 &colour) {
    arhost_material material = glowing(colour);
    copy(colour, material.diffuse);
    return material;
}
arhost_material emissive(const glm::vec3 &radiance) {
    arhost_material material = glowing(glm::vec3(0));
    copy(radiance, material.emission);
    return material;
}
arhost_material mirror(float reflectivity) {
    arhost_material material = scene::make_material(ARHOST_MATERIAL_MIRROR);
    copy(glm::vec3(reflectivity), material.reflectivity);
    return material;
}
arhost_material glass() {
    arhost_material material = scene::make_material(ARHOST_MATERIAL_GLASS);
    material.index = 1.5f;
    return material;
}

arhost_light lamp(const glm::vec3 &position, float intensity) {
    arhost_light light = scene::make_light(ARHOST_LIGHT_POINT);
    light.falloff = ARHOST_FALLOFF_NONE;
    copy(position, light.position);
    copy(glm::vec3(intensity), light.intensity);
    return light;
}

scene::TriangleMesh square(float half_side, float z) {
    const float s = half_side;
    return {{{-s, -s, z}, {s, -s, z}, {s, s, z}, {-s, s, z}}, {}, {}, {{0, 1, 2}, {0, 2, 3}}};
}

scene::TriangleMesh box(const glm::vec3 &half_sides) {
    scene::TriangleMesh mesh;
    for (int corner = 0; corner < 8; ++corner)
        mesh.positions.push_back(half_sides *
                                 glm::vec3(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1));
    mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                      {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
    return mesh;
}

scene::TriangleMesh ball(std::uint32_t stacks, std::uint32_t slices, bool shared) {
    scene::TriangleMesh mesh;
    for (std::uint32_t stack = 0; stack <= stacks; ++stack)
        for (std::uint32_t slice = 0; slice < slices; ++slice) {
            const double theta = stack * glm::pi<double>() / stacks, phi = slice * glm::two_pi<double>() / slices;
            mesh.positions.emplace_back(std::sin(theta) * std::sin(phi), std::cos(theta),
                                        std::sin(theta) * std::cos(phi));
        }
    for (std::uint32_t stack = 0; stack < stacks; ++stack)
        for (std::uint32_t slice = 0; slice < slices; ++slice) {
            const std::uint32_t next = (slice + 1) % slices, above = stack * slices, below = above + slices;
            if (stack > 0) // at the poles one side of each quad has length 0
                mesh.triangles.emplace_back(above + slice, below + slice, above + next);
            if (stack + 1 < stacks)
                mesh.triangles.emplace_back(above + next, below + slice, below + next);
        }
    if (!shared) {
        const std::vector<glm::vec3> positions = std::exchange(mesh.positions, {});
        for (glm::uvec3 &triangle : mesh.triangles)
            for (int corner = 0; corner < 3; ++corner) {
                mesh.positions.push_back(positions[triangle[corner]]);
                triangle[corner] = static_cast<std::uint32_t>(mesh.positions.size() - 1);
            }
    }
    mesh.normals = mesh.positions;
    return mesh;
}

scene::ArenaBuilder one_sphere(const glm::vec4 &sphere, const arhost_material &material) {
    scene::ArenaBuilder builder;
    builder.settings.ambient = glm::vec3(1);
    builder.add_object("sphere", builder.add_spheres({sphere}), builder.add_material(material));
    return builder;
}

scene::ArenaBuilder ball_over_catcher(const arhost_material &ball) {
    scene::ArenaBuilder builder;
    builder.add_object("floor", builder.add_triangles(square(150, 0)), builder.add_material(diffuse(glm::vec3(0.8f))),
                       ARHOST_ROLE_CATCHER);
    builder.add_object("ball", builder.add_spheres({{30, 0, 40, 12}}), builder.add_material(ball));
    builder.add_light(lamp({150, 0, 200}, 1));
    return builder;
}

scene::ArenaBuilder path_scene(float background) {
    scene::ArenaBuilder builder;
    builder.settings.integrator = ARHOST_INTEGRATOR_PATH;
    builder.settings.ambient = glm::vec3(0);
    builder.settings.background = glm::vec3(background);
    return builder;
}

void add_table(scene::ArenaBuilder &builder) {
    builder.add_object("table", builder.add_triangles(square(400, 0)), builder.add_material(diffuse(glm::vec3(0.5f))),
                       ARHOST_ROLE_CATCHER);
}

scene::ArenaBuilder still_life(const glm::mat4 &moved, bool is_matte) {
    scene::ArenaBuilder builder;
    builder.settings.ambient = glm::vec3(0.2f);
    builder.settings.background = {0.5f, 0.6f, 0.7f};
    const auto at = [&](float x, float y, float z) { return glm::mat4x3(glm::translate(moved, glm::vec3(x, y, z))); };
    const std::uint32_t grey = builder.add_material(diffuse(glm::vec3(0.7f)));
    const std::uint32_t red = builder.add_material(diffuse({0.8f, 0.2f, 0.1f}));
    arhost_material shiny = diffuse({0.2f, 0.4f, 0.6f});
    if (!is_matte)
        shiny.model = ARHOST_MATERIAL_SPECULAR;
    copy(glm::vec3(0.4f), shiny.specular);
    shiny.exponent = 20;
    builder.add_object("floor", builder.add_triangles(square(120, 0)), grey, ARHOST_ROLE_CATCHER, at(0, 0, 0));
    builder.add_object("box", builder.add_triangles(box({12, 14, 20})), red, ARHOST_ROLE_VIRTUAL, at(-34, 6, 20));
    builder.add_object("mirror", builder.add_spheres({{0, 0, 0, 20}}),
                       is_matte ? grey : builder.add_material(mirror(0.9f)), ARHOST_ROLE_VIRTUAL, at(20, 10, 20));
    builder.add_object("ball", builder.add_spheres({{0, 0, 0, 12}}), builder.add_material(shiny), ARHOST_ROLE_VIRTUAL,
                       at(-4, -35, 12));
    builder.add_object("post", builder.add_triangles(box({4, 4, 30})), grey, ARHOST_ROLE_OCCLUDER, at(52, -25, 30));
    builder.add_light(lamp(glm::vec3(moved * glm::vec4(40, -80, 160, 1)), 0.8f));
    return builder;
}

arhost_camera still_life_camera(const arhost_intrinsics &intrinsics, const glm::dmat4 &moved) {
    const auto apply = [&](double x, double y, double z, double w) {
        return glm::dvec3(moved * glm::dvec4(x, y, z, w));
    };
    return camera(apply(10, -180, 130, 1), apply(0, 0, 10, 1), apply(0, 0, 1, 0), intrinsics);
}

} // namespace arhost::conformance
