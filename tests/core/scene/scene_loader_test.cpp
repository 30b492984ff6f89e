// SPDX-License-Identifier: Apache-2.0
#include "errors.hpp"
#include "plugin_under_test.hpp"
#include "scene/scene_loader.hpp"
#include "scene_samples.hpp"

#include <directories.hpp>
#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <numbers>
#include <span>

using namespace arhost::scene;
using namespace arhost::scene::test;
using arhost::test::ScratchFolder;
using arhost::yaml::Node;
using testing::ElementsAre;
using testing::FloatNear;
using testing::HasSubstr;

namespace {

// Four lines, to which the tests append objects.
const std::string start = "version: 1\naxes: z-up\nmaterials:\n  grey: {model: diffuse, diffuse: 0.5}\n";

Arena load(const std::string &text) {
    return build(load_scene(Node::parse(text, "s.yaml")));
}

// Returns the error message without the name of the file.
std::string error_of(const std::string &text) {
    return arhost::test::after("s.yaml:", arhost::test::error_of([&] { load_scene(Node::parse(text, "s.yaml")); }));
}

const arhost_light &light(const Arena &a, std::size_t i = 0) {
    return elements<arhost_light>(a, a.scene().lights)[i];
}
glm::vec3 position(const Arena &a, std::size_t i) {
    return elements<glm::vec3>(a, geometry(a).positions)[i];
}
glm::vec4 sphere(const Arena &a) {
    return *elements<glm::vec4>(a, geometry(a).positions);
}

// Returns the geometric normal of a triangle.
glm::vec3 facing(const Arena &a, std::size_t triangle) {
    const glm::uvec3 t = elements<glm::uvec3>(a, geometry(a).indices)[triangle];
    return glm::normalize(glm::cross(position(a, t.y) - position(a, t.x), position(a, t.z) - position(a, t.x)));
}
glm::vec3 middle(const Arena &a, std::size_t triangle) {
    const glm::uvec3 t = elements<glm::uvec3>(a, geometry(a).indices)[triangle];
    return (position(a, t.x) + position(a, t.y) + position(a, t.z)) / 3.f;
}

Arena load_object(const std::string &shape, const std::string &more = "") {
    return load(start + "objects:\n  - {" + shape + ", material: grey" + more + "}\n");
}

void expect_near(const glm::vec3 &found, const glm::vec3 &expected) {
    EXPECT_LT(glm::distance(found, expected), 1e-4f) << found.x << ' ' << found.y << ' ' << found.z << " instead of "
                                                     << expected.x << ' ' << expected.y << ' ' << expected.z;
}

// Loads "scene.yaml" from a folder that also has "mesh.obj".
Arena load_with_mesh(const std::string &obj, const std::string &more, const LoadCallbacks &callbacks = {}) {
    const ScratchFolder folder;
    write_file(folder.path() / "mesh.obj", obj);
    write_file(folder.path() / "scene.yaml", start + "objects:\n  - {mesh: mesh.obj, material: grey" + more + "}\n");
    return build(load_scene(folder.path() / "scene.yaml", callbacks));
}

const std::string triangle_with_normals = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0.6 0.8\nf 1//1 2//1 3//1\n";

} // namespace

TEST(SceneFile, OfVersion2UsesThePathIntegrator) {
    const std::string rest = "axes: z-up\nmaterials: {m: {model: mirror}}\nobjects: []\n";
    const Arena old = load("version: 1\n" + rest), path = load("version: 2\n" + rest),
                whitted = load("version: 2\nintegrator: whitted\n" + rest);
    EXPECT_EQ(old.scene().integrator, ARHOST_INTEGRATOR_WHITTED);
    EXPECT_EQ(whitted.scene().integrator, ARHOST_INTEGRATOR_WHITTED);
    EXPECT_EQ(whitted.scene().ambient[0], old.scene().ambient[0]);
    EXPECT_EQ(path.scene().integrator, ARHOST_INTEGRATOR_PATH);
    EXPECT_EQ(load("version: 2\nintegrator: path\n" + rest).scene().integrator, ARHOST_INTEGRATOR_PATH);
    EXPECT_GT(path.scene().max_depth, old.scene().max_depth);
    EXPECT_EQ(path.scene().ambient[0], 0);
    EXPECT_EQ(path.scene().background[0], 0);
}

TEST(SceneFile, HasDefaults) {
    const Arena arena = load(start + "objects: []\n");
    EXPECT_EQ(arena.scene().axes, ARHOST_AXES_Z_UP);
    EXPECT_EQ(arena.scene().max_depth, 5u);
    EXPECT_THAT(arena.scene().ambient, testing::Each(0.2f));
    EXPECT_THAT(arena.scene().background, testing::Each(1.0f));
    EXPECT_EQ(arena.scene().shadow_alpha_opaque, 0.6f);
    EXPECT_EQ(arena.scene().shadow_alpha_translucent, 0.3f);
}

TEST(SceneFile, SetsTheSceneSettings) {
    const Arena arena = load("version: 1\naxes: y-up\nmax_depth: 9\nambient: [0.1, 0.2, 0.3]\nbackground: '#ff0000'\n"
                             "shadow_alpha: {opaque: 0.5, translucent: 0}\nmaterials: {}\nobjects: []\n");
    EXPECT_EQ(arena.scene().axes, ARHOST_AXES_Y_UP);
    EXPECT_EQ(arena.scene().max_depth, 9u);
    EXPECT_THAT(arena.scene().ambient, ElementsAre(0.1f, 0.2f, 0.3f));
    EXPECT_THAT(arena.scene().background, ElementsAre(1, 0, 0));
    EXPECT_EQ(arena.scene().shadow_alpha_opaque, 0.5f);
    EXPECT_EQ(arena.scene().shadow_alpha_translucent, 0.0f);
}

