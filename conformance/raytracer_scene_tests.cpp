// SPDX-License-Identifier: Apache-2.0
// Equivalent scenes look the same, and large ones are rendered completely.
#include "conformance/expect.hpp"
#include "conformance/tracer.hpp"

#include <glm/gtc/matrix_inverse.hpp>
#include <glm/gtc/matrix_transform.hpp>

#include <utility>
#include <vector>

namespace arhost::conformance {
namespace {

struct Part {
    scene::TriangleMesh mesh; // empty if the part has spheres
    scene::Spheres spheres;   // empty if the part has a mesh
    std::uint32_t material;   // index in scene_of
    arhost_role role = ARHOST_ROLE_VIRTUAL;
    glm::mat4 transform{1};
};

// A smooth ellipsoid, a box, balls and a post on a table, each with a transform.
std::vector<Part> parts() {
    const auto at = [](float x, float y, float z) { return glm::translate(glm::mat4(1), glm::vec3(x, y, z)); };
    const glm::mat4 turned = glm::rotate(at(-34, 6, 20), 0.5f, glm::vec3(0, 0, 1));
    const glm::mat4 squeezed =
        glm::scale(glm::rotate(at(22, 10, 20), 0.6f, glm::vec3(1, 2, 0)), glm::vec3(8, 26, 16));
    return {{square(120, 0), {}, 0, ARHOST_ROLE_CATCHER, at(0, 0, 0)},
            {box({12, 14, 20}), {}, 1, ARHOST_ROLE_VIRTUAL, turned},
            {ball(16, 24), {}, 2, ARHOST_ROLE_VIRTUAL, squeezed},
            {{}, {{-8, 0, 0, 9}, {10, -4, 0, 7}}, 3, ARHOST_ROLE_VIRTUAL, at(-4, -40, 12)},
            {box({4, 4, 30}), {}, 0, ARHOST_ROLE_OCCLUDER, at(52, -25, 30)}};
}

scene::ArenaBuilder scene_of(const std::vector<Part> &parts) {
    scene::ArenaBuilder builder;
    for (const glm::vec3 &colour :
         {glm::vec3(0.7f), glm::vec3(0.8f, 0.2f, 0.1f), glm::vec3(0.2f, 0.4f, 0.6f), glm::vec3(0.3f, 0.7f, 0.2f)})
        builder.add_material(diffuse(colour));
    for (const Part &part : parts) {
        const std::uint32_t geometry =
            part.spheres.empty() ? builder.add_triangles(part.mesh) : builder.add_spheres(part.spheres);
        builder.add_object("part", geometry, part.material, part.role, glm::mat4x3(part.transform));
    }
    builder.add_light(lamp({40, -80, 160}, 0.6f));
    builder.add_light(lamp({-120, -60, 200}, 0.3f));
    return builder;
}

void expect_same(Context &context, const std::vector<Part> &other, const std::string &violation) {
    const Picture expected = Tracer(context, scene_of(parts())).render(still_life_camera());
    expect_alike(Tracer(context, scene_of(other)).render(still_life_camera()), expected, violation, 3, 0.01);
}

void object_order(Context &context) {
    const std::vector<Part> all = parts();
    const std::vector<Part> reversed(all.rbegin(), all.rend());
    expect_same(context, reversed, "reversing the order of objects changes the image");
}

void split_mesh(Context &context) {
    std::vector<Part> split;
    for (const Part &part : parts()) {
        for (const glm::vec4 &sphere : part.spheres)
            split.push_back({{}, {sphere}, part.material, part.role, part.transform});
        constexpr std::size_t pieces = 5;
        const std::vector<glm::uvec3> &all = part.mesh.triangles;
        for (std::size_t piece = 0; piece < pieces; ++piece) {
            Part object = part;
            object.mesh.triangles.assign(all.data() + piece * all.size() / pieces,
                                         all.data() + (piece + 1) * all.size() / pieces);
            if (!object.mesh.triangles.empty())
                split.push_back(std::move(object));
        }
    }
    expect_same(context, split, "splitting meshes into several objects changes the image");
}

void object_transform(Context &context) {
    std::vector<Part> in_world = parts();
    for (Part &part : in_world) {
        const glm::mat4 transform = std::exchange(part.transform, glm::mat4(1));
        const auto moved = [&](const glm::vec3 &point) { return glm::vec3(transform * glm::vec4(point, 1)); };
        for (glm::vec3 &position : part.mesh.positions)
            position = moved(position);
        for (glm::vec3 &normal : part.mesh.normals)
            normal = glm::normalize(glm::inverseTranspose(glm::mat3(transform)) * normal);
        for (glm::vec4 &sphere : part.spheres)
            sphere = glm::vec4(moved(glm::vec3(sphere)), sphere.w);
    }
    expect_same(context, in_world,
                "transforming vertices in advance instead of by world_from_object changes the image");
}

// ---- Large scenes ----------------------------------------------------------------------------------

void size(Context &context) {
    const Picture expected = Tracer(context, still_life()).render(still_life_camera());
    for (const double factor : {1e-3, 1e6}) {
        const glm::dmat4 scaled = glm::scale(glm::dmat4(1), glm::dvec3(factor));
        const Picture actual =
            Tracer(context, still_life(glm::mat4(scaled))).render(still_life_camera(pinhole(), scaled));
        expect_alike(actual, expected, fmt::format("scaling scene and camera by {:g} changes the image", factor), 3,
                     0.01);
    }
}

// Small, because the following tests check completeness, not speed.
arhost_intrinsics small_image() {
    return pinhole(40, 30, 50);
}

void many_triangles(Context &context) {
    scene::TriangleMesh mesh = ball(225, 224, false);
    for (glm::vec3 &position : mesh.positions)
        position *= 30;
    const std::size_t count = mesh.triangles.size();
    scene::ArenaBuilder builder;
    builder.settings.ambient = glm::vec3(1);
    builder.add_object("ball", builder.add_triangles(std::move(mesh)),
                       builder.add_material(glowing(glm::vec3(0.5f))));
    const Picture actual = Tracer(context, std::move(builder)).render(from_front(small_image()));
    expect_pixels(actual, [&](auto x, auto y) {
        const double r = distance_from_centre(actual, x, y), rim = 50 * 30 / std::sqrt(200.0 * 200 - 30 * 30);
        const int alpha = actual.alpha(x, y);
        if (r < rim - 1.5 && alpha < 250)
            return fmt::format("a ball of {} triangles covers this pixel, but alpha is {}", count, alpha);
        if (r > rim + 1.5 && alpha > 2)
            return fmt::format("outside a ball of {} triangles, alpha is {}", count, alpha);
        return std::string();
    });
}

void many_objects(Context &context) {
    scene::Spheres spheres;
    for (int row = 0; row < 25; ++row)
        for (int column = 0; column < 40; ++column)
            spheres.emplace_back(3.2f * static_cast<float>(column) - 62.4f, 3.2f * static_cast<float>(row) - 38.4f, 0,
                                 1.8f);
    scene::ArenaBuilder one, thousand;
    one.settings.ambient = thousand.settings.ambient = glm::vec3(1);
    const arhost_material material = glowing(glm::vec3(0.5f));
    one.add_object("all", one.add_spheres(spheres), one.add_material(material));
    const std::uint32_t same = thousand.add_material(material);
    for (const glm::vec4 &sphere : spheres)
        thousand.add_object("one", thousand.add_spheres({sphere}), same);
    const Picture expected = Tracer(context, std::move(one)).render(from_front(small_image()));
    expect_alike(Tracer(context, std::move(thousand)).render(from_front(small_image())), expected,
                 "1,000 objects of one sphere each look different from one object of 1,000 spheres", 3, 0.01);
}

constexpr const char *gate = "raytracer.render";
constexpr Test tests[] = {
    {"raytracer.object-order", "The order of objects does not matter.", gate, 20s, object_order},
    {"raytracer.split-mesh", "A mesh split into several objects looks the same.", gate, 20s, split_mesh},
    {"raytracer.object-transform", "world_from_object applies to positions and smooth normals.", gate, 20s,
     object_transform},
    {"raytracer.size", "Scaling scene and camera by 1e-3 or 1e6 does not change the image.", gate, 20s, size},
    {"raytracer.many-triangles", "A mesh of 100,000 triangles is rendered completely.", gate, 60s, many_triangles},
    {"raytracer.many-objects", "All of 1,000 objects are rendered.", gate, 60s, many_objects},
};

} // namespace

std::span<const Test> raytracer_scene_tests() {
    return tests;
}

} // namespace arhost::conformance
