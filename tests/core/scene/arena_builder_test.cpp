// SPDX-License-Identifier: Apache-2.0
#include "scene/motion.hpp"
#include "scene_samples.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <random>

using namespace arhost::scene;
using namespace arhost::scene::test;
using testing::HasSubstr;

namespace {

// The parts of an arena, writable.
struct Parts {
    explicit Parts(Arena &whole) : arena(whole) {}
    template <class T> T *all(const arhost_buffer &buffer) const { return elements<T>(arena, buffer); }
    float *floats(const arhost_buffer &buffer) const { return all<float>(buffer); }
    float *positions() const { return floats(geometries[0].positions); }
    float *normals() const { return floats(geometries[0].normals); }
    float *texcoords() const { return floats(geometries[0].texcoords); }
    std::uint32_t *indices() const { return all<std::uint32_t>(geometries[0].indices); }
    float *ball() const { return floats(geometries[1].positions); }

    Arena &arena;
    arhost_scene &scene = *reinterpret_cast<arhost_scene *>(arena.bytes().data());
    arhost_geometry *geometries = all<arhost_geometry>(scene.geometries);
    arhost_object *objects = all<arhost_object>(scene.objects);
    arhost_material *materials = all<arhost_material>(scene.materials);
    arhost_light *lights = all<arhost_light>(scene.lights);
    arhost_texel_image *images = all<arhost_texel_image>(scene.images);
    arhost_texture *textures = all<arhost_texture>(scene.textures);
    arhost_node *nodes = all<arhost_node>(scene.nodes);
    arhost_channel *channels = all<arhost_channel>(scene.channels);
    arhost_skin *skins = all<arhost_skin>(scene.skins);
    arhost_anchor *anchors = all<arhost_anchor>(scene.anchors);
    char *names = all<char>(scene.names);
};

// Returns all non-empty buffers of the small scene.
std::vector<arhost_buffer *> buffers(Arena &arena) {
    const Parts a(arena);
    arhost_geometry *g = a.geometries;
    return {&a.scene.geometries, &a.scene.materials, &a.scene.objects, &a.scene.lights, &a.scene.names,
            &g[0].positions,     &g[0].normals,      &g[0].texcoords,  &g[0].indices,   &g[1].positions};
}

} // namespace

TEST(ArenaBuilder, WritesAllInput) {
    ArenaBuilder builder = small_scene();
    builder.settings = {ARHOST_AXES_Y_UP, 7, glm::vec3(0.1f, 0.2f, 0.3f), glm::vec3(0.4f), 0.5f, 0.25f};
    EXPECT_EQ(builder.triangle_count(), 2u);
    EXPECT_EQ(builder.object_count(), 2u);
    const std::size_t size = builder.byte_size();
    Arena arena = build(std::move(builder));

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

    const Parts parts(arena);
    const TriangleMesh mesh = square();
    EXPECT_EQ(std::memcmp(parts.positions(), mesh.positions.data(), 48), 0);
    EXPECT_EQ(std::memcmp(parts.normals(), mesh.normals.data(), 48), 0);
    EXPECT_EQ(std::memcmp(parts.texcoords(), mesh.texcoords.data(), 32), 0);
    EXPECT_EQ(std::memcmp(parts.indices(), mesh.triangles.data(), 24), 0);
    EXPECT_EQ(parts.ball()[3], 7);
    EXPECT_EQ(parts.materials[0].diffuse[1], 0.5f);
    EXPECT_EQ(parts.lights[0].position[2], 300);
    EXPECT_STREQ(parts.names + parts.objects[0].name, "square");
    EXPECT_STREQ(parts.names + parts.objects[1].name, "ball");
    EXPECT_EQ(parts.objects[1].role, ARHOST_ROLE_CATCHER);
    EXPECT_THAT(parts.objects[0].world_from_object, testing::ElementsAre(1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0));
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
    const Arena arena = build(std::move(builder));
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
    Arena arena = build(std::move(builder));
    EXPECT_EQ(Parts(arena).objects[0].world_from_object[9], 5);
    EXPECT_EQ(arena.scene().bounds_min[0], 4);
    EXPECT_EQ(arena.scene().bounds_max[0], 6);
}