// The rows of the environment map are from the zenith down.
TEST(SceneFile, HasDefaultLightThatFollowsTheVideo) {
    const Arena arena = load("version: 2\naxes: z-up\nmaterials: {}\nobjects: []\n");
    const arhost_environment &environment = arena.scene().environment;
    ASSERT_NE(environment.texture, ARHOST_NONE);
    EXPECT_NE(environment.follows_video, 0u);
    EXPECT_EQ(environment.intensity, 1);
    EXPECT_THAT(std::span(environment.environment_from_world + 6, 3),
                ElementsAre(FloatNear(0, 1e-6f), FloatNear(1, 1e-6f), FloatNear(0, 1e-6f)))
        << "z is up";
    const arhost_texel_image &sky = image(arena);
    const auto texels = elements<glm::vec4>(arena, sky.texels);
    double irradiance = 0; // of a horizontal surface, divided by π
    for (std::uint32_t row = 0; row < sky.height / 2; ++row) {
        const double begin = std::numbers::pi * row / sky.height, end = std::numbers::pi * (row + 1) / sky.height;
        irradiance += (std::pow(std::sin(end), 2) - std::pow(std::sin(begin), 2)) * double{texels[row].x};
    }
    EXPECT_NEAR(0.35 * irradiance, 1, 0.02) << "a surface of reflectance 0.35 has the radiance of the video";
    EXPECT_NEAR(texels[sky.height - 1].x, 1, 1e-6) << "below";
}

TEST(SceneFile, HasNoDefaultLightIfItDescribesLight) {
    for (const std::string with :
         {"background: 0\n", "lights: []\n", "lights:\n  - {position: [1, 2, 3], intensity: 0.8}\n"})
        EXPECT_EQ(load("version: 2\naxes: z-up\nmaterials: {}\nobjects: []\n" + with).scene().environment.texture,
                  ARHOST_NONE)
            << with;
    EXPECT_EQ(
        load("version: 2\nintegrator: whitted\naxes: z-up\nmaterials: {}\nobjects: []\n").scene().environment.texture,
        ARHOST_NONE);
}

TEST(SceneFile, AcceptsLinearAndSrgbColours) {
    const Arena arena = load("version: 1\naxes: z-up\nmaterials:\n"
                             "  a: {model: diffuse, diffuse: 0.25, ambient: [1, 0, 0.5]}\n"
                             "  b: {model: diffuse, diffuse: '#ff8000'}\n"
                             "  c: {model: diffuse, diffuse: '#010A0b'}\n"
                             "objects: []\n");
    EXPECT_THAT(material(arena, 0).diffuse, testing::Each(0.25f));
    EXPECT_THAT(material(arena, 0).ambient, ElementsAre(1, 0, 0.5f));
    // IEC 61966-2-1: 128/255 → 0.2158605, 1/255 → 0.0003035, 10/255 → 0.0030353, 11/255 → 0.0033465
    EXPECT_THAT(material(arena, 1).diffuse, ElementsAre(1, FloatNear(0.2158605f, 1e-7f), 0));
    EXPECT_THAT(material(arena, 2).diffuse, ElementsAre(FloatNear(0.0003035f, 1e-7f), FloatNear(0.0030353f, 1e-7f),
                                                        FloatNear(0.0033465f, 1e-7f)));
    EXPECT_THAT(material(arena, 1).ambient,
                ElementsAre(1, FloatNear(0.2158605f, 1e-7f), 0)); // the default is `diffuse`
}

TEST(SceneFile, DescribesMaterials) {
    const Arena arena = load("version: 1\naxes: z-up\nmaterials:\n"
                             "  a: {model: specular, diffuse: 0.5, specular: 0.3, exponent: 64, ambient: 0.1}\n"
                             "  b: {model: mirror, reflectivity: [0.9, 0.8, 0.7]}\n"
                             "  c: {model: mirror}\n"
                             "objects: []\n");
    EXPECT_EQ(material(arena, 0).model, ARHOST_MATERIAL_SPECULAR);
    EXPECT_THAT(material(arena, 0).specular, testing::Each(0.3f));
    EXPECT_EQ(material(arena, 0).exponent, 64);
    EXPECT_THAT(material(arena, 0).ambient, testing::Each(0.1f));
    EXPECT_EQ(material(arena, 1).model, ARHOST_MATERIAL_MIRROR);
    EXPECT_THAT(material(arena, 1).reflectivity, ElementsAre(0.9f, 0.8f, 0.7f));
    EXPECT_THAT(material(arena, 2).reflectivity, testing::Each(1.0f));
}

