// SPDX-License-Identifier: Apache-2.0
#include "scene/motion.hpp"
#include "scene_samples.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <limits>
#include <random>

using namespace arhost::scene;
using namespace arhost::scene::test;
using testing::HasSubstr;

namespace {

const float nan_value = std::numeric_limits<float>::quiet_NaN();

arhost_scene &header(Arena &arena) {
    return *reinterpret_cast<arhost_scene *>(arena.bytes().data());
}
arhost_geometry *geometries(Arena &a) {
    return elements<arhost_geometry>(a, header(a).geometries);
}
arhost_object *objects(Arena &a) {
    return elements<arhost_object>(a, header(a).objects);
}
arhost_material *materials(Arena &a) {
    return elements<arhost_material>(a, header(a).materials);
}
arhost_light *lights(Arena &a) {
    return elements<arhost_light>(a, header(a).lights);
}
float *positions(Arena &a) {
    return elements<float>(a, geometries(a)[0].positions);
}
float *normals(Arena &a) {
    return elements<float>(a, geometries(a)[0].normals);
}
float *texcoords(Arena &a) {
    return elements<float>(a, geometries(a)[0].texcoords);
}
std::uint32_t *indices(Arena &a) {
    return elements<std::uint32_t>(a, geometries(a)[0].indices);
}
float *ball(Arena &a) {
    return elements<float>(a, geometries(a)[1].positions);
}

// Returns all non-empty buffers of the small scene.
std::vector<arhost_buffer *> buffers(Arena &a) {
    arhost_scene &scene = header(a);
    arhost_geometry *g = geometries(a);
    return {&scene.geometries, &scene.materials, &scene.objects,  &scene.lights, &scene.names,
            &g[0].positions,   &g[0].normals,    &g[0].texcoords, &g[0].indices, &g[1].positions};
}

} // namespace

TEST(ArenaBuilder, WritesAllInput) {
    ArenaBuilder builder = small_scene();
    builder.settings = {ARHOST_AXES_Y_UP, 7, glm::vec3(0.1f, 0.2f, 0.3f), glm::vec3(0.4f), 0.5f, 0.25f};
    EXPECT_EQ(builder.triangle_count(), 2u);
    EXPECT_EQ(builder.object_count(), 2u);
    const std::size_t size = builder.byte_size();
    Arena arena = std::move(builder).build();
    ASSERT_EQ(validate(arena.bytes()), "");

    const arhost_scene &scene = arena.scene();
    EXPECT_EQ(scene.byte_size, size);
    EXPECT_EQ(scene.axes, ARHOST_AXES_Y_UP);
    EXPECT_EQ(scene.max_depth, 7u);
    EXPECT_THAT(scene.ambient, testing::ElementsAre(0.1f, 0.2f, 0.3f));
    EXPECT_THAT(scene.background, testing::Each(0.4f));
    EXPECT_EQ(scene.shadow_alpha_opaque, 0.5f);
    EXPECT_EQ(scene.shadow_alpha_translucent, 0.25f);
    EXPECT_THAT(scene.bounds_min, testing::ElementsAre(-10, -10, 5));
    EXPECT_THAT(scene.bounds_max, testing::ElementsAre(10, 10, 27));

    const TriangleMesh mesh = square();
    EXPECT_EQ(std::memcmp(positions(arena), mesh.positions.data(), 48), 0);
    EXPECT_EQ(std::memcmp(normals(arena), mesh.normals.data(), 48), 0);
    EXPECT_EQ(std::memcmp(texcoords(arena), mesh.texcoords.data(), 32), 0);
    EXPECT_EQ(std::memcmp(indices(arena), mesh.triangles.data(), 24), 0);
    EXPECT_EQ(ball(arena)[3], 7);
    EXPECT_EQ(materials(arena)[0].diffuse[1], 0.5f);
    EXPECT_EQ(lights(arena)[0].position[2], 300);
    const char *names = elements<char>(arena, scene.names);
    EXPECT_STREQ(names + objects(arena)[0].name, "square");
    EXPECT_STREQ(names + objects(arena)[1].name, "ball");
    EXPECT_EQ(objects(arena)[1].role, ARHOST_ROLE_CATCHER);
    EXPECT_THAT(objects(arena)[0].world_from_object, testing::ElementsAre(1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0));
}

TEST(ArenaBuilder, LeavesSixteenSpareBytesAfterEachBufferWithoutOverlap) {
    Arena arena = small_scene().build();
    std::vector<arhost_buffer *> all = buffers(arena);
    std::sort(all.begin(), all.end(), [](auto *a, auto *b) { return a->offset < b->offset; });
    std::uint64_t end = sizeof(arhost_scene);
    for (const arhost_buffer *buffer : all) {
        EXPECT_EQ(buffer->offset % 64, 0u);
        EXPECT_GE(buffer->offset, end);
        end = buffer->offset + std::uint64_t(buffer->count) * buffer->stride + 16;
    }
    EXPECT_LE(end, arena.scene().byte_size);
}