TEST(ArenaBuilder, WritesTexturesEnvironmentAndMotion) {
    ArenaBuilder builder = full_scene();
    const std::size_t size = builder.byte_size();
    Arena arena = build(std::move(builder));
    const Parts parts(arena);
    const arhost_scene &scene = parts.scene;
    EXPECT_EQ(scene.byte_size, size);
    EXPECT_EQ(scene.textures.count, 2u);
    EXPECT_EQ(parts.images[0].height, 3u);
    EXPECT_EQ(parts.all<std::uint8_t>(parts.images[0].texels)[23], 200);
    EXPECT_STREQ(parts.names + parts.images[0].name, "wood.png");
    EXPECT_EQ(parts.floats(scene.environment.columns)[2], 0.25f);
    EXPECT_EQ(scene.environment.environment_from_world[8], 1);
    EXPECT_EQ(scene.nodes.count, 4u);
    EXPECT_EQ(scene.channels.count, 4u);
    EXPECT_EQ(scene.skins.count, 1u);
    EXPECT_EQ(parts.geometries[2].morph_positions.count, 4u);
}

struct Corruption {
    const char *field;
    std::function<void(Parts)> corrupt;
    const char *message;
};

std::string name_of(const testing::TestParamInfo<Corruption> &info) {
    return info.param.field;
}

class Rejects : public testing::TestWithParam<Corruption> {};

TEST_P(Rejects, Field) {
    Arena arena = build(small_scene());
    GetParam().corrupt(Parts(arena));
    EXPECT_THAT(validate(arena.bytes()), HasSubstr(GetParam().message));
}