TEST(SceneFile, DescribesGlass) {
    const Arena arena =
        load("version: 1\naxes: z-up\nmaterials:\n"
             "  plain: {model: glass}\n"
             "  dragon: {model: glass, index: 1.4, fresnel: {exponent: 1, minimum: 0.1, maximum: 0.9},\n"
             "    attenuation: {colour: [0.8, 0.89, 1], distance_mm: 110}, cutoff_colour: [0.34, 0.55, 0.85],\n"
             "    shadow_attenuation: [0.4, 0.7, 0.4], reflection_depth: 50, refraction_depth: 20,\n"
             "    importance_cutoff: 0.02, reflection: 0.5, refraction: 0.6, roughness: 0.3}\n"
             "  thick: {model: glass, extinction: [0.1, 0, 2]}\n"
             "  tinted: {model: glass, refraction: [0.5, 1, 0.2]}\nobjects: []\n");
    EXPECT_EQ(material(arena, 1).model, ARHOST_MATERIAL_GLASS);
    const arhost_material &plain = material(arena, 0), &dragon = material(arena, 1);
    EXPECT_EQ(plain.index, 1.5f);
    EXPECT_EQ(plain.roughness, 0);
    EXPECT_FLOAT_EQ(plain.fresnel_minimum, 0.04f) << "((n − 1)/(n + 1))²";
    EXPECT_EQ(plain.fresnel_exponent, 5);
    EXPECT_THAT(plain.extinction, testing::Each(0.0f));
    EXPECT_THAT(plain.shadow_attenuation, testing::Each(testing::FloatEq(0.6f)));
    EXPECT_EQ(dragon.roughness, 0.3f);
    EXPECT_EQ(dragon.fresnel_minimum, 0.1f);
    EXPECT_EQ(dragon.fresnel_maximum, 0.9f);
    // exp(−extinction · 110 mm) must equal the colour.
    EXPECT_THAT(dragon.extinction, ElementsAre(FloatNear(0.00202858f, 1e-7f), FloatNear(0.00105940f, 1e-7f), 0));
    EXPECT_THAT(dragon.shadow_attenuation, ElementsAre(0.4f, 0.7f, 0.4f));
    EXPECT_EQ(dragon.reflection_depth, 50u);
    EXPECT_EQ(dragon.refraction_depth, 20u);
    EXPECT_EQ(dragon.importance_cutoff, 0.02f);
    EXPECT_EQ(dragon.reflectivity[0], 0.5f);
    EXPECT_EQ(dragon.refraction[2], 0.6f);
    EXPECT_THAT(material(arena, 2).extinction, ElementsAre(0.1f, 0, 2));
    EXPECT_THAT(material(arena, 3).shadow_attenuation,
                ElementsAre(testing::FloatEq(0.3f), testing::FloatEq(0.6f), testing::FloatEq(0.12f)))
        << "tinted like its refraction";
}

TEST(SceneFile, DescribesMetalAndMetallicRoughness) {
    const Arena arena = load(
        "version: 1\naxes: z-up\nmaterials:\n"
        "  a: {model: metal, diffuse: [0.6, 0.9, 0.6], specular: 0.9, exponent: 256, reflectivity: [0.5, 0.6, 0.5]}\n"
        "  b: {model: metallic-roughness, colour: '#ff0000', roughness: 0.3, emission: 12}\nobjects: []\n");
    EXPECT_EQ(material(arena, 0).model, ARHOST_MATERIAL_METAL);
    EXPECT_THAT(material(arena, 0).reflectivity, ElementsAre(0.5f, 0.6f, 0.5f));
    EXPECT_EQ(material(arena, 0).exponent, 256);
    EXPECT_EQ(material(arena, 1).model, ARHOST_MATERIAL_METALLIC_ROUGHNESS);
    EXPECT_THAT(material(arena, 1).diffuse, ElementsAre(1, 0, 0));
    EXPECT_EQ(material(arena, 1).metallic, 1);
    EXPECT_EQ(material(arena, 1).roughness, 0.3f);
    EXPECT_EQ(material(arena, 1).emission[0], 12);
}

TEST(SceneFile, DescribesLightsOfEveryType) {
    const Arena arena =
        load(start + "lights:\n"
                     "  - {type: directional, direction: [0, 0, -2], intensity: 1}\n"
                     "  - {type: spot, position: [0, 0, 9], direction: [0, 1, 0], inner_degrees: 30, outer_degrees: "
                     "60, intensity: 1, falloff: inverse-square, radius: 0}\n"
                     "  - {type: rectangle, position: [0, 0, 9], direction: [0, 1, 0], size: [4, 6], intensity: 1}\n"
                     "  - {type: sphere, position: [0, 0, 9], radius: 3, intensity: 1}\n"
                     "objects: []\n");
    EXPECT_EQ(light(arena, 0).type, ARHOST_LIGHT_DIRECTIONAL);
    EXPECT_THAT(light(arena, 0).direction, ElementsAre(0, 0, -1));
    EXPECT_FLOAT_EQ(light(arena, 1).cosine_outer, 0.5f);
    EXPECT_FLOAT_EQ(light(arena, 1).cosine_inner, std::sqrt(0.75f));
    EXPECT_EQ(light(arena, 1).radius, 0);
    EXPECT_THAT(light(arena, 2).axis_u, ElementsAre(-2, 0, 0)); // the width is horizontal
    EXPECT_THAT(light(arena, 2).axis_v, ElementsAre(0, 0, 3));
    EXPECT_EQ(light(arena, 3).radius, 3);
    EXPECT_THAT(error_of(start + "lights:\n  - {type: spot, position: [0, 0, 9], direction: [0, 0, 0], "
                                 "outer_degrees: 60, intensity: 1}\nobjects: []\n"),
                testing::HasSubstr("direction: must have a length between 1e-9 and 1e9"));
    EXPECT_THAT(error_of(start + "lights:\n  - {type: directional, position: [0, 0, 9], direction: [0, 0, 1], "
                                 "intensity: 1}\nobjects: []\n"),
                testing::HasSubstr("position: unknown key"));
}

