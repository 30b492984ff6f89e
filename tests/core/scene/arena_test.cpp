// SPDX-License-Identifier: Apache-2.0
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

// All buffers of the small scene, absent ones left out.
std::vector<arhost_buffer *> buffers(Arena &a) {
    arhost_scene &scene = header(a);
    arhost_geometry *g = geometries(a);
    return {&scene.geometries, &scene.materials, &scene.objects,  &scene.lights, &scene.names,
            &g[0].positions,   &g[0].normals,    &g[0].texcoords, &g[0].indices, &g[1].positions};
}

} // namespace

TEST(ArenaBuilder, WritesWhatItWasGiven) {
    ArenaBuilder builder = small_scene();
    builder.settings = {ARHOST_Y_UP, 7, glm::vec3(0.1f, 0.2f, 0.3f), glm::vec3(0.4f), 0.5f, 0.25f};
    EXPECT_EQ(builder.triangle_count(), 2u);
    EXPECT_EQ(builder.object_count(), 2u);
    const std::size_t size = builder.byte_size();
    Arena arena = std::move(builder).build();
    ASSERT_EQ(validate(arena.bytes()), "");

    const arhost_scene &scene = arena.scene();
    EXPECT_EQ(scene.byte_size, size);
    EXPECT_EQ(scene.axes, ARHOST_Y_UP);
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
    EXPECT_EQ(objects(arena)[1].role, ARHOST_CATCHER);
    EXPECT_THAT(objects(arena)[0].world_from_object, testing::ElementsAre(1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0));
}