const Corruption faults_of_small_scene[] = {
    {"Magic", [](Parts a) { a.scene.magic ^= 1; }, "magic number"},
    {"Version", [](Parts a) { a.scene.version = 1; }, "version is 1, not 6"},
    {"StructSize", [](Parts a) { a.scene.struct_size += 8; }, "the struct_size of its header is wrong"},
    {"ByteSizeTooLarge", [](Parts a) { a.scene.byte_size += 64; }, "bytes, but"},
    {"ByteSizeHuge", [](Parts a) { a.scene.byte_size = ~0ull; }, "bytes, but"},
    {"ByteSizeTooSmall", [](Parts a) { a.scene.byte_size = 8; }, "bytes, but"},
    {"ByteSizeCutsTheLastBuffer", [](Parts a) { a.scene.byte_size -= 64; }, "extends past the end"},
    {"Axes", [](Parts a) { a.scene.axes = 0; }, "its value of 'axes' is unknown"},
    {"MaxDepth", [](Parts a) { a.scene.max_depth = 101; }, "max_depth is 101, more than 100"},
    {"Ambient", [](Parts a) { a.scene.ambient[1] = NAN; }, "the ambient light is nan"},
    {"Background", [](Parts a) { a.scene.background[2] = -1; }, "the background is -1"},
    {"ShadowAlphaOpaque", [](Parts a) { a.scene.shadow_alpha_opaque = 1.5f; }, "shadow_alpha_opaque is 1.5"},
    {"ShadowAlphaTranslucent", [](Parts a) { a.scene.shadow_alpha_translucent = NAN; },
     "shadow_alpha_translucent is nan"},
    {"BoundsNotFinite", [](Parts a) { a.scene.bounds_min[0] = NAN; }, "bounds_min is nan"},
    {"BoundsInverted", [](Parts a) { a.scene.bounds_min[0] = 11; }, "bounds_min is above bounds_max"},
    {"BoundsTooSmall", [](Parts a) { a.scene.bounds_max[2] = 20; }, "object 1 'ball' is outside the scene's bounds"},
    {"GeometryTableStride", [](Parts a) { a.scene.geometries.stride = 8; },
     "the table of geometries has a stride of 8 bytes"},
    {"MaterialTableCount", [](Parts a) { a.scene.materials.count = 0xffffffff; },
     "the table of materials extends past the end"},
    {"ObjectTableOffset", [](Parts a) { a.scene.objects.offset += 4; },
     "the table of objects is not aligned to 64 bytes"},
    {"LightTableOffsetHuge", [](Parts a) { a.scene.lights.offset = ~0ull & ~63ull; },
     "the table of lights extends past the end"},
    {"NamesOverHeader", [](Parts a) { a.scene.names.offset = 64; }, "the table of names overlaps the header"},
    {"NamesNotTerminated", [](Parts a) { a.names[a.scene.names.count - 1] = 'x'; },
     "the last name has no terminating zero"},
    {"NameWithEscape", [](Parts a) { a.names[0] = '\033'; }, "control character"},
    {"AbsentBufferWithOffset",
     [](Parts a) {
         a.scene.lights = arhost_buffer{64, 0, 0};
     },
     "is absent, but"},
    {"ObjectName", [](Parts a) { a.objects[1].name = a.scene.names.count; }, "name of object 1 is outside"},
    {"ObjectGeometry", [](Parts a) { a.objects[0].geometry = 2; },
     "object 0 'square' refers to geometry 2, but the scene has only 2"},
    {"ObjectMaterial", [](Parts a) { a.objects[1].material = ARHOST_NONE; },
     "object 1 'ball' refers to material 4294967295, but the scene has only 1"},
    {"ObjectRole", [](Parts a) { a.objects[1].role = 4; }, "object 1 'ball' has an unknown role"},
    {"ObjectTransformNotFinite", [](Parts a) { a.objects[0].world_from_object[11] = NAN; },
     "object 0 'square': an element of world_from_object is nan"},
    {"ObjectTransformFlat", [](Parts a) { a.objects[0].world_from_object[4] = 0; },
     "world_from_object cannot be inverted"},
    {"MaterialModel", [](Parts a) { a.materials[0].model = 8; }, "material 0: its model is unknown"},
    {"MaterialTexture", [](Parts a) { a.materials[0].colour_texture = 0; }, "texture 0, but the scene has only 0"},
    {"MaterialIndex", [](Parts a) { a.materials[0].index = 0.5f; }, "index is 0.5, outside 1 to 4"},
    {"MaterialExtinction", [](Parts a) { a.materials[0].extinction[1] = -1; }, "extinction is -1"},
    {"MaterialFresnel", [](Parts a) { a.materials[0].fresnel_maximum = 0; }, "fresnel_maximum is 0"},
    {"MaterialEmission", [](Parts a) { a.materials[0].emission[2] = NAN; }, "emission is"},
    {"MaterialRoughness", [](Parts a) { a.materials[0].roughness = 2; }, "roughness is 2"},
    {"MaterialOpacity", [](Parts a) { a.materials[0].opacity = 1.5f; }, "opacity is 1.5"},
    {"MaterialTransmission", [](Parts a) { a.materials[0].transmission = 2; }, "transmission is 2"},
    {"MaterialClearcoat", [](Parts a) { a.materials[0].clearcoat = -1; }, "clearcoat is -1"},
    {"MaterialNormalScale", [](Parts a) { a.materials[0].normal_scale = INFINITY; }, "normal_scale is inf"},
    {"ObjectReserved", [](Parts a) { a.objects[1].reserved = 1; }, "object 1 'ball': a reserved field is not 0"},
    {"MaterialAmbient", [](Parts a) { a.materials[0].ambient[0] = 2; }, "material 0: ambient is 2, outside 0 to 1"},
    {"MaterialDiffuse", [](Parts a) { a.materials[0].diffuse[0] = -0.1f; }, "diffuse is -0.1"},
    {"MaterialSpecular", [](Parts a) { a.materials[0].specular[2] = NAN; }, "specular is nan"},
    {"MaterialExponent", [](Parts a) { a.materials[0].exponent = 0.5f; }, "exponent is 0.5"},
    {"MaterialReflectivity", [](Parts a) { a.materials[0].reflectivity[2] = 1.1f; }, "reflectivity is 1.1"},
    {"LightType", [](Parts a) { a.lights[0].type = 6; }, "light 0: its type is unknown"},
    {"LightDirection",
     [](Parts a) {
         a.lights[0].type = ARHOST_LIGHT_SPOT;
         a.lights[0].direction[2] = 0.5f;
     },
     "its direction is not of length 1"},
    {"DirectionalLightWithFalloff",
     [](Parts a) {
         a.lights[0].type = ARHOST_LIGHT_DIRECTIONAL;
         a.lights[0].falloff = ARHOST_FALLOFF_INVERSE_SQUARE;
     },
     "cannot have a falloff"},
    {"LightCone", [](Parts a) { a.lights[0].cosine_outer = 0.5f; }, "cosine_inner is 0"},
    {"LightRadius", [](Parts a) { a.lights[0].radius = -1; }, "radius is -1"},
    {"LightFalloff", [](Parts a) { a.lights[0].falloff = 0; }, "light 0: its falloff is unknown"},
    {"LightPosition", [](Parts a) { a.lights[0].position[0] = -NAN; }, "light 0: position is"},
    {"LightIntensity", [](Parts a) { a.lights[0].intensity[0] = INFINITY; }, "light 0: intensity is inf"},
};
INSTANTIATE_TEST_SUITE_P(Validate, Rejects, testing::ValuesIn(faults_of_small_scene), name_of);