TEST(SceneFile, DescribesLights) {
    const Arena arena = load(start + "lights:\n  - {position: [1, 2, 3], intensity: 0.8}\n"
                                     "  - {position: [0, 0, 9], intensity: [1e4, 2e4, 0], falloff: inverse-square}\n"
                                     "objects: []\n");
    EXPECT_EQ(light(arena, 0).type, ARHOST_LIGHT_POINT);
    EXPECT_EQ(light(arena, 0).falloff, ARHOST_FALLOFF_NONE);
    EXPECT_THAT(light(arena, 0).position, ElementsAre(1, 2, 3));
    EXPECT_THAT(light(arena, 0).intensity, testing::Each(0.8f));
    EXPECT_EQ(light(arena, 1).falloff, ARHOST_FALLOFF_INVERSE_SQUARE);
    EXPECT_THAT(light(arena, 1).intensity, ElementsAre(1e4f, 2e4f, 0));
}

TEST(SceneFile, GivesObjectsTheirNameRoleAndMaterial) {
    const Arena arena = load("version: 1\naxes: z-up\nmaterials: {b: {model: mirror}, a: {model: mirror}}\nobjects:\n"
                             "  - {sphere: {radius: 1}, material: a, role: catcher}\n"
                             "  - {sphere: {radius: 1}, material: b, role: occluder, name: the “ball”}\n"
                             "  - {cuboid: {size: 1}, material: b}\n");
    EXPECT_STREQ(name(arena, 0), "sphere 0");
    EXPECT_STREQ(name(arena, 1), "the “ball”");
    EXPECT_EQ(object(arena, 0).role, ARHOST_ROLE_CATCHER);
    EXPECT_EQ(object(arena, 1).role, ARHOST_ROLE_OCCLUDER);
    EXPECT_EQ(object(arena, 2).role, ARHOST_ROLE_VIRTUAL);
    EXPECT_EQ(object(arena, 0).material, 1u);
    EXPECT_EQ(object(arena, 1).material, 0u);
}

TEST(Shapes, CuboidsFaceOutwards) {
    for (const std::string transform : {"", ", transform: [{scale: [-1, 1, 2]}]"}) {
        const Arena arena = load_object("cuboid: {size: [2, 4, 6], centre: [1, 1, 1]}", transform);
        EXPECT_EQ(geometry(arena).type, ARHOST_GEOMETRY_TRIANGLES);
        ASSERT_EQ(geometry(arena).indices.count, 12u);
        EXPECT_EQ(geometry(arena).normals.count, 0u);
        const glm::vec3 centre = transform.empty() ? glm::vec3(1, 1, 1) : glm::vec3(-1, 1, 2);
        for (std::size_t i = 0; i < 12; ++i)
            EXPECT_GT(glm::dot(facing(arena, i), middle(arena, i) - centre), 0.9f);
    }
    const Arena arena = load_object("cuboid: {size: [2, 4, 6], centre: [1, 1, 1]}");
    EXPECT_THAT(arena.scene().bounds_min, ElementsAre(0, -1, -2));
    EXPECT_THAT(arena.scene().bounds_max, ElementsAre(2, 3, 4));
}

TEST(Shapes, PlanesFaceAlongTheirNormal) {
    const Arena floor = load_object("plane: {size: [4, 2], centre: [0, 0, 5]}");
    ASSERT_EQ(geometry(floor).indices.count, 2u);
    expect_near(facing(floor, 0), {0, 0, 1});
    expect_near(facing(floor, 1), {0, 0, 1});
    EXPECT_THAT(floor.scene().bounds_min, ElementsAre(-2, -1, 5));
    EXPECT_THAT(floor.scene().bounds_max, ElementsAre(2, 1, 5));

    const Arena wall = load_object("plane: {size: [4, 2], normal: [0, -3, 0]}"); // 4 mm wide, 2 mm high
    expect_near(facing(wall, 0), {0, -1, 0});
    EXPECT_THAT(wall.scene().bounds_min, ElementsAre(-2, 0, -1));
    const Arena side = load_object("plane: {size: [4, 2], normal: [1, 0, 0]}");
    expect_near(facing(side, 1), {1, 0, 0});
    EXPECT_THAT(side.scene().bounds_min, ElementsAre(0, -2, -1));
    const Arena ceiling = load_object("plane: {size: 3, normal: [0, 0, -1]}");
    expect_near(facing(ceiling, 0), {0, 0, -1});
}

TEST(Shapes, PlanesAreHorizontalByDefault) {
    const Arena arena = load("version: 1\naxes: y-up\nmaterials: {a: {model: mirror}}\nobjects:\n"
                             "  - {plane: {size: [4, 2]}, material: a}\n");
    expect_near(facing(arena, 0), {0, 1, 0});
    EXPECT_THAT(arena.scene().bounds_min, ElementsAre(-2, 0, -1));
}