TEST(ArenaBuilder, WritesIntoTheCallersMemoryAndNotBeyond) {
    ArenaBuilder builder = small_scene();
    const std::size_t size = builder.byte_size();
    Arena memory(size + 64);
    std::memset(memory.bytes().data(), 0xa5, memory.bytes().size());
    std::move(builder).write(memory.bytes());
    EXPECT_EQ(validate(memory.bytes()), "");
    EXPECT_THAT(memory.bytes().subspan(size), testing::Each(std::byte(0xa5)));
    const Arena again = small_scene().build(); // the output does not depend on the previous content
    EXPECT_EQ(std::memcmp(memory.bytes().data(), again.bytes().data(), size), 0);
}

TEST(ArenaBuilder, RejectsMemoryThatIsTooSmallOrMisaligned) {
    Arena memory(small_scene().byte_size() + 64);
    EXPECT_THROW(small_scene().write(memory.bytes().first(small_scene().byte_size() - 1)), std::invalid_argument);
    EXPECT_THROW(small_scene().write(memory.bytes().subspan(8)), std::invalid_argument);
}

TEST(ArenaBuilder, IncludesTransformedObjectsInTheBounds) {
    ArenaBuilder builder;
    const std::uint32_t material = builder.add_material(grey());
    const glm::mat4x3 moved(glm::vec3(2, 0, 0), glm::vec3(0, 2, 0), glm::vec3(0, 0, 2), glm::vec3(100, 0, 0));
    builder.add_object("ball", builder.add_spheres({{0, 0, 0, 5}}), material, ARHOST_ROLE_VIRTUAL, moved);
    const Arena arena = std::move(builder).build();
    EXPECT_EQ(validate(arena.bytes()), "");
    EXPECT_THAT(arena.scene().bounds_min, testing::ElementsAre(90, -10, -10));
    EXPECT_THAT(arena.scene().bounds_max, testing::ElementsAre(110, 10, 10));
}

TEST(ArenaBuilder, CanWriteASceneWithoutObjects) {
    const Arena arena = ArenaBuilder().build();
    EXPECT_EQ(validate(arena.bytes()), "");
    EXPECT_EQ(arena.scene().objects.count, 0u);
}

TEST(ArenaBuilder, WritesMovingObjectsAtTheirPoseAtTimeZero) {
    ArenaBuilder builder;
    builder.settings.duration_s = 1;
    MotionNode node;
    node.animated = true;
    builder.add_node(node);
    builder.add_channel({0, ARHOST_CHANNEL_TRANSLATION, ARHOST_INTERPOLATION_LINEAR, {0, 1}, {5, 0, 0, 0, 0, 0}});
    builder.add_object("ball", builder.add_spheres({{0, 0, 0, 1}}), builder.add_material(grey()), ARHOST_ROLE_VIRTUAL,
                       glm::mat4x3(1), {true, false, 0, ARHOST_NONE});
    Arena arena = std::move(builder).build();
    EXPECT_EQ(validate(arena.bytes()), "");
    EXPECT_EQ(objects(arena)[0].world_from_object[9], 5);
    EXPECT_EQ(arena.scene().bounds_min[0], 4);
    EXPECT_EQ(arena.scene().bounds_max[0], 6);
}

TEST(ArenaBuilder, WritesTexturesEnvironmentAndMotion) {
    ArenaBuilder builder = full_scene();
    const std::size_t size = builder.byte_size();
    Arena arena = std::move(builder).build();
    ASSERT_EQ(validate(arena.bytes()), "");
    EXPECT_EQ(arena.scene().byte_size, size);
    EXPECT_EQ(arena.scene().textures.count, 2u);
    const arhost_texture &texture = *elements<arhost_texture>(arena, arena.scene().textures);
    EXPECT_EQ(texture.height, 3u);
    EXPECT_EQ(elements<std::uint8_t>(arena, texture.texels)[23], 200);
    EXPECT_STREQ(elements<char>(arena, arena.scene().names) + texture.name, "wood.png");
    EXPECT_EQ(elements<float>(arena, arena.scene().environment.columns)[2], 0.25f);
    EXPECT_EQ(arena.scene().environment.environment_from_world[8], 1);
    EXPECT_EQ(arena.scene().nodes.count, 4u);
    EXPECT_EQ(arena.scene().channels.count, 4u);
    EXPECT_EQ(arena.scene().skins.count, 1u);
    EXPECT_EQ(geometries(arena)[2].morph_positions.count, 4u);
}

struct Corruption {
    const char *field;
    std::function<void(Arena &)> corrupt;
    const char *message;
};

class Rejects : public testing::TestWithParam<Corruption> {};