const Corruption faults_of_geometry[] = {
    {"GeometryType", [](Parts a) { a.geometries[0].type = 3; },
     "geometry 0 (object 0 'square'): its type is unknown"},
    {"GeometryReserved", [](Parts a) { a.geometries[0].reserved = 1; }, "reserved field"},
    {"TrianglesAsSpheres", [](Parts a) { a.geometries[0].type = ARHOST_GEOMETRY_SPHERES; },
     "stride of 12 bytes, not 16"},
    {"PositionsCount", [](Parts a) { a.geometries[0].positions.count = 100000; },
     "the buffer of positions extends past the end"},
    {"NormalsCount", [](Parts a) { a.geometries[0].normals.count = 3; }, "it has 3 normals for 4 vertices"},
    {"TexcoordsCount", [](Parts a) { a.geometries[0].texcoords.count = 3; }, "it has 3 texcoords for 4 vertices"},
    {"ColoursCount",
     [](Parts a) {
         a.geometries[0].colours = {a.geometries[0].normals.offset, 3, 8};
     },
     "it has 3 colours for 4 vertices"},
    {"NoTriangles", [](Parts a) { a.geometries[0].indices = {}; },
     "geometry 0 (object 0 'square'): it has no triangles"},
    {"NoVertices",
     [](Parts a) { a.geometries[0].positions = a.geometries[0].normals = a.geometries[0].texcoords = {}; },
     "triangle 0 refers to vertex 2, but the mesh has only 0"},
    {"Index", [](Parts a) { a.indices()[5] = 4; },
     "geometry 0 (object 0 'square'): triangle 1 refers to vertex 4, but the mesh has only 4"},
    {"IndexHuge", [](Parts a) { a.indices()[0] = ARHOST_NONE; }, "triangle 0 refers to vertex 4294967295"},
    {"PositionNotANumber", [](Parts a) { a.positions()[10] = NAN; }, "vertex 3 has the invalid coordinate nan"},
    {"PositionInfinite", [](Parts a) { a.positions()[0] = -INFINITY; }, "vertex 0 has the invalid coordinate -inf"},
    {"PositionTooFar", [](Parts a) { a.positions()[3] = 1.1e9f; }, "vertex 1 has the invalid coordinate 1.1e+09"},
    {"NormalLength", [](Parts a) { a.normals()[5] = 0.9f; }, "normal 1 is not of unit length"},
    {"NormalNotANumber", [](Parts a) { a.normals()[11] = NAN; }, "normal 3 is not of unit length"},
    {"TexcoordNotANumber", [](Parts a) { a.texcoords()[4] = NAN; }, "texcoord 2 has the invalid coordinate nan"},
    {"SphereRadiusZero", [](Parts a) { a.ball()[3] = 0; },
     "geometry 1 (object 1 'ball'): sphere 0 has the invalid radius 0"},
    {"SphereNotANumber", [](Parts a) { a.ball()[1] = NAN; }, "sphere 0 has the invalid coordinate nan"},
    {"SpheresWithIndices",
     [](Parts a) {
         a.geometries[1].indices = arhost_buffer{0, 0, 12};
     },
     "spheres cannot have normals, texcoords, tangents, colours, indices"},
    {"PositionsOverHeader", [](Parts a) { a.geometries[0].positions.offset = 0; }, "overlaps the header"},
    {"NoSpheres", [](Parts a) { a.geometries[1].positions = {}; }, "it has no spheres"},
};
INSTANTIATE_TEST_SUITE_P(ValidateGeometry, Rejects, testing::ValuesIn(faults_of_geometry), name_of);