// Seen from outside, each face's texture is upright: u increases to the right, v decreases upwards.
TEST(Shapes, FacesShowTheWholeTextureUpright) {
    for (const std::string axes : {"z-up", "y-up"}) {
        const Arena arena = load("version: 1\naxes: " + axes + "\nmaterials: {a: {model: mirror}}\nobjects:\n" +
                                 "  - {cuboid: {size: [2, 4, 6]}, material: a}\n");
        const glm::vec3 up = axes == "z-up" ? glm::vec3(0, 0, 1) : glm::vec3(0, 1, 0);
        const auto *texcoords = elements<glm::vec2>(arena, geometry(arena).texcoords);
        for (std::size_t i = 0; i < 12; ++i) {
            const glm::uvec3 t = elements<glm::uvec3>(arena, geometry(arena).indices)[i];
            // p = u · across + v · down, where `across` and `down` are derived from the sides of the triangle
            const glm::vec3 a = position(arena, t.y) - position(arena, t.x),
                            b = position(arena, t.z) - position(arena, t.x);
            const glm::vec2 ta = texcoords[t.y] - texcoords[t.x], tb = texcoords[t.z] - texcoords[t.x];
            const float area = ta.x * tb.y - ta.y * tb.x;
            EXPECT_FLOAT_EQ(std::abs(area), 1);
            const glm::vec3 across = (a * tb.y - b * ta.y) / area, down = (b * ta.x - a * tb.x) / area;
            const glm::vec3 outside = facing(arena, i);
            expect_near(glm::normalize(glm::cross(across, -down)), outside);
            if (std::abs(glm::dot(outside, up)) < 0.5f)
                expect_near(glm::normalize(-down), up);
            else
                expect_near(glm::normalize(across), {1, 0, 0});
        }
    }
}

TEST(Transforms, AreAppliedInOrder) {
    // T·S·R: (1, 0, 0) → rotated (0, 1, 0) → scaled (0, 3, 0) → moved (10, 3, 0)
    const Arena arena = load_with_mesh(
        triangle_with_normals,
        ", transform: [{rotate: {axis: [0, 0, 2], degrees: 90}}, {scale: [2, 3, 4]}, {translate: [10, 0, 0]}]");
    expect_near(position(arena, 0), {10, 0, 0});
    expect_near(position(arena, 1), {10, 3, 0});
    expect_near(position(arena, 2), {8, 0, 0});
    EXPECT_THAT(object(arena).world_from_object, ElementsAre(1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0));
}

TEST(Transforms, RotateRightHanded) {
    const auto rotated = [](const std::string &axis) {
        return load_object("sphere: {centre: [1, 2, 3], radius: 1}",
                           ", transform: [{rotate: {axis: " + axis + ", degrees: 90}}]");
    };
    expect_near(glm::vec3(sphere(rotated("[1, 0, 0]"))), {1, -3, 2});
    expect_near(glm::vec3(sphere(rotated("[0, 1, 0]"))), {3, 2, -1});
    expect_near(glm::vec3(sphere(rotated("[0, 0, 1]"))), {-2, 1, 3});
    expect_near(glm::vec3(sphere(rotated("[1, 1, 1]"))), {2.5773503f, 0.8452995f, 2.5773503f});
}

TEST(Transforms, TransformNormalsByTheInverseTranspose) {
    // A 45° slope is scaled to twice the height, so its normal (0, 1, 1) becomes (0, 1/1, 1/2).
    const Arena arena = load_with_mesh("v 0 0 1\nv 1 0 1\nv 0 1 0\nvn 0 1 1\nf 1//1 2//1 3//1\n",
                                       ", transform: [{scale: [1, 1, 2]}]");
    const glm::vec3 normal = *elements<glm::vec3>(arena, geometry(arena).normals);
    expect_near(normal, glm::normalize(glm::vec3(0, 2, 1)));
    expect_near(facing(arena, 0), normal);
}

TEST(Transforms, KeepFrontFacesIfTheyMirror) {
    const std::string slope = "v 0 0 1\nv 1 0 1\nv 0 1 0\nvn 0 1 1\nf 1//1 2//1 3//1\n";
    for (const std::string scale : {"[-1, 1, 1]", "[1, -1, 1]", "[1, 1, -1]", "-2", "[-1, -1, 1]"}) {
        const Arena arena = load_with_mesh(slope, ", transform: [{scale: " + scale + "}]");
        expect_near(facing(arena, 0), *elements<glm::vec3>(arena, geometry(arena).normals));
    }
}

TEST(Transforms, ScaleASpheresRadius) {
    const Arena arena = load_object("sphere: {centre: [1, 0, 0], radius: 2}",
                                    ", transform: [{rotate: {axis: [1, 2, 3], degrees: 33}}, {scale: -3}, {rotate: "
                                    "{axis: [1, 2, 3], degrees: -33}}, {translate: [0, 0, 7]}]");
    expect_near(glm::vec3(sphere(arena)), {-3, 0, 7});
    EXPECT_FLOAT_EQ(sphere(arena).w, 6);
    EXPECT_EQ(geometry(arena).type, ARHOST_GEOMETRY_SPHERES);
}