TEST_P(Rejects, Field) {
    Arena arena = small_scene().build();
    ASSERT_EQ(validate(arena.bytes()), "");
    GetParam().corrupt(arena);
    EXPECT_THAT(validate(arena.bytes()), HasSubstr(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    Validate, Rejects,
    testing::Values(
        Corruption{"Magic", [](Arena &a) { header(a).magic ^= 1; }, "magic number"},
        Corruption{"Version", [](Arena &a) { header(a).version = 1; }, "version is 1, not 3"},
        Corruption{"StructSize", [](Arena &a) { header(a).struct_size += 8; }, "the struct_size of its header is wrong"},
        Corruption{"ByteSizeTooLarge", [](Arena &a) { header(a).byte_size += 64; }, "bytes, but"},
        Corruption{"ByteSizeHuge", [](Arena &a) { header(a).byte_size = ~0ull; }, "bytes, but"},
        Corruption{"ByteSizeTooSmall", [](Arena &a) { header(a).byte_size = 8; }, "bytes, but"},
        Corruption{"ByteSizeCutsTheLastBuffer", [](Arena &a) { header(a).byte_size -= 64; }, "extends past the end"},
        Corruption{"Axes", [](Arena &a) { header(a).axes = 0; }, "its value of 'axes' is unknown"},
        Corruption{"MaxDepth", [](Arena &a) { header(a).max_depth = 101; }, "max_depth is 101, more than 100"},
        Corruption{"Ambient", [](Arena &a) { header(a).ambient[1] = nan_value; }, "the ambient light is nan"},
        Corruption{"Background", [](Arena &a) { header(a).background[2] = -1; }, "the background is -1"},
        Corruption{"ShadowAlphaOpaque", [](Arena &a) { header(a).shadow_alpha_opaque = 1.5f; },
                   "shadow_alpha_opaque is 1.5"},
        Corruption{"ShadowAlphaTranslucent", [](Arena &a) { header(a).shadow_alpha_translucent = nan_value; },
                   "shadow_alpha_translucent is nan"},
        Corruption{"BoundsNotFinite", [](Arena &a) { header(a).bounds_min[0] = nan_value; }, "bounds_min is nan"},
        Corruption{"BoundsInverted", [](Arena &a) { header(a).bounds_min[0] = 11; },
                   "bounds_min is above bounds_max"},
        Corruption{"BoundsTooSmall", [](Arena &a) { header(a).bounds_max[2] = 20; },
                   "object 1 'ball' is outside the scene's bounds"},
        Corruption{"GeometryTableStride", [](Arena &a) { header(a).geometries.stride = 8; },
                   "the table of geometries has a stride of 8 bytes"},
        Corruption{"MaterialTableCount", [](Arena &a) { header(a).materials.count = 0xffffffff; },
                   "the table of materials extends past the end"},
        Corruption{"ObjectTableOffset", [](Arena &a) { header(a).objects.offset += 4; },
                   "the table of objects is not aligned to 64 bytes"},
        Corruption{"LightTableOffsetHuge", [](Arena &a) { header(a).lights.offset = ~0ull & ~63ull; },
                   "the table of lights extends past the end"},
        Corruption{"NamesOverHeader", [](Arena &a) { header(a).names.offset = 64; },
                   "the table of names overlaps the header"},
        Corruption{"NamesNotTerminated",
                   [](Arena &a) { elements<char>(a, header(a).names)[header(a).names.count - 1] = 'x'; },
                   "the last name has no terminating zero"},
        Corruption{"NameWithEscape", [](Arena &a) { elements<char>(a, header(a).names)[0] = '\033'; },
                   "control character"},
        Corruption{"AbsentBufferWithOffset",
                   [](Arena &a) {
                       header(a).lights = {64, 0, 0};
                   },
                   "is absent, but"},
        Corruption{"ObjectName", [](Arena &a) { objects(a)[1].name = header(a).names.count; },
                   "name of object 1 is outside"},
        Corruption{"ObjectGeometry", [](Arena &a) { objects(a)[0].geometry = 2; },
                   "object 0 'square' refers to geometry 2, but the scene has only 2"},
        Corruption{"ObjectMaterial", [](Arena &a) { objects(a)[1].material = ARHOST_NONE; },
                   "object 1 'ball' refers to material 4294967295, but the scene has only 1"},
        Corruption{"ObjectRole", [](Arena &a) { objects(a)[1].role = 4; },
                   "object 1 'ball' has an unknown role"},
        Corruption{"ObjectTransformNotFinite", [](Arena &a) { objects(a)[0].world_from_object[11] = nan_value; },
                   "object 0 'square': an element of world_from_object is nan"},
        Corruption{"ObjectTransformFlat", [](Arena &a) { objects(a)[0].world_from_object[4] = 0; },
                   "world_from_object cannot be inverted"},
        Corruption{"MaterialModel", [](Arena &a) { materials(a)[0].model = 7; },
                   "material 0: its model is unknown"},
        Corruption{"MaterialTexture", [](Arena &a) { materials(a)[0].colour_texture = 0; }, "texture 0, but the scene has only 0"},
        Corruption{"MaterialIndex", [](Arena &a) { materials(a)[0].index = 0.5f; }, "index is 0.5, outside 1 to 4"},
        Corruption{"MaterialExtinction", [](Arena &a) { materials(a)[0].extinction[1] = -1; }, "extinction is -1"},
        Corruption{"MaterialFresnel", [](Arena &a) { materials(a)[0].fresnel_maximum = 0; }, "fresnel_maximum is 0"},
        Corruption{"MaterialEmission", [](Arena &a) { materials(a)[0].emission[2] = nan_value; }, "emission is"},
        Corruption{"MaterialRoughness", [](Arena &a) { materials(a)[0].roughness = 2; }, "roughness is 2"},
        Corruption{"MaterialAmbient", [](Arena &a) { materials(a)[0].ambient[0] = 2; },
                   "material 0: ambient is 2, outside 0 to 1"},
        Corruption{"MaterialDiffuse", [](Arena &a) { materials(a)[0].diffuse[0] = -0.1f; }, "diffuse is -0.1"},
        Corruption{"MaterialSpecular", [](Arena &a) { materials(a)[0].specular[2] = nan_value; }, "specular is nan"},
        Corruption{"MaterialExponent", [](Arena &a) { materials(a)[0].exponent = 0.5f; }, "exponent is 0.5"},
        Corruption{"MaterialReflectivity", [](Arena &a) { materials(a)[0].reflectivity[2] = 1.1f; },
                   "reflectivity is 1.1"},
        Corruption{"LightType", [](Arena &a) { lights(a)[0].type = 6; }, "light 0: its type is unknown"},
        Corruption{"LightDirection",
                   [](Arena &a) {
                       lights(a)[0].type = ARHOST_LIGHT_SPOT;
                       lights(a)[0].direction[2] = 0.5f;
                   },
                   "its direction is not of length 1"},
        Corruption{"DirectionalLightWithFalloff",
                   [](Arena &a) {
                       lights(a)[0].type = ARHOST_LIGHT_DIRECTIONAL;
                       lights(a)[0].falloff = ARHOST_FALLOFF_INVERSE_SQUARE;
                   },
                   "cannot have a falloff"},
        Corruption{"LightCone", [](Arena &a) { lights(a)[0].cosine_outer = 0.5f; }, "cosine_inner is 0"},
        Corruption{"LightRadius", [](Arena &a) { lights(a)[0].radius = -1; }, "radius is -1"},
        Corruption{"LightFalloff", [](Arena &a) { lights(a)[0].falloff = 0; },
                   "light 0: its falloff is unknown"},
        Corruption{"LightPosition", [](Arena &a) { lights(a)[0].position[0] = -nan_value; }, "light 0: position is"},
        Corruption{"LightIntensity",
                   [](Arena &a) { lights(a)[0].intensity[0] = std::numeric_limits<float>::infinity(); },
                   "light 0: intensity is inf"}),
    [](const auto &info) { return std::string(info.param.field); });

INSTANTIATE_TEST_SUITE_P(
    ValidateGeometry, Rejects,
    testing::Values(
        Corruption{"GeometryType", [](Arena &a) { geometries(a)[0].type = 3; },
                   "geometry 0 (object 0 'square'): its type is unknown"},
        Corruption{"GeometryReserved", [](Arena &a) { geometries(a)[0].reserved = 1; }, "reserved field"},
        Corruption{"TrianglesAsSpheres", [](Arena &a) { geometries(a)[0].type = ARHOST_GEOMETRY_SPHERES; },
                   "stride of 12 bytes, not 16"},
        Corruption{"PositionsCount", [](Arena &a) { geometries(a)[0].positions.count = 100000; },
                   "the buffer of positions extends past the end"},
        Corruption{"NormalsCount", [](Arena &a) { geometries(a)[0].normals.count = 3; },
                   "it has 3 normals for 4 vertices"},
        Corruption{"TexcoordsCount", [](Arena &a) { geometries(a)[0].texcoords.count = 3; },
                   "it has 3 texcoords for 4 vertices"},
        Corruption{"NoTriangles", [](Arena &a) { geometries(a)[0].indices = {}; },
                   "geometry 0 (object 0 'square'): it has no triangles"},
        Corruption{
            "NoVertices",
            [](Arena &a) { geometries(a)[0].positions = geometries(a)[0].normals = geometries(a)[0].texcoords = {}; },
            "triangle 0 refers to vertex 2, but the mesh has only 0"},
        Corruption{"Index", [](Arena &a) { indices(a)[5] = 4; },
                   "geometry 0 (object 0 'square'): triangle 1 refers to vertex 4, but the mesh has only 4"},
        Corruption{"IndexHuge", [](Arena &a) { indices(a)[0] = ARHOST_NONE; },
                   "triangle 0 refers to vertex 4294967295"},
        Corruption{"PositionNotANumber", [](Arena &a) { positions(a)[10] = nan_value; },
                   "vertex 3 has the invalid coordinate nan"},
        Corruption{"PositionInfinite", [](Arena &a) { positions(a)[0] = -std::numeric_limits<float>::infinity(); },
                   "vertex 0 has the invalid coordinate -inf"},
        Corruption{"PositionTooFar", [](Arena &a) { positions(a)[3] = 1.1e9f; },
                   "vertex 1 has the invalid coordinate 1.1e+09"},
        Corruption{"NormalLength", [](Arena &a) { normals(a)[5] = 0.9f; }, "normal 1 is not of unit length"},
        Corruption{"NormalNotANumber", [](Arena &a) { normals(a)[11] = nan_value; },
                   "normal 3 is not of unit length"},
        Corruption{"TexcoordNotANumber", [](Arena &a) { texcoords(a)[4] = nan_value; },
                   "texcoord 2 has the invalid coordinate nan"},
        Corruption{"SphereRadiusZero", [](Arena &a) { ball(a)[3] = 0; },
                   "geometry 1 (object 1 'ball'): sphere 0 has the invalid radius 0"},
        Corruption{"SphereNotANumber", [](Arena &a) { ball(a)[1] = nan_value; },
                   "sphere 0 has the invalid coordinate nan"},
        Corruption{"SpheresWithIndices",
                   [](Arena &a) {
                       geometries(a)[1].indices = {0, 0, 12};
                   },
                   "spheres cannot have normals, texcoords, indices"},
        Corruption{"PositionsOverHeader", [](Arena &a) { geometries(a)[0].positions.offset = 0; },
                   "overlaps the header"},
        Corruption{"NoSpheres", [](Arena &a) { geometries(a)[1].positions = {}; }, "it has no spheres"}),
    [](const auto &info) { return std::string(info.param.field); });

TEST(Validate, RequiresSixteenReadableBytesAfterTheLastBuffer) {
    Arena arena = small_scene().build();
    const arhost_buffer &last = header(arena).geometries;
    const std::uint64_t end = last.offset + std::uint64_t(last.count) * last.stride;
    header(arena).byte_size = end + 16;
    EXPECT_EQ(validate(arena.bytes()), "");
    header(arena).byte_size = end + 15;
    EXPECT_THAT(validate(arena.bytes()), HasSubstr("the table of geometries extends past the end"));
}

TEST(Validate, AcceptsLargerMemoryThanTheScene) { // because a memfd is mapped in whole pages
    Arena small = small_scene().build();
    Arena large(small.bytes().size() + 4096);
    std::memcpy(large.bytes().data(), small.bytes().data(), small.bytes().size());
    EXPECT_EQ(validate(large.bytes()), "");
}

TEST(Validate, RejectsMemoryThatIsTooShortOrMisaligned) {
    const Arena arena = small_scene().build();
    EXPECT_THAT(validate({}), HasSubstr("shorter than the header"));
    EXPECT_THAT(validate(arena.bytes().first(sizeof(arhost_scene) - 1)), HasSubstr("shorter than the header"));
    EXPECT_THAT(validate(arena.bytes().subspan(8)), HasSubstr("its memory is not aligned to 64 bytes"));
    for (std::size_t size = 0; size < arena.bytes().size(); ++size)
        EXPECT_NE(validate(arena.bytes().first(size)), "");
}

class RejectsInFullScene : public testing::TestWithParam<Corruption> {};

TEST_P(RejectsInFullScene, Field) {
    Arena arena = full_scene().build();
    ASSERT_EQ(validate(arena.bytes()), "");
    GetParam().corrupt(arena);
    EXPECT_THAT(validate(arena.bytes()), HasSubstr(GetParam().message));
}

namespace {

arhost_texture *textures(Arena &a) {
    return elements<arhost_texture>(a, header(a).textures);
}
arhost_node *nodes(Arena &a) {
    return elements<arhost_node>(a, header(a).nodes);
}
arhost_channel *channels(Arena &a) {
    return elements<arhost_channel>(a, header(a).channels);
}
arhost_skin *skins(Arena &a) {
    return elements<arhost_skin>(a, header(a).skins);
}
arhost_anchor *anchors(Arena &a) {
    return elements<arhost_anchor>(a, header(a).anchors);
}
float *floats(Arena &a, const arhost_buffer &buffer) {
    return elements<float>(a, buffer);
}

} // namespace

INSTANTIATE_TEST_SUITE_P(
    Textures, RejectsInFullScene,
    testing::Values(
        Corruption{"Format", [](Arena &a) { textures(a)[0].format = 4; }, "texture 0: its format is unknown"},
        Corruption{"FormatOfOtherSize", [](Arena &a) { textures(a)[0].format = ARHOST_TEXEL_RGBA32F; },
                   "texture 0: the buffer of texels has a stride of 4 bytes, not 16"},
        Corruption{"WrapU", [](Arena &a) { textures(a)[0].wrap_u = 0; }, "its wrap mode is unknown"},
        Corruption{"WrapV", [](Arena &a) { textures(a)[1].wrap_v = 4; }, "texture 1: its wrap mode"},
        Corruption{"Name", [](Arena &a) { textures(a)[1].name = header(a).names.count; },
                   "outside the table of names"},
        Corruption{"Width", [](Arena &a) { textures(a)[0].width = 0; },
                   "has 0 x 3 texels; each side must have 1 to 16384"},
        Corruption{"Height", [](Arena &a) { textures(a)[0].height = 16385; }, "2 x 16385 texels"},
        Corruption{"TexelCount", [](Arena &a) { textures(a)[0].height = 2; }, "has 6 texels for 2 x 2"},
        Corruption{"TexelNotANumber", [](Arena &a) { floats(a, textures(a)[1].texels)[5] = nan_value; },
                   "texture 1: texel 1 has the invalid value nan"},
        Corruption{"TexelBelowZero", [](Arena &a) { floats(a, textures(a)[1].texels)[15] = -1; },
                   "texel 3 has the invalid value -1"},
        Corruption{"TexelTooBright", [](Arena &a) { floats(a, textures(a)[1].texels)[0] = 1.1e6f; },
                   "texel 0 has the invalid value 1.1e+06"},
        Corruption{"MaterialsTexture", [](Arena &a) { materials(a)[0].normal_texture = 2; },
                   "material 0: it refers to texture 2, but the scene has only 2"},
        Corruption{"TextureWithoutTexcoords", [](Arena &a) { objects(a)[1].material = 0; },
                   "object 1 'ball' has a textured material, but its geometry has no texcoords"},
        Corruption{"Environment", [](Arena &a) { header(a).environment.texture = 2; },
                   "the environment refers to texture 2, but the scene has only 2"},
        Corruption{"EnvironmentOfBytes", [](Arena &a) { header(a).environment.texture = 0; }, "is not RGBA32F"},
        Corruption{"EnvironmentMissing", [](Arena &a) { header(a).environment.texture = ARHOST_NONE; },
                   "there is no environment, but"},
        Corruption{"EnvironmentIntensity", [](Arena &a) { header(a).environment.intensity = nan_value; },
                   "the environment's intensity is nan"},
        Corruption{"EnvironmentScaled", [](Arena &a) { header(a).environment.environment_from_world[4] = 0.9f; },
                   "environment_from_world is not a rotation"},
        Corruption{"EnvironmentMirrored", [](Arena &a) { header(a).environment.environment_from_world[8] = -1; },
                   "environment_from_world is not a rotation"},
        Corruption{"EnvironmentRotationNotANumber",
                   [](Arena &a) { header(a).environment.environment_from_world[2] = nan_value; }, "is nan"},
        Corruption{"Rows", [](Arena &a) { header(a).environment.rows.count = 1; }, "has 1 rows and 4 columns"},
        Corruption{"Columns", [](Arena &a) { header(a).environment.columns.count = 2; }, "has 2 rows and 2 columns"},
        Corruption{"RowsFall", [](Arena &a) { floats(a, header(a).environment.rows)[0] = 1.5f; },
                   "rows are not cumulative sums"},
        Corruption{"RowsNotANumber", [](Arena &a) { floats(a, header(a).environment.rows)[0] = nan_value; },
                   "rows are not cumulative sums"},
        Corruption{"ColumnsBelowZero", [](Arena &a) { floats(a, header(a).environment.columns)[2] = -0.1f; },
                   "columns are not cumulative sums"},
        Corruption{"ColumnsEnd", [](Arena &a) { floats(a, header(a).environment.columns)[3] = 0.9f; },
                   "columns end at 0.9, not at 1"}),
    [](const auto &info) { return std::string(info.param.field); });

INSTANTIATE_TEST_SUITE_P(
    Motion, RejectsInFullScene,
    testing::Values(
        Corruption{"Duration", [](Arena &a) { header(a).duration_s = nan_value; }, "duration_s is nan"},
        Corruption{"NoDuration",
                   [](Arena &a) {
                       header(a).duration_s = 0;
                       header(a).anchors = {};
                   },
                   "object 1 'ball' moves or deforms, but the scene has no anchors and its duration_s is 0"},
        Corruption{"AnchorNode", [](Arena &a) { anchors(a)[0].node = 9; },
                   "anchor 0: it refers to node 9, but the scene has only"},
        Corruption{"AnchorWithParent", [](Arena &a) { nodes(a)[anchors(a)[0].node].parent = 0; },
                   "anchor 0: its node has a parent or is animated"},
        Corruption{"AnchorAnimated", [](Arena &a) { nodes(a)[anchors(a)[0].node].animated = 1; },
                   "anchor 0: its node has a parent or is animated"},
        Corruption{"AnchorName", [](Arena &a) { anchors(a)[0].target = 1'000'000; },
                   "anchor 0: its name is outside the table of names"},
        Corruption{"ObjectNode", [](Arena &a) { objects(a)[1].node = 4; },
                   "refers to node 4, but the scene has only 4"},
        Corruption{"ObjectWithoutNode", [](Arena &a) { objects(a)[1].node = ARHOST_NONE; },
                   "refers to node 4294967295"},
        Corruption{"ObjectSkin", [](Arena &a) { objects(a)[2].skin = 1; },
                   "object 2 'bend' refers to skin 1, but the scene has only 1"},
        Corruption{"NodeOfStaticObject", [](Arena &a) { objects(a)[0].node = 0; }, "but neither moves nor deforms"},
        Corruption{"SkinnedMoves", [](Arena &a) { objects(a)[2].moves = 1; },
                   "has a skin; it must therefore set deforms, not moves"},
        Corruption{"SkinnedWithTransform", [](Arena &a) { objects(a)[2].world_from_object[9] = 1; },
                   "world_from_object must be the identity"},
        Corruption{"SpheresDeform", [](Arena &a) { objects(a)[1].deforms = 1; },
                   "deforms, but its geometry is not a triangle mesh"},
        Corruption{"DeformingShared",
                   [](Arena &a) {
                       objects(a)[0].geometry = 2;
                       objects(a)[0].material = 1;
                   },
                   "object 2 'bend' deforms geometry 2, which another object uses too"},
        Corruption{"DeformsWithNothing",
                   [](Arena &a) {
                       objects(a)[1].geometry = 0;
                       objects(a)[1].deforms = 1;
                       objects(a)[0].geometry = 1;
                       objects(a)[0].material = 1;
                   },
                   "it deforms, but has neither a skin nor morph targets"},
        Corruption{"JointsOfStaticGeometry", [](Arena &a) { geometries(a)[0].joints = geometries(a)[2].joints; },
                   "has 4 joints and 0 weights for 4 vertices without a skin"},
        Corruption{"JointCount", [](Arena &a) { geometries(a)[2].joints.count = 3; }, "3 joints and 4 weights"},
        Corruption{"WeightCount", [](Arena &a) { geometries(a)[2].weights.count = 3; }, "4 joints and 3 weights"},
        Corruption{"JointIndex", [](Arena &a) { elements<std::uint16_t>(a, geometries(a)[2].joints)[15] = 2; },
                   "vertex 3 refers to joint 2, but the skin has only 2 joints"},
        Corruption{"WeightSum", [](Arena &a) { floats(a, geometries(a)[2].weights)[4] = 0.9f; },
                   "vertex 1 has invalid joint weights; they must not be negative, and their sum must be 1"},
        Corruption{"WeightNotANumber", [](Arena &a) { floats(a, geometries(a)[2].weights)[3] = nan_value; },
                   "vertex 0 has invalid joint weights"},
        Corruption{"WeightBelowZero",
                   [](Arena &a) {
                       floats(a, geometries(a)[2].weights)[0] = 1.5f;
                       floats(a, geometries(a)[2].weights)[1] = -0.5f;
                   },
                   "vertex 0 has invalid joint weights"},
        Corruption{"MorphPositionCount", [](Arena &a) { geometries(a)[2].morph_positions.count = 3; },
                   "has 3 morph_positions for 1 targets and 4 vertices"},
        Corruption{"MorphNormalCount", [](Arena &a) { geometries(a)[2].morph_normals.count = 3; }, "3 morph_normals"},
        Corruption{"MorphPosition", [](Arena &a) { floats(a, geometries(a)[2].morph_positions)[4] = nan_value; },
                   "morph position 1 has the invalid coordinate nan"},
        Corruption{"MorphNormal", [](Arena &a) { floats(a, geometries(a)[2].morph_normals)[0] = 2e9f; },
                   "morph normal 0 has the invalid coordinate 2e+09"},
        Corruption{"NodeParent", [](Arena &a) { nodes(a)[1].parent = 1; }, "node 1: its parent 1 does not precede"},
        Corruption{"NodeTransform", [](Arena &a) { nodes(a)[1].parent_from_node[3] = nan_value; },
                   "parent_from_node is nan"},
        Corruption{"NodeTranslation", [](Arena &a) { nodes(a)[0].translation[0] = 2e9f; }, "translation is 2e+09"},
        Corruption{"NodeRotation", [](Arena &a) { nodes(a)[0].rotation[3] = 0.5f; }, "rotation is not of length 1"},
        Corruption{"NodeRotationNotANumber", [](Arena &a) { nodes(a)[0].rotation[0] = nan_value; },
                   "rotation is nan"},
        Corruption{"NodeScale", [](Arena &a) { nodes(a)[0].scale[2] = nan_value; }, "scale is nan"},
        Corruption{"NodeWeight", [](Arena &a) { floats(a, nodes(a)[2].morph_weights)[0] = nan_value; },
                   "a morph weight is nan"},
        Corruption{"ChannelNode", [](Arena &a) { channels(a)[0].node = 4; }, "channel 0: it refers to node 4"},
        Corruption{"ChannelNodeNotAnimated", [](Arena &a) { channels(a)[0].node = 1; }, "its node is not animated"},
        Corruption{"ChannelTarget", [](Arena &a) { channels(a)[0].target = 5; }, "its target is unknown"},
        Corruption{"ChannelInterpolation", [](Arena &a) { channels(a)[0].interpolation = 0; },
                   "its interpolation is unknown"},
        Corruption{"ChannelReserved", [](Arena &a) { channels(a)[0].reserved = 1; }, "a reserved field is not 0"},
        Corruption{"ChannelWithoutKeys", [](Arena &a) { channels(a)[2].times = channels(a)[2].values = {}; },
                   "channel 2: it has no keys"},
        Corruption{"ChannelTimes", [](Arena &a) { floats(a, channels(a)[0].times)[1] = 0; },
                   "its times are not strictly increasing"},
        Corruption{"ChannelTimeNotANumber", [](Arena &a) { floats(a, channels(a)[0].times)[0] = nan_value; },
                   "a time is nan"},
        Corruption{"ChannelTimeBelowZero", [](Arena &a) { floats(a, channels(a)[0].times)[0] = -1; }, "a time is -1"},
        Corruption{"ChannelValueCount", [](Arena &a) { channels(a)[0].values.count = 5; },
                   "has 5 values for 2 keys with 3 components each"},
        Corruption{"ChannelOfOtherWidth", [](Arena &a) { channels(a)[0].target = ARHOST_CHANNEL_ROTATION; },
                   "has 6 values for 2 keys with 4 components each"},
        Corruption{"ChannelWithoutWeights", [](Arena &a) { channels(a)[3].node = 1; }, "keys with 0 components each"},
        Corruption{"ChannelCubicTooShort",
                   [](Arena &a) { channels(a)[0].interpolation = ARHOST_INTERPOLATION_CUBIC; },
                   "has 6 values for 2 keys with 3 components each"},
        Corruption{"ChannelValue", [](Arena &a) { floats(a, channels(a)[3].values)[2] = nan_value; },
                   "a value is nan"},
        Corruption{"ChannelRotation", [](Arena &a) { floats(a, channels(a)[1].values)[7] = 1; },
                   "the rotation of key 1 is not of length 1"},
        Corruption{"SkinJoint", [](Arena &a) { elements<std::uint32_t>(a, skins(a)[0].joints)[1] = 4; },
                   "skin 0: it refers to node 4, but the scene has only 4"},
        Corruption{"SkinWithoutJoints", [](Arena &a) { skins(a)[0].joints = {}; }, "has 0 joints and 2 matrices"},
        Corruption{"SkinMatrixCount", [](Arena &a) { skins(a)[0].node_from_mesh.count = 1; },
                   "2 joints and 1 matrices"},
        Corruption{"SkinMatrix", [](Arena &a) { floats(a, skins(a)[0].node_from_mesh)[0] = nan_value; },
                   "node_from_mesh is nan"}),
    [](const auto &info) { return std::string(info.param.field); });

// If buffers could be shared, checking a small arena could keep the host busy for hours.
TEST(Validate, RejectsGeometriesThatShareABuffer) {
    ArenaBuilder builder;
    const std::uint32_t material = builder.add_material(grey());
    for (int i = 0; i < 1000; ++i)
        builder.add_object("square", builder.add_triangles(square()), material);
    Spheres many(1000, glm::vec4(0, 0, 0, 1));
    builder.add_object("spheres", builder.add_spheres(many), material);
    Arena arena = std::move(builder).build();
    ASSERT_EQ(validate(arena.bytes()), "");
    for (int i = 0; i < 1000; ++i)
        geometries(arena)[i] = geometries(arena)[1000];
    EXPECT_THAT(validate(arena.bytes()), HasSubstr("overlaps other buffers"));
}

TEST(Validate, IsFastIfManyObjectsShareAVeryLongName) {
    ArenaBuilder builder;
    const std::uint32_t material = builder.add_material(grey());
    const std::uint32_t geometry = builder.add_triangles(square());
    builder.add_object(std::string(10'000'000, 'x'), geometry, material);
    for (int i = 1; i < 10'000; ++i)
        builder.add_object("", geometry, material);
    Arena arena = std::move(builder).build();
    for (int i = 1; i < 10'000; ++i)
        objects(arena)[i].name = 0;
    objects(arena)[9'999].role = 0;
    EXPECT_EQ(validate(arena.bytes()), "object 9999 '" + std::string(64, 'x') + "' has an unknown role");
}

TEST(Validate, ReadsBuffersOnlyWithinTheArena) {
    const std::size_t buffer_count = [] {
        Arena arena = small_scene().build();
        return buffers(arena).size();
    }();
    const std::uint64_t offsets[] = {0, 1, 64, 1ull << 20, 1ull << 63, ~0ull & ~63ull, ~0ull};
    const std::uint32_t counts[] = {0, 1, 5, 1u << 20, 1u << 31, ~0u};
    const std::uint32_t strides[] = {0, 1, 12, 16, 1u << 31, ~0u};
    for (std::size_t i = 0; i < buffer_count; ++i)
        for (const std::uint64_t offset : offsets)
            for (const std::uint32_t count : counts)
                for (const std::uint32_t stride : strides) {
                    if (offset == 0 && count == 0 && stride == 0)
                        continue; // an absent buffer is valid
                    Arena arena = small_scene().build();
                    *buffers(arena)[i] = {offset, count, stride};
                    EXPECT_NE(validate(arena.bytes()), "") << i << ' ' << offset << ' ' << count << ' ' << stride;
                }
}

// For any content, validate() must return without reading out of bounds, which the sanitizer builds detect.
TEST(Validate, SurvivesRandomBytes) {
    const Arena whole = full_scene().build();
    std::mt19937 random(1);
    int rejected = 0;
    Arena arena(whole.bytes().size());
    for (int round = 0; round < 100000; ++round) {
        std::memcpy(arena.bytes().data(), whole.bytes().data(), whole.bytes().size());
        for (unsigned flips = 1 + random() % 4; flips > 0; --flips)
            arena.bytes()[random() % arena.bytes().size()] ^= std::byte(1 + random() % 255);
        const bool is_valid = validate(arena.bytes()).empty();
        rejected += !is_valid;
        if (is_valid && arena.scene().duration_s > 0) // evaluating a valid arena must be safe
            MotionEvaluator(arena.scene()).at(0.7);
    }
    EXPECT_GT(rejected, 25000); // the remaining flips change spare bytes, or give another valid value
}