TEST(Validate, RequiresSixteenReadableBytesAfterTheLastBuffer) {
    Arena arena = small_scene().build();
    arhost_scene &scene = Parts(arena).scene;
    const arhost_buffer &last = scene.geometries;
    const std::uint64_t end = last.offset + std::uint64_t(last.count) * last.stride;
    scene.byte_size = end + 16;
    EXPECT_EQ(validate(arena.bytes()), "");
    scene.byte_size = end + 15;
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
    Arena arena = build(full_scene());
    GetParam().corrupt(Parts(arena));
    EXPECT_THAT(validate(arena.bytes()), HasSubstr(GetParam().message));
}

const Corruption faults_of_textures[] = {
    {"Format", [](Parts a) { a.images[0].format = 4; }, "image 0: its format is unknown"},
    {"FormatOfOtherSize", [](Parts a) { a.images[0].format = ARHOST_TEXEL_RGBA32F; },
     "image 0: the buffer of texels has a stride of 4 bytes, not 16"},
    {"Image", [](Parts a) { a.textures[0].image = 2; }, "texture 0: it refers to image 2, but the scene has only 2"},
    {"Filter", [](Parts a) { a.textures[0].filter = 3; }, "texture 0: its filter is unknown"},
    {"Transform", [](Parts a) { a.textures[0].image_from_texcoord[5] = NAN; }, "image_from_texcoord is nan"},
    {"TexcoordSet", [](Parts a) { a.textures[0].texcoord_set = 1; },
     "object 0 'square' has a material with a texture of texcoord set 1, but its geometry has no such set"},
    {"WrapU", [](Parts a) { a.textures[0].wrap_u = 0; }, "its wrap mode is unknown"},
    {"WrapV", [](Parts a) { a.textures[1].wrap_v = 4; }, "texture 1: its wrap mode"},
    {"Name", [](Parts a) { a.images[1].name = a.scene.names.count; }, "outside the table of names"},
    {"Width", [](Parts a) { a.images[0].width = 0; }, "has 0 x 3 texels; each side must have 1 to 16384"},
    {"Height", [](Parts a) { a.images[0].height = 16385; }, "2 x 16385 texels"},
    {"TexelCount", [](Parts a) { a.images[0].height = 2; }, "has 6 texels for 2 x 2"},
    {"TexelNotANumber", [](Parts a) { a.floats(a.images[1].texels)[5] = NAN; },
     "image 1: texel 1 has the invalid value nan"},
    {"TexelBelowZero", [](Parts a) { a.floats(a.images[1].texels)[15] = -1; }, "texel 3 has the invalid value -1"},
    {"TexelTooBright", [](Parts a) { a.floats(a.images[1].texels)[0] = 1.1e6f; },
     "texel 0 has the invalid value 1.1e+06"},
    {"MaterialsTexture", [](Parts a) { a.materials[0].normal_texture = 2; },
     "material 0: it refers to texture 2, but the scene has only 2"},
    {"TextureWithoutTexcoords", [](Parts a) { a.objects[1].material = 0; },
     "object 1 'ball' has a material with a texture of texcoord set 0, but its geometry has no such set"},
    {"Environment", [](Parts a) { a.scene.environment.texture = 2; },
     "the environment refers to texture 2, but the scene has only 2"},
    {"EnvironmentOfBytes", [](Parts a) { a.scene.environment.texture = 0; }, "is not RGBA32F"},
    {"EnvironmentMissing", [](Parts a) { a.scene.environment.texture = ARHOST_NONE; },
     "there is no environment, but"},
    {"EnvironmentIntensity", [](Parts a) { a.scene.environment.intensity = NAN; },
     "the environment's intensity is nan"},
    {"EnvironmentScaled", [](Parts a) { a.scene.environment.environment_from_world[4] = 0.9f; },
     "environment_from_world is not a rotation"},
    {"EnvironmentMirrored", [](Parts a) { a.scene.environment.environment_from_world[8] = -1; },
     "environment_from_world is not a rotation"},
    {"EnvironmentRotationNotANumber", [](Parts a) { a.scene.environment.environment_from_world[2] = NAN; }, "is nan"},
    {"Rows", [](Parts a) { a.scene.environment.rows.count = 1; }, "has 1 rows and 4 columns"},
    {"Columns", [](Parts a) { a.scene.environment.columns.count = 2; }, "has 2 rows and 2 columns"},
    {"RowsFall", [](Parts a) { a.floats(a.scene.environment.rows)[0] = 1.5f; }, "rows are not cumulative sums"},
    {"RowsNotANumber", [](Parts a) { a.floats(a.scene.environment.rows)[0] = NAN; }, "rows are not cumulative sums"},
    {"ColumnsBelowZero", [](Parts a) { a.floats(a.scene.environment.columns)[2] = -0.1f; },
     "columns are not cumulative sums"},
    {"ColumnsEnd", [](Parts a) { a.floats(a.scene.environment.columns)[3] = 0.9f; }, "columns end at 0.9, not at 1"},
};
INSTANTIATE_TEST_SUITE_P(Textures, RejectsInFullScene, testing::ValuesIn(faults_of_textures), name_of);