TEST(SceneErrors, NameFileLineColumnKeyAndFix) {
    const std::string ball = start + "objects:\n  - {sphere: {radius: 1}, material: grey";
    const arhost::test::ErrorCase cases[] = {
        {"axes: z-up\n", "1:1: the key 'version' is missing"},
        {"version: 3\naxes: z-up\n", "1:10: version: must be 1 or 2"},
        {"version: 1\nintegrator: path\naxes: z-up\n", "2:13: integrator: needs 'version: 2'"},
        {"version: 2\nintegrator: pth\naxes: z-up\n",
         "2:13: integrator: 'pth' is not one of path, whitted; did you mean 'path'?"},
        {"version: 2\nintegrator: 3\naxes: z-up\n", "2:13: integrator: '3' is not one of path, whitted"},
        {"version: 2\naxes: z-up\nambient: 0.2\n",
         "3:10: ambient: only applies to 'integrator: whitted'; the path integrator computes this light"},
        {"version: 2\naxes: z-up\nshadow_alpha: {opaque: 1}\n",
         "3:15: shadow_alpha: only applies to 'integrator: whitted'; the path integrator computes this light"},
        {"version: 2\naxes: z-up\ncoloured_shadows: true\n",
         "3:19: coloured_shadows: only applies to 'integrator: whitted'; the path integrator computes this light"},
        {"version: 1\naxes: zup\n", "2:7: axes: 'zup' is not one of z-up, y-up; did you mean 'z-up'?"},
        {"version: 1\naxes: z-up\nmaterial: {}\n", "3:1: material: unknown key; did you mean 'materials'?"},
        {start + "max_depth: 101\n", "5:12: max_depth: must be 0 to 100, but is 101"},
        {start + "objects: []\nobjects: []\n", "6:1: objects: duplicate key; keep one of them"},
        {start + "  grey: {model: mirror}\nobjects: []\n",
         "5:9: materials.grey: another material has the same name; rename or remove one of them"},
        {start + "  red: {model: difuse, diffuse: 1}\n",
         "5:16: materials.red.model: 'difuse' is not one of diffuse, specular, mirror, metal, glass, "
         "metallic-roughness; did you mean 'diffuse'?"},
        {start + "  red: {model: mirror, diffuse: 1}\n",
         "5:24: materials.red.diffuse: unknown key; known keys: model, reflectivity"},
        {start + "  red: {model: glass, roughness: 1.5}\n",
         "5:34: materials.red.roughness: must be 0 to 1, but is 1.5"},
        {start + "  red: {model: glass, roughness: rough}\n", HasSubstr("materials.red.roughness: must be a number")},
        {start + "  red: {model: diffuse, diffuse: '#ff00'}\n",
         "5:34: materials.red.diffuse: must be '#rrggbb' (sRGB), a number or a list of three (linear light, 0 to 1), "
         "but is '#ff00'"},
        {start + "  red: {model: diffuse, diffuse: '#gg0000'}\n", HasSubstr("is '#gg0000'")},
        {start + "  red:\n    model: diffuse\n    diffuse: #ff0000\n",
         HasSubstr("but is empty; '#' starts a comment, so write '#rrggbb' in quotes")},
        {start + "  red: {model: diffuse, diffuse: '#-10000'}\n", HasSubstr("is '#-10000'")},
        {start + "  red: {model: diffuse, diffuse: [0, 1.5, 0]}\n",
         "5:34: materials.red.diffuse: must be '#rrggbb' (sRGB), a number or a list of three (linear light, 0 to 1)"},
        {start + "lights:\n  - {position: [0, 0], intensity: 1}\n",
         "6:16: lights[0].position: must be a list of 3 numbers, but has 2"},
        {start + "lights:\n  - {position: [0, 0, 2e9], intensity: 1}\n",
         "6:16: lights[0].position: must be within 1e9 mm"},
        {start + "lights:\n  - {position: [0, 0, 2], intensity: -1}\n",
         "6:38: lights[0].intensity: must be 0 to 1e12"},
        {start + "objects:\n  - {material: grey}\n",
         "6:5: objects[0]: needs one of mesh, gltf, sphere, cuboid and plane"},
        {ball + ", cuboid: {size: 1}}\n",
         "6:51: objects[0].cuboid: the object already has a sphere; split it into two objects"},
        {ball + "y}\n", "6:37: objects[0].material: 'greyy' is not one of grey; did you mean 'grey'?"},
        {ball + ", smooth: true}\n", "6:51: objects[0].smooth: is only allowed with 'mesh'"},
        {ball + ", role: ghost}\n", "6:49: objects[0].role: 'ghost' is not one of virtual, catcher, occluder"},
        {ball + ", name: \"a\\tb\"}\n", "6:49: objects[0].name: must not contain control characters"},
        {start + "objects:\n  - {sphere: {radius: 0}, material: grey}\n",
         "6:23: objects[0].sphere.radius: must be greater than 0"},
        {start + "objects:\n  - {cuboid: {size: [1, 0, 1]}, material: grey}\n",
         "6:21: objects[0].cuboid.size: each side must be 1e-6 to 1e9 mm"},
        {start + "objects:\n  - {plane: {size: 1, normal: [0, 0, 0]}, material: grey}\n",
         "6:31: objects[0].plane.normal: must have a length between 1e-9 and 1e9"},
    };
    expect_errors([&](const std::string &text) { return error_of(text); }, cases);
}

TEST(SceneErrors, OfTheArenaNameTheirOrigin) {
    const auto fault_of = [](const std::string &text) {
        ArenaBuilder builder = load_scene(Node::parse(text, "s.yaml"));
        const Origins origins = builder.origins();
        const Arena arena = std::move(builder).build();
        const std::optional<Fault> fault = find_fault(arena.bytes());
        return fault ? origins.message(*fault) : "none";
    };
    const std::string objects = start + "objects:\n  - {sphere: {radius: 1}, material: grey}\n";
    EXPECT_EQ(fault_of(objects), "none");
    EXPECT_EQ(fault_of(objects + "  - cuboid: {size: 1e9}\n    material: grey\n"
                                 "    motion: {keys: [{at_s: 0, scale: 1000}, {at_s: 1, scale: 1}]}\n"),
              "s.yaml:7:5: objects[1]: object 1 'cuboid 1' extends beyond 4e+09 mm");

    ArenaBuilder builder;
    builder.add_material(make_material(ARHOST_MATERIAL_MIRROR));
    builder.set_origin("here");
    arhost_material wrong = make_material(ARHOST_MATERIAL_MIRROR);
    wrong.exponent = 0;
    builder.add_material(wrong);
    const Origins origins = builder.origins();
    EXPECT_EQ(origins.message(find_fault(std::move(builder).build().bytes()).value()),
              "here: material 1: exponent is 0, outside 1 to 1e+09");
    EXPECT_EQ(origins.message({"x", Table::materials, 0}), "x") << "it was added before the origin was set";
    EXPECT_EQ(origins.message({"x", Table::scene, 0}), "x");
    EXPECT_THAT(origins.all(Table::materials), ElementsAre("", "here"));
}