TEST(ArenaBuilder, LeavesSixteenSpareBytesBehindEveryBufferAndOverlapsNone) {
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

TEST(ArenaBuilder, WritesIntoMemoryOfTheCallerAndNothingBehindIt) {
    ArenaBuilder builder = small_scene();
    const std::size_t size = builder.byte_size();
    Arena memory(size + 64);
    std::memset(memory.bytes().data(), 0xa5, memory.bytes().size());
    std::move(builder).write(memory.bytes());
    EXPECT_EQ(validate(memory.bytes()), "");
    EXPECT_THAT(memory.bytes().subspan(size), testing::Each(std::byte(0xa5)));
    const Arena again = small_scene().build(); // no byte depends on what the memory held before
    EXPECT_EQ(std::memcmp(memory.bytes().data(), again.bytes().data(), size), 0);
}

TEST(ArenaBuilder, RefusesMemoryThatIsTooSmallOrNotAligned) {
    Arena memory(small_scene().byte_size() + 64);
    EXPECT_THROW(small_scene().write(memory.bytes().first(small_scene().byte_size() - 1)), std::invalid_argument);
    EXPECT_THROW(small_scene().write(memory.bytes().subspan(8)), std::invalid_argument);
}

TEST(ArenaBuilder, PutsTransformedObjectsIntoTheBounds) {
    ArenaBuilder builder;
    const std::uint32_t material = builder.add_material(grey());
    const glm::mat4x3 moved(glm::vec3(2, 0, 0), glm::vec3(0, 2, 0), glm::vec3(0, 0, 2), glm::vec3(100, 0, 0));
    builder.add_object("ball", builder.add_spheres({{0, 0, 0, 5}}), material, ARHOST_VIRTUAL, moved);
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

struct Corruption {
    const char *field;
    std::function<void(Arena &)> spoil;
    const char *message;
};

class RefusesWrong : public testing::TestWithParam<Corruption> {};

TEST_P(RefusesWrong, Field) {
    Arena arena = small_scene().build();
    ASSERT_EQ(validate(arena.bytes()), "");
    GetParam().spoil(arena);
    EXPECT_THAT(validate(arena.bytes()), HasSubstr(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    Validate, RefusesWrong,
    testing::Values(
        Corruption{"Magic", [](Arena &a) { header(a).magic ^= 1; }, "magic number"},
        Corruption{"Version", [](Arena &a) { header(a).version = 1; }, "version is 1, not 2"},
        Corruption{"StructSize", [](Arena &a) { header(a).struct_size += 8; }, "header has the wrong size"},
        Corruption{"ByteSizeTooLarge", [](Arena &a) { header(a).byte_size += 64; }, "bytes, but"},
        Corruption{"ByteSizeHuge", [](Arena &a) { header(a).byte_size = ~0ull; }, "bytes, but"},
        Corruption{"ByteSizeTooSmall", [](Arena &a) { header(a).byte_size = 8; }, "bytes, but"},
        Corruption{"ByteSizeCutsTheLastBuffer", [](Arena &a) { header(a).byte_size -= 64; }, "reaches past the end"},
        Corruption{"Axes", [](Arena &a) { header(a).axes = 0; }, "axes are of no known kind"},
        Corruption{"MaxDepth", [](Arena &a) { header(a).max_depth = 101; }, "max_depth is 101, more than 100"},
        Corruption{"Ambient", [](Arena &a) { header(a).ambient[1] = nan_value; }, "the ambient light is nan"},
        Corruption{"Background", [](Arena &a) { header(a).background[2] = -1; }, "the background is -1"},
        Corruption{"ShadowAlphaOpaque", [](Arena &a) { header(a).shadow_alpha_opaque = 1.5f; },
                   "shadow_alpha_opaque is 1.5"},
        Corruption{"ShadowAlphaTranslucent", [](Arena &a) { header(a).shadow_alpha_translucent = nan_value; },
                   "shadow_alpha_translucent is nan"},
        Corruption{"BoundsNotFinite", [](Arena &a) { header(a).bounds_min[0] = nan_value; }, "bounds_min is nan"},
        Corruption{"BoundsTurnedRound", [](Arena &a) { header(a).bounds_min[0] = 11; },
                   "bounds_min is above bounds_max"},
        Corruption{"BoundsTooSmall", [](Arena &a) { header(a).bounds_max[2] = 20; },
                   "object 1 'ball' lies outside the scene's bounds"},
        Corruption{"GeometryTableStride", [](Arena &a) { header(a).geometries.stride = 8; },
                   "the table of geometries has a stride of 8 bytes"},
        Corruption{"MaterialTableCount", [](Arena &a) { header(a).materials.count = 0xffffffff; },
                   "the table of materials reaches past the end"},
        Corruption{"ObjectTableOffset", [](Arena &a) { header(a).objects.offset += 4; },
                   "the table of objects does not begin at a multiple of 64"},
        Corruption{"LightTableOffsetHuge", [](Arena &a) { header(a).lights.offset = ~0ull & ~63ull; },
                   "the table of lights reaches past the end"},
        Corruption{"NamesOverHeader", [](Arena &a) { header(a).names.offset = 64; },
                   "the names lies over the header"},
        Corruption{"NamesWithoutEnd",
                   [](Arena &a) { elements<char>(a, header(a).names)[header(a).names.count - 1] = 'x'; },
                   "the last name has no end"},
        Corruption{"NameWithEscape", [](Arena &a) { elements<char>(a, header(a).names)[0] = '\033'; },
                   "control character"},
        Corruption{"AbsentBufferWithOffset",
                   [](Arena &a) {
                       header(a).lights = {64, 0, 0};
                   },
                   "is absent, yet"},
        Corruption{"ObjectName", [](Arena &a) { objects(a)[1].name = header(a).names.count; },
                   "name of object 1 lies outside"},
        Corruption{"ObjectGeometry", [](Arena &a) { objects(a)[0].geometry = 2; },
                   "object 0 'square' has geometry 2, but there are 2"},
        Corruption{"ObjectMaterial", [](Arena &a) { objects(a)[1].material = ARHOST_NONE; },
                   "object 1 'ball' has material 4294967295, but there are 1"},
        Corruption{"ObjectRole", [](Arena &a) { objects(a)[1].role = 4; },
                   "object 1 'ball' has a role of no known kind"},
        Corruption{"ObjectTransformNotFinite", [](Arena &a) { objects(a)[0].world_from_object[11] = nan_value; },
                   "object 0 'square': a number of world_from_object is nan"},
        Corruption{"ObjectTransformFlat", [](Arena &a) { objects(a)[0].world_from_object[4] = 0; },
                   "world_from_object can't be inverted"},
        Corruption{"MaterialModel", [](Arena &a) { materials(a)[0].model = 7; },
                   "material 0: its model is of no known kind"},
        Corruption{"MaterialTexture", [](Arena &a) { materials(a)[0].colour_texture = 0; }, "texture 0, but there are 0"},
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
        Corruption{"LightType", [](Arena &a) { lights(a)[0].type = 6; }, "light 0: its type is of no known kind"},
        Corruption{"LightDirection",
                   [](Arena &a) {
                       lights(a)[0].type = ARHOST_SPOT_LIGHT;
                       lights(a)[0].direction[2] = 0.5f;
                   },
                   "its direction is not of length 1"},
        Corruption{"LightFallsOffFromInfinity",
                   [](Arena &a) {
                       lights(a)[0].type = ARHOST_DIRECTIONAL_LIGHT;
                       lights(a)[0].falloff = ARHOST_FALLOFF_INVERSE_SQUARE;
                   },
                   "can't fall off"},
        Corruption{"LightCone", [](Arena &a) { lights(a)[0].cosine_outer = 0.5f; }, "cosine_inner is 0"},
        Corruption{"LightRadius", [](Arena &a) { lights(a)[0].radius = -1; }, "radius is -1"},
        Corruption{"LightFalloff", [](Arena &a) { lights(a)[0].falloff = 0; },
                   "light 0: its falloff is of no known kind"},
        Corruption{"LightPosition", [](Arena &a) { lights(a)[0].position[0] = -nan_value; }, "light 0: position is"},
        Corruption{"LightIntensity",
                   [](Arena &a) { lights(a)[0].intensity[0] = std::numeric_limits<float>::infinity(); },
                   "light 0: intensity is inf"}),
    [](const auto &info) { return std::string(info.param.field); });

INSTANTIATE_TEST_SUITE_P(
    ValidateGeometry, RefusesWrong,
    testing::Values(
        Corruption{"GeometryType", [](Arena &a) { geometries(a)[0].type = 3; },
                   "geometry 0 (object 0 'square'): its type is of no known kind"},
        Corruption{"GeometryReserved", [](Arena &a) { geometries(a)[0].reserved = 1; }, "reserved field"},
        Corruption{"TrianglesAsSpheres", [](Arena &a) { geometries(a)[0].type = ARHOST_SPHERES; },
                   "stride of 12 bytes, not 16"},
        Corruption{"PositionsCount", [](Arena &a) { geometries(a)[0].positions.count = 100000; },
                   "the buffer of positions reaches past the end"},
        Corruption{"NormalsCount", [](Arena &a) { geometries(a)[0].normals.count = 3; },
                   "it has 3 normals for 4 vertices"},
        Corruption{"TexcoordsCount", [](Arena &a) { geometries(a)[0].texcoords.count = 3; },
                   "it has 3 texcoords for 4 vertices"},
        Corruption{"NoTriangles", [](Arena &a) { geometries(a)[0].indices = {}; },
                   "geometry 0 (object 0 'square'): it has no triangles"},
        Corruption{
            "NoVertices",
            [](Arena &a) { geometries(a)[0].positions = geometries(a)[0].normals = geometries(a)[0].texcoords = {}; },
            "triangle 0 has the vertex 2, but there are 0"},
        Corruption{"Index", [](Arena &a) { indices(a)[5] = 4; },
                   "geometry 0 (object 0 'square'): triangle 1 has the vertex 4, but there are 4"},
        Corruption{"IndexHuge", [](Arena &a) { indices(a)[0] = ARHOST_NONE; },
                   "triangle 0 has the vertex 4294967295"},
        Corruption{"PositionNotANumber", [](Arena &a) { positions(a)[10] = nan_value; },
                   "vertex 3 has the coordinate nan"},
        Corruption{"PositionInfinite", [](Arena &a) { positions(a)[0] = -std::numeric_limits<float>::infinity(); },
                   "vertex 0 has the coordinate -inf"},
        Corruption{"PositionTooFar", [](Arena &a) { positions(a)[3] = 1.1e9f; },
                   "vertex 1 has the coordinate 1.1e+09"},
        Corruption{"NormalLength", [](Arena &a) { normals(a)[5] = 0.9f; }, "normal 1 is not of unit length"},
        Corruption{"NormalNotANumber", [](Arena &a) { normals(a)[11] = nan_value; },
                   "normal 3 is not of unit length"},
        Corruption{"TexcoordNotANumber", [](Arena &a) { texcoords(a)[4] = nan_value; },
                   "texcoord 2 has the coordinate nan"},
        Corruption{"SphereRadiusZero", [](Arena &a) { ball(a)[3] = 0; },
                   "geometry 1 (object 1 'ball'): sphere 0 has the radius 0"},
        Corruption{"SphereNotANumber", [](Arena &a) { ball(a)[1] = nan_value; }, "sphere 0 has the coordinate nan"},
        Corruption{"SpheresWithIndices",
                   [](Arena &a) {
                       geometries(a)[1].indices = {0, 0, 12};
                   },
                   "spheres have no normals, texcoords or indices"},
        Corruption{"PositionsOverHeader", [](Arena &a) { geometries(a)[0].positions.offset = 0; },
                   "lies over the header"},
        Corruption{"NoSpheres", [](Arena &a) { geometries(a)[1].positions = {}; }, "it has no spheres"}),
    [](const auto &info) { return std::string(info.param.field); });

TEST(Validate, AsksForSixteenReadableBytesBehindTheLastBuffer) {
    Arena arena = small_scene().build();
    const arhost_buffer &last = geometries(arena)[1].positions;
    const std::uint64_t end = last.offset + std::uint64_t(last.count) * last.stride;
    header(arena).byte_size = end + 16;
    EXPECT_EQ(validate(arena.bytes()), "");
    header(arena).byte_size = end + 15;
    EXPECT_THAT(validate(arena.bytes()), HasSubstr("the buffer of spheres reaches past the end"));
}

TEST(Validate, AcceptsLargerMemoryThanTheScene) { // a memfd is mapped in whole pages
    Arena small = small_scene().build();
    Arena large(small.bytes().size() + 4096);
    std::memcpy(large.bytes().data(), small.bytes().data(), small.bytes().size());
    EXPECT_EQ(validate(large.bytes()), "");
}

TEST(Validate, RefusesMemoryThatIsTooShortOrNotAligned) {
    const Arena arena = small_scene().build();
    EXPECT_THAT(validate({}), HasSubstr("too short for its header"));
    EXPECT_THAT(validate(arena.bytes().first(sizeof(arhost_scene) - 1)), HasSubstr("too short for its header"));
    EXPECT_THAT(validate(arena.bytes().subspan(8)), HasSubstr("multiple of 64 bytes in memory"));
    for (std::size_t size = 0; size < arena.bytes().size(); ++size)
        EXPECT_NE(validate(arena.bytes().first(size)), "");
}

// A few bytes could otherwise keep the host busy for hours.
TEST(Validate, RefusesThatManyGeometriesShareOneLargeBuffer) {
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
    EXPECT_THAT(validate(arena.bytes()), HasSubstr("shares bytes with other buffers"));
}

TEST(Validate, IsQuickWhereManyObjectsShareOneVeryLongName) {
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
    EXPECT_EQ(validate(arena.bytes()), "object 9999 '" + std::string(64, 'x') + "' has a role of no known kind");
}

TEST(Validate, ReadsEveryBufferOnlyInsideTheArena) {
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
                        continue; // means: absent
                    Arena arena = small_scene().build();
                    *buffers(arena)[i] = {offset, count, stride};
                    EXPECT_NE(validate(arena.bytes()), "") << i << ' ' << offset << ' ' << count << ' ' << stride;
                }
}

// Whatever stands in it: an answer, and no read outside (the sanitizers' builds see those).
TEST(Validate, SurvivesRandomBytes) {
    const Arena whole = small_scene().build();
    std::mt19937 random(1);
    int refused = 0;
    for (int round = 0; round < 20000; ++round) {
        Arena arena(whole.bytes().size());
        std::memcpy(arena.bytes().data(), whole.bytes().data(), whole.bytes().size());
        for (unsigned flips = 1 + random() % 4; flips > 0; --flips)
            arena.bytes()[random() % arena.bytes().size()] ^= std::byte(1 + random() % 255);
        refused += !validate(arena.bytes()).empty();
    }
    EXPECT_GT(refused, 5000); // the others hit spare bytes or changed one valid number into another
}