const Corruption faults_of_motion[] = {
    {"Duration", [](Parts a) { a.scene.duration_s = NAN; }, "duration_s is nan"},
    {"NoDuration",
     [](Parts a) {
         a.scene.duration_s = 0;
         a.scene.anchors = {};
     },
     "object 1 'ball' moves or deforms, but the scene has no anchors and its duration_s is 0"},
    {"AnchorNode", [](Parts a) { a.anchors[0].node = 9; }, "anchor 0: it refers to node 9, but the scene has only"},
    {"AnchorWithParent", [](Parts a) { a.nodes[a.anchors[0].node].parent = 0; },
     "anchor 0: its node has a parent or is animated"},
    {"AnchorAnimated", [](Parts a) { a.nodes[a.anchors[0].node].animated = 1; },
     "anchor 0: its node has a parent or is animated"},
    {"AnchorName", [](Parts a) { a.anchors[0].target = 1'000'000; },
     "anchor 0: its name is outside the table of names"},
    {"ObjectNode", [](Parts a) { a.objects[1].node = 4; }, "refers to node 4, but the scene has only 4"},
    {"ObjectWithoutNode", [](Parts a) { a.objects[1].node = ARHOST_NONE; }, "refers to node 4294967295"},
    {"ObjectSkin", [](Parts a) { a.objects[2].skin = 1; },
     "object 2 'bend' refers to skin 1, but the scene has only 1"},
    {"NodeOfStaticObject", [](Parts a) { a.objects[0].node = 0; }, "but neither moves nor deforms"},
    {"SkinnedMoves", [](Parts a) { a.objects[2].moves = 1; }, "has a skin; it must therefore set deforms, not moves"},
    {"SkinnedWithTransform", [](Parts a) { a.objects[2].world_from_object[9] = 1; },
     "world_from_object must be the identity"},
    {"SpheresDeform", [](Parts a) { a.objects[1].deforms = 1; }, "deforms, but its geometry is not a triangle mesh"},
    {"DeformingShared",
     [](Parts a) {
         a.objects[0].geometry = 2;
         a.objects[0].material = 1;
     },
     "object 2 'bend' deforms geometry 2, which another object uses too"},
    {"DeformsWithNothing",
     [](Parts a) {
         a.objects[1].geometry = 0;
         a.objects[1].deforms = 1;
         a.objects[0].geometry = 1;
         a.objects[0].material = 1;
     },
     "it deforms, but has neither a skin nor morph targets"},
    {"JointsOfStaticGeometry", [](Parts a) { a.geometries[0].joints = a.geometries[2].joints; },
     "has 4 joints and 0 weights for 4 vertices without a skin"},
    {"JointCount", [](Parts a) { a.geometries[2].joints.count = 3; }, "3 joints and 4 weights"},
    {"WeightCount", [](Parts a) { a.geometries[2].weights.count = 3; }, "4 joints and 3 weights"},
    {"SkinWithoutVertices", [](Parts a) { a.geometries[2].positions = {}; },
     "4 joints and 4 weights for 0 vertices with a skin"},
    {"JointIndex", [](Parts a) { a.all<std::uint16_t>(a.geometries[2].joints)[15] = 2; },
     "vertex 3 refers to joint 2, but the skin has only 2 joints"},
    {"WeightSum", [](Parts a) { a.floats(a.geometries[2].weights)[4] = 0.9f; },
     "vertex 1 has invalid joint weights; they must not be negative, and their sum must be 1"},
    {"WeightNotANumber", [](Parts a) { a.floats(a.geometries[2].weights)[3] = NAN; },
     "vertex 0 has invalid joint weights"},
    {"WeightBelowZero",
     [](Parts a) {
         a.floats(a.geometries[2].weights)[0] = 1.5f;
         a.floats(a.geometries[2].weights)[1] = -0.5f;
     },
     "vertex 0 has invalid joint weights"},
    {"MorphPositionCount", [](Parts a) { a.geometries[2].morph_positions.count = 3; },
     "has 3 morph_positions for 1 targets and 4 vertices"},
    {"MorphNormalCount", [](Parts a) { a.geometries[2].morph_normals.count = 3; }, "3 morph_normals"},
    {"MorphPosition", [](Parts a) { a.floats(a.geometries[2].morph_positions)[4] = NAN; },
     "morph position 1 has the invalid coordinate nan"},
    {"MorphNormal", [](Parts a) { a.floats(a.geometries[2].morph_normals)[0] = 2e9f; },
     "morph normal 0 has the invalid coordinate 2e+09"},
    {"NodeParent", [](Parts a) { a.nodes[1].parent = 1; }, "node 1: its parent 1 does not precede"},
    {"NodeTransform", [](Parts a) { a.nodes[1].parent_from_node[3] = NAN; }, "parent_from_node is nan"},
    {"NodeTranslation", [](Parts a) { a.nodes[0].translation[0] = 2e9f; }, "translation is 2e+09"},
    {"NodeRotation", [](Parts a) { a.nodes[0].rotation[3] = 0.5f; }, "rotation is not of length 1"},
    {"NodeRotationNotANumber", [](Parts a) { a.nodes[0].rotation[0] = NAN; }, "rotation is nan"},
    {"NodeScale", [](Parts a) { a.nodes[0].scale[2] = NAN; }, "scale is nan"},
    {"NodeWeight", [](Parts a) { a.floats(a.nodes[2].morph_weights)[0] = NAN; }, "a morph weight is nan"},
    {"ChannelNode", [](Parts a) { a.channels[0].node = 4; }, "channel 0: it refers to node 4"},
    {"ChannelNodeNotAnimated", [](Parts a) { a.channels[0].node = 1; }, "its node is not animated"},
    {"ChannelTarget", [](Parts a) { a.channels[0].target = 5; }, "its target is unknown"},
    {"ChannelInterpolation", [](Parts a) { a.channels[0].interpolation = 0; }, "its interpolation is unknown"},
    {"ChannelPeriod", [](Parts a) { a.channels[0].period_s = -1; }, "period_s is -1"},
    {"ChannelWithoutKeys", [](Parts a) { a.channels[2].times = a.channels[2].values = {}; },
     "channel 2: it has no keys"},
    {"ChannelTimes", [](Parts a) { a.floats(a.channels[0].times)[1] = 0; }, "its times are not strictly increasing"},
    {"ChannelTimeNotANumber", [](Parts a) { a.floats(a.channels[0].times)[0] = NAN; }, "a time is nan"},
    {"ChannelTimeBelowZero", [](Parts a) { a.floats(a.channels[0].times)[0] = -1; }, "a time is -1"},
    {"ChannelValueCount", [](Parts a) { a.channels[0].values.count = 5; },
     "has 5 values for 2 keys with 3 components each"},
    {"ChannelOfOtherWidth", [](Parts a) { a.channels[0].target = ARHOST_CHANNEL_ROTATION; },
     "has 6 values for 2 keys with 4 components each"},
    {"ChannelWithoutWeights", [](Parts a) { a.channels[3].node = 1; }, "keys with 0 components each"},
    {"ChannelCubicTooShort", [](Parts a) { a.channels[0].interpolation = ARHOST_INTERPOLATION_CUBIC; },
     "has 6 values for 2 keys with 3 components each"},
    {"ChannelValue", [](Parts a) { a.floats(a.channels[3].values)[2] = NAN; }, "a value is nan"},
    {"ChannelRotation", [](Parts a) { a.floats(a.channels[1].values)[7] = 1; },
     "the rotation of key 1 is not of length 1"},
    {"SkinJoint", [](Parts a) { a.all<std::uint32_t>(a.skins[0].joints)[1] = 4; },
     "skin 0: it refers to node 4, but the scene has only 4"},
    {"SkinWithoutJoints", [](Parts a) { a.skins[0].joints = {}; }, "has 0 joints and 2 matrices"},
    {"SkinMatrixCount", [](Parts a) { a.skins[0].node_from_mesh.count = 1; }, "2 joints and 1 matrices"},
    {"SkinMatrix", [](Parts a) { a.floats(a.skins[0].node_from_mesh)[0] = NAN; }, "node_from_mesh is nan"},
};
INSTANTIATE_TEST_SUITE_P(Motion, RejectsInFullScene, testing::ValuesIn(faults_of_motion), name_of);

// If buffers could be shared, checking a small arena could keep the host busy for hours.
TEST(Validate, RejectsGeometriesThatShareABuffer) {
    ArenaBuilder builder;
    const std::uint32_t material = builder.add_material(grey());
    for (int i = 0; i < 1000; ++i)
        builder.add_object("square", builder.add_triangles(square()), material);
    Spheres many(1000, glm::vec4(0, 0, 0, 1));
    builder.add_object("spheres", builder.add_spheres(many), material);
    Arena arena = build(std::move(builder));
    for (int i = 0; i < 1000; ++i)
        Parts(arena).geometries[i] = Parts(arena).geometries[1000];
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
        Parts(arena).objects[i].name = 0;
    Parts(arena).objects[9'999].role = 0;
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