TEST(SceneErrors, OfAnAnchorNameTheFirstObject) {
    const auto on = [](const std::string &target) {
        return "  - {sphere: {radius: 1}, material: grey, on: " + target + "}\n";
    };
    const ArenaBuilder builder =
        load_scene(Node::parse(start + "objects:\n" + on("cup") + on("lid") + on("cup"), "s.yaml"));
    EXPECT_THAT(builder.origins().all(Table::anchors),
                ElementsAre("s.yaml:6:47: objects[0].on", "s.yaml:7:47: objects[1].on"));
    EXPECT_EQ(builder.origins().all(Table::objects)[1], "s.yaml:7:5: objects[1]");
}

TEST(SceneErrors, NameTheStepOfATransform) {
    const auto with = [](const std::string &steps) {
        return error_of(start + "objects:\n  - sphere: {radius: 1}\n    material: grey\n    transform:\n" + steps);
    };
    EXPECT_EQ(with("      - scale: 0\n"), "9:16: objects[0].transform[0].scale: the absolute value of each factor "
                                          "must be 1e-9 to 1e9; negative factors mirror");
    EXPECT_EQ(with("      - rotate: {axis: [0, 0, 0], degrees: 1}\n"),
              "9:24: objects[0].transform[0].rotate.axis: must have a length between 1e-9 and 1e9");
    EXPECT_EQ(with("      - {scale: 1, translate: [0, 0, 0]}\n"),
              "9:9: objects[0].transform[0]: each step of a transform must have exactly one of the keys translate, "
              "scale and rotate");
    EXPECT_EQ(with("      - scale: 1\n      - skale: 1\n"),
              "10:9: objects[0].transform[1].skale: unknown key; did you mean 'scale'?");
    EXPECT_EQ(with("      - scale: [1, 1, 2]\n"), "9:7: objects[0].transform: scales a sphere non-uniformly, which "
                                                  "is not supported; use the same factor for all axes");
    EXPECT_EQ(with("      - translate: [1e9, 0, 0]\n      - translate: [1e9, 0, 0]\n"),
              "6:13: objects[0].sphere: extends beyond 1e9 mm after its transform");
}

TEST(SceneErrors, NameTheMeshAndTheSceneLine) {
    const ScratchFolder folder;
    write_file(folder.path() / "scene.yaml", start + "objects:\n  - mesh: mesh.obj\n    material: grey\n");
    const auto error = [&] { return arhost::test::error_of([&] { load_scene(folder.path() / "scene.yaml"); }); };
    const std::string where = (folder.path() / "scene.yaml").string() + ":6:11: objects[0].mesh: ";
    const std::string mesh = (folder.path() / "mesh.obj").string();
    EXPECT_EQ(error(), where + mesh + ": cannot be read: No such file or directory");
    const std::pair<const char *, std::string> cases[] = {
        {"v 0 0\n", mesh + ":1: a vertex needs 3 numbers, but has 2"},
        {"v 1e10 0 0\nv 0 0 0\nv 0 1 0\nf 1 2 3\n", "extends beyond 1e9 mm after its transform"},
        {"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 1e10\nf 1/1 2/1 3/1\n", "has texture coordinates beyond 1e9"},
    };
    for (const auto &[obj, message] : cases) {
        write_file(mesh, obj);
        EXPECT_EQ(error(), where + message);
    }
}

TEST(SceneLoading, ReportsMeshSizesAndProgress) {
    LoadCallbacks callbacks;
    std::vector<std::string> info;
    std::vector<double> fractions;
    callbacks.info = [&](const std::string &text) { info.push_back(text); };
    callbacks.progress = [&](double fraction, const std::string &) { fractions.push_back(fraction); };
    load_with_mesh(triangle_with_normals, ", transform: [{scale: 30}]", callbacks);
    ASSERT_EQ(info.size(), 1u);
    EXPECT_THAT(info[0], testing::EndsWith("mesh.obj: 1 triangles, 3 vertices, 30 x 30 x 0 mm"));
    ASSERT_FALSE(fractions.empty());
    EXPECT_TRUE(std::is_sorted(fractions.begin(), fractions.end()));
    EXPECT_EQ(fractions.back(), 1);
}

TEST(SceneLoading, CanBeCancelled) {
    LoadCallbacks callbacks;
    callbacks.cancelled = [] { return true; };
    EXPECT_THROW(load_with_mesh(triangle_with_normals, "", callbacks), Cancelled);
}

TEST(SceneLoading, ComputesNormalsIfSmoothIsTrue) {
    const std::string flat = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    EXPECT_EQ(geometry(load_with_mesh(flat, "")).normals.count, 0u);
    EXPECT_EQ(geometry(load_with_mesh(flat, ", smooth: true")).normals.count, 3u);
    EXPECT_EQ(geometry(load_with_mesh(triangle_with_normals, ", smooth: false")).normals.count, 0u);
}

// Beginning of a scene with a missing mesh file. The tests append the keys of the stand-in.
const std::string absent = start + "objects:\n  - mesh: absent.ply\n    material: grey\n    stand_in: ";

TEST(SceneLoading, ReplacesAMissingMeshWithAStandIn) {
    std::vector<std::string> info, warnings;
    LoadCallbacks callbacks;
    callbacks.info = [&](const std::string &text) { info.push_back(text); };
    callbacks.warning = [&](const std::string &text) { warnings.push_back(text); };
    const std::string text = absent + "{faces: 4968, size: [2, 1, 0.5]}\n    transform: [{scale: 10}]\n";
    const Arena arena = build(load_scene(Node::parse(text, "s.yaml"), callbacks));
    EXPECT_EQ(geometry(arena).indices.count, 4968u);
    EXPECT_EQ(geometry(arena).normals.count, geometry(arena).positions.count);
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_THAT(warnings[0], HasSubstr("absent.ply"));
    EXPECT_THAT(warnings[0], HasSubstr("tools/get-models"));
    ASSERT_EQ(info.size(), 1u);
    EXPECT_THAT(info[0], HasSubstr("absent.ply (stand-in): 4968 triangles"));
    EXPECT_THAT(info[0], testing::EndsWith("20 x 10 x 5 mm"));
    EXPECT_EQ(geometry(load(text + "    smooth: false\n")).normals.count, 0u);
}

TEST(SceneLoading, PrefersTheMeshToItsStandIn) {
    LoadCallbacks callbacks;
    callbacks.warning = [](const std::string &text) { ADD_FAILURE() << text; };
    EXPECT_EQ(
        geometry(load_with_mesh(triangle_with_normals, ", fit_mm: 9, stand_in: {faces: 500, size: 1}", callbacks))
            .indices.count,
        1u);
}

TEST(SceneLoading, RejectsInvalidStandIns) {
    EXPECT_THAT(error_of(absent + "{faces: 99, size: 1}\n"), HasSubstr("8:23: objects[0].stand_in.faces"));
    EXPECT_THAT(error_of(absent + "{faces: 500}\n"), HasSubstr("size"));
    EXPECT_THAT(error_of(absent + "{faces: 500, size: [1, 0, 1]}\n"), HasSubstr("1e-6"));
    EXPECT_THAT(error_of(start + "objects:\n  - sphere: {radius: 1}\n    material: grey\n"
                                 "    stand_in: {faces: 500, size: 1}\n"),
                HasSubstr("is only allowed with 'mesh'"));
}

TEST(SceneDocumentation, ExampleLoads) {
    std::ifstream stream(std::filesystem::path(arhost::test::source_directory()) / "docs/scenes.md");
    const std::string text(std::istreambuf_iterator<char>(stream), {});
    const std::size_t begin = text.find("```yaml\n");
    ASSERT_NE(begin, std::string::npos);
    const std::string example = text.substr(begin + 8, text.find("```\n", begin + 8) - begin - 8);
    const ScratchFolder folder;
    write_file(folder.path() / "vase.ply",
               "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
               "property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
               "end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
    write_file(folder.path() / "scene.yaml", example);
    const Arena arena = build(load_scene(folder.path() / "scene.yaml"));
    EXPECT_GT(arena.scene().objects.count, 3u);
}

TEST(Anchors, ObjectsBelongToTargets) {
    const Arena arena = load(start + "objects:\n"
                                     "  - {name: floor, plane: {size: 9}, material: grey}\n"
                                     "  - {name: a, sphere: {radius: 1}, material: grey, on: cup}\n"
                                     "  - {name: b, cuboid: {size: 1}, material: grey, on: lid, motion: {keys: "
                                     "[{at_s: 0, translate: [5, 0, 0]}, {at_s: 1, translate: [0, 0, 0]}]}}\n"
                                     "  - {name: c, sphere: {radius: 1}, material: grey, on: cup}\n");
    const arhost_scene &scene = arena.scene();
    ASSERT_EQ(scene.anchors.count, 2u);
    const auto *anchors = elements<arhost_anchor>(arena, scene.anchors);
    const auto *names = elements<char>(arena, scene.names);
    EXPECT_STREQ(names + anchors[0].target, "cup");
    EXPECT_STREQ(names + anchors[1].target, "lid");
    EXPECT_FALSE(object(arena, 0).moves);
    EXPECT_TRUE(object(arena, 1).moves);
    EXPECT_EQ(object(arena, 1).node, anchors[0].node);
    EXPECT_EQ(object(arena, 3).node, anchors[0].node);
    EXPECT_EQ(elements<arhost_node>(arena, scene.nodes)[object(arena, 2).node].parent, anchors[1].node)
        << "the motion is relative to the target";
}

TEST(Anchors, NeedTheNameOfATarget) {
    const auto with = [](const std::string &on) {
        return error_of(start + "objects:\n  - {sphere: {radius: 1}, material: grey, on: " + on + "}\n");
    };
    EXPECT_THAT(with("\"\""), HasSubstr("objects[0].on: must not be empty"));
    EXPECT_THAT(with(std::string(64, 'x')),
                HasSubstr("objects[0].on: must be the name of a target, of up to 63 characters"));
}
