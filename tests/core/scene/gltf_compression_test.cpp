// SPDX-License-Identifier: Apache-2.0
//
// Compressed meshes and images, written by the encoders of the same libraries.
#include "gltf_samples.hpp"
#include "image_samples.hpp"
#include "scene/motion.hpp"

#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#include <draco/point_cloud/point_cloud_builder.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <array>
#include <cmath>
#include <set>

using namespace arhost::scene;
using namespace arhost::scene::test;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

namespace {

template <class T> std::string bytes_of(const std::vector<T> &values) {
    return {reinterpret_cast<const char *>(values.data()), values.size() * sizeof(T)};
}

// ---- EXT_meshopt_compression ----

struct Compressed {
    std::string bytes, mode, filter;
    std::size_t count, stride;
};

Compressed vertices(const std::string &data, std::size_t stride, const std::string &filter = "NONE") {
    const std::size_t count = data.size() / stride;
    std::string bytes(meshopt_encodeVertexBufferBound(count, stride), '\0');
    bytes.resize(meshopt_encodeVertexBuffer(reinterpret_cast<unsigned char *>(bytes.data()), bytes.size(),
                                            data.data(), count, stride));
    return {bytes, "ATTRIBUTES", filter, count, stride};
}

Compressed corners(const std::string &mode, const std::vector<unsigned> &indices, std::size_t stride) {
    std::string bytes(1000, '\0');
    auto *to = reinterpret_cast<unsigned char *>(bytes.data());
    bytes.resize(mode == "TRIANGLES" ? meshopt_encodeIndexBuffer(to, bytes.size(), indices.data(), indices.size())
                                     : meshopt_encodeIndexSequence(to, bytes.size(), indices.data(), indices.size()));
    return {bytes, mode, "NONE", indices.size(), stride};
}

// Adds a compressed view. Its buffer 1 has no data; readers without a decoder would need it. Returns its index.
int add(Gltf &gltf, const Compressed &data, int view_stride = 0) {
    gltf.view(data.bytes);
    const std::size_t start = gltf.bytes.size() - data.bytes.size();
    const std::string size = std::to_string(data.count * data.stride);
    gltf.more_buffers = R"(, {"byteLength": 1000000, "extensions": {"EXT_meshopt_compression": {"fallback": true}}})";
    gltf.views += R"(,{"buffer": 1, "byteLength": )" + size +
                  (view_stride ? R"(, "byteStride": )" + std::to_string(view_stride) : "") +
                  R"(, "extensions": {"EXT_meshopt_compression": {"buffer": 0, "byteOffset": )" +
                  std::to_string(start) + R"(, "byteLength": )" + std::to_string(data.bytes.size()) +
                  R"(, "byteStride": )" + std::to_string(data.stride) + R"(, "count": )" +
                  std::to_string(data.count) + R"(, "mode": ")" + data.mode + R"(", "filter": ")" + data.filter +
                  "\"}}}";
    return ++gltf.view_count - 1;
}

const std::vector<float> four_positions = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};

// Returns a square of two triangles.
Gltf meshopt_square(const std::string &mode, std::size_t index_size) {
    Gltf gltf;
    gltf.accessor(add(gltf, vertices(bytes_of(four_positions), 12)), 5126, 4, "VEC3");
    gltf.accessor(add(gltf, corners(mode, {0, 1, 2, 0, 2, 3}, index_size)), index_size == 2 ? 5123 : 5125, 6,
                  "SCALAR");
    gltf.meshes = R"({"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]})";
    gltf.more = R"(, "extensionsRequired": ["EXT_meshopt_compression"])";
    return gltf;
}

std::vector<glm::uvec3> triangles(const Arena &arena) {
    const auto *all = elements<glm::uvec3>(arena, geometry(arena).indices);
    return {all, all + geometry(arena).indices.count};
}

// ---- KHR_draco_mesh_compression ----

// A grid of `side` × `side` squares with the attributes 0, positions, and 1, colours with the x and y of each vertex.
struct DracoSample {
    draco::Encoder encoder;
    std::unique_ptr<draco::Mesh> mesh;

    explicit DracoSample(int side, int method = draco::MESH_EDGEBREAKER_ENCODING) {
        draco::TriangleSoupMeshBuilder builder;
        builder.Start(2 * side * side);
        const int position = builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
        const int colour = builder.AddAttribute(draco::GeometryAttribute::COLOR, 3, draco::DT_UINT8);
        for (int face = 0; face < 2 * side * side; ++face) {
            const int x = face / 2 % side, y = face / 2 / side;
            const auto add = [&]<class T>(int attribute, T) {
                const std::array<T, 3> a{T(x), T(y)}, b{T(x + 1), T(y)}, c{T(x + 1), T(y + 1)}, d{T(x), T(y + 1)};
                builder.SetAttributeValuesForFace(attribute, draco::FaceIndex(face), &a, face % 2 ? &c : &b,
                                                  face % 2 ? &d : &c);
            };
            add(position, 0.f);
            add(colour, std::uint8_t());
        }
        mesh = builder.Finalize();
        encoder.SetEncodingMethod(method);
    }
    std::string encoded() {
        draco::EncoderBuffer buffer;
        EXPECT_TRUE(encoder.EncodeMeshToBuffer(*mesh, &buffer).ok());
        return {buffer.data(), buffer.size()};
    }
};

const std::string draco_start = "DRACO\2\2\1"; // version 2.2, a mesh

// Returns a file whose accessors have no data except in `bytes`.
Gltf draco_file(const std::string &bytes, int vertex_count = 4) {
    Gltf gltf;
    const std::string view = std::to_string(gltf.view(bytes));
    gltf.accessor(-1, 5126, vertex_count, "VEC3");
    gltf.accessor(-1, 5121, vertex_count, "VEC3", R"(, "normalized": true)");
    gltf.accessor(-1, 5125, 6, "SCALAR");
    gltf.meshes = R"({"primitives": [{"attributes": {"POSITION": 0, "COLOR_0": 1}, "indices": 2, "extensions": {
        "KHR_draco_mesh_compression": {"bufferView": )" +
                  view + R"(, "attributes": {"POSITION": 0, "COLOR_0": 1}}}}]})";
    gltf.more = R"(, "extensionsRequired": ["KHR_draco_mesh_compression"])";
    return gltf;
}

void replace(std::string &in, const std::string &what, const std::string &by) {
    ASSERT_NE(in.find(what), in.npos) << what;
    in.replace(in.find(what), what.size(), by);
}

} // namespace

TEST(Meshopt, DecodesTrianglesIndicesAndAttributes) {
    for (const char *mode : {"TRIANGLES", "INDICES"})
        for (const std::size_t index_size : {2u, 4u}) {
            SCOPED_TRACE(mode + std::to_string(index_size));
            const Gltf gltf = meshopt_square(mode, index_size);
            for (const auto &[text, name] : {std::pair(gltf.text(), "a.gltf"), {gltf.binary(), "a.glb"}}) {
                const Arena arena = load(text, "", "y-up", name).arena;
                EXPECT_THAT(vertex(arena, 2), ElementsAre(1, 1, 0));
                ASSERT_EQ(triangles(arena).size(), 2u);
                const glm::uvec3 last = triangles(arena)[1]; // the encoder rotates triangles
                EXPECT_EQ((std::set{last.x, last.y, last.z}), (std::set{0u, 2u, 3u}));
            }
        }
}

TEST(Meshopt, DecodesTheFiltersOfNormalsRotationsAndFloats) {
    const std::vector<float> normals = {0, 0, 1, 0, 0.6f, 0, 0.8f, 0, 0, -0.6f, -0.8f, 0};
    for (const bool is_byte : {true, false}) {
        Gltf gltf;
        std::vector<float> positions(9);
        meshopt_encodeFilterExp(positions.data(), 3, 12, 24,
                                std::vector<float>{0, 0, 0, 1.25f, 0, 0, 0, 3, 0}.data());
        gltf.accessor(add(gltf, vertices(bytes_of(positions), 12, "EXPONENTIAL")), 5126, 3, "VEC3");
        std::string packed(is_byte ? 12 : 24, '\0');
        meshopt_encodeFilterOct(packed.data(), 3, is_byte ? 4 : 8, is_byte ? 8 : 12, normals.data());
        const int stride = is_byte ? 4 : 8;
        gltf.accessor(add(gltf, vertices(packed, std::size_t(stride), "OCTAHEDRAL"), stride), is_byte ? 5120 : 5122,
                      3, "VEC3", R"(, "normalized": true)");
        gltf.meshes = R"({"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1}}]})";
        const Arena arena = load(gltf.text()).arena;
        EXPECT_THAT(vertex(arena, 1), ElementsAre(1.25f, 0, 0));
        EXPECT_THAT(vertex(arena, 2), ElementsAre(0, 3, 0));
        const float *n = elements<float>(arena, geometry(arena).normals);
        for (std::size_t v = 0; v < 3; ++v)
            for (std::size_t i = 0; i < 3; ++i)
                EXPECT_NEAR(n[3 * v + i], normals[4 * v + i], is_byte ? 0.02 : 0.002);
    }
    Gltf gltf = triangle();
    const std::vector<float> turns = {0, 0, 0, 1, 0, 0, std::sqrt(0.5f), std::sqrt(0.5f)};
    std::string packed(16, '\0');
    meshopt_encodeFilterQuat(packed.data(), 2, 8, 16, turns.data());
    gltf.floats({0, 1}, "SCALAR", 1);
    gltf.accessor(add(gltf, vertices(packed, 8, "QUATERNION")), 5122, 2, "VEC4", R"(, "normalized": true)");
    gltf.more = R"(, "animations": [{"samplers": [{"input": 2, "output": 3}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "rotation"}}]}])";
    const Arena arena = load(gltf.text(), ", animation: 0, loop: false").arena;
    MotionEvaluator evaluator(arena.scene());
    EXPECT_NEAR(evaluator.at(1).moved[0].world_from_object[1], 1, 1e-3) << "turned by 90 degrees";
}

TEST(Meshopt, RefusesMalformedDataWithTheirPath) {
    const auto error = [](const std::string &what, const std::string &by, bool is_index = false) {
        Gltf gltf = meshopt_square("TRIANGLES", 4);
        std::size_t at = is_index ? gltf.views.rfind("{\"buffer\": 1") : 0;
        at = gltf.views.find(what, at);
        EXPECT_NE(at, std::string::npos) << what;
        gltf.views.replace(at, what.size(), by);
        return error_of(gltf.text());
    };
    const std::string of_vertices = "a.gltf: bufferViews[1].extensions.EXT_meshopt_compression",
                      of_indices = "a.gltf: bufferViews[3].extensions.EXT_meshopt_compression";
    EXPECT_THAT(error(R"("byteStride": 12)", R"("byteStride": 10)"),
                HasSubstr(of_vertices + ".byteStride: must be a multiple of 4"));
    EXPECT_THAT(error(R"("byteStride": 12)", R"("byteStride": 260)"),
                HasSubstr(of_vertices + ".byteStride: must be a whole number from 1 to 256"));
    EXPECT_THAT(error(R"("byteStride": 4)", R"("byteStride": 3)", true),
                HasSubstr(of_indices + ".byteStride: must be 2 or 4"));
    EXPECT_THAT(error(R"("count": 6)", R"("count": 5)", true),
                HasSubstr(of_indices + ".count: must be a multiple of 3"));
    Gltf corrupt = meshopt_square("TRIANGLES", 4);
    corrupt.bytes[0] = 0;
    EXPECT_THAT(error_of(corrupt.text()), HasSubstr(of_vertices + ": its compressed data are corrupt"));
    EXPECT_THAT(error(R"("count": 4)", R"("count": 5)"), HasSubstr("bufferViews[1].byteLength: must be count"));
    EXPECT_THAT(error(R"("count": 6)", R"("count": 3)", true),
                HasSubstr(of_indices + ": its compressed data are corrupt"));
    EXPECT_THAT(error(R"("count": 4, )", ""), HasSubstr(of_vertices + ": needs 'count'"));
    EXPECT_THAT(error(R"("byteLength": 48)", R"("byteLength": 60)"),
                HasSubstr("bufferViews[1].byteLength: must be count * byteStride"));
    EXPECT_THAT(error(R"("mode": "ATTRIBUTES")", R"("mode": "POINTS")"),
                HasSubstr(of_vertices + ".mode: must be ATTRIBUTES, TRIANGLES or INDICES"));
    EXPECT_THAT(error(R"("filter": "NONE")", R"("filter": "COLOR")"),
                HasSubstr(of_vertices + ".filter: must be NONE, OCTAHEDRAL"));
    EXPECT_THAT(error(R"("filter": "NONE")", R"("filter": "OCTAHEDRAL")"),
                HasSubstr(of_vertices + ": the filter OCTAHEDRAL does not support its byteStride of 12"));
    EXPECT_THAT(error(R"("filter": "NONE")", R"("filter": "QUATERNION")"), HasSubstr("the filter QUATERNION"));
    EXPECT_THAT(error(R"("filter": "NONE")", R"("filter": "EXPONENTIAL")", true),
                HasSubstr(of_indices + ".filter: must be NONE with the mode TRIANGLES"));
    EXPECT_THAT(error(R"({"buffer": 0, "byteOffset": 0, "byteLength": )",
                      R"({"buffer": 0, "byteOffset": 9999, "byteLength": )"),
                HasSubstr("extends past the end of its buffer"));
    EXPECT_THAT(error(R"({"buffer": 0, )", R"({"buffer": 1, )"), HasSubstr("extends past the end of its buffer"))
        << "the buffer without data";
    EXPECT_THAT(error(R"("count": 4)", R"("count": 2000000000)"),
                HasSubstr(of_vertices + ": the compressed meshes expand to more than 16 MiB"));
}

TEST(Draco, DecodesMeshesOfBothMethods) {
    for (const int method : {draco::MESH_EDGEBREAKER_ENCODING, draco::MESH_SEQUENTIAL_ENCODING}) {
        const Gltf gltf = draco_file(DracoSample(3, method).encoded());
        for (const auto &[text, name] : {std::pair(gltf.text(), "a.gltf"), {gltf.binary(), "a.glb"}}) {
            const Arena arena = load(text, "", "y-up", name).arena;
            EXPECT_EQ(geometry(arena).positions.count, 16u);
            const auto *colours = elements<glm::u16vec4>(arena, geometry(arena).colours);
            for (std::size_t v = 0; v < 16; ++v) {
                EXPECT_EQ(vertex(arena, v)[0], colours[v].r / 257) << "vertices keep their attributes";
                EXPECT_EQ(vertex(arena, v)[1], colours[v].g / 257);
            }
            std::set<std::pair<float, float>> centres; // of the triangles
            for (const glm::uvec3 &t : triangles(arena)) {
                const auto a = vertex(arena, t.x), b = vertex(arena, t.y), c = vertex(arena, t.z);
                EXPECT_EQ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]), 1) << "twice the area";
                centres.emplace(a[0] + b[0] + c[0], a[1] + b[1] + c[1]);
            }
            EXPECT_EQ(centres.size(), 18u);
        }
    }
}

TEST(Draco, IsPreferredToUncompressedData) {
    Gltf gltf;
    gltf.accessor(-1, 5126, 4, "VEC3"); // all 0
    gltf.accessor(gltf.view(bytes_of(std::vector<std::uint32_t>{0, 1, 2})), 5125, 3, "SCALAR");
    const std::string view = std::to_string(gltf.view(DracoSample(1).encoded()));
    gltf.meshes = R"({"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": 5, "extensions": {
        "KHR_draco_mesh_compression": {"bufferView": )" +
                  view + R"(, "attributes": {"POSITION": 0}}}}]})";
    const Arena arena = load(gltf.text()).arena;
    EXPECT_EQ(triangles(arena).size(), 2u);
    EXPECT_EQ(arena.scene().bounds_max[0], 1);
}

TEST(Draco, RefusesMalformedDataWithTheirPath) {
    const std::string good = DracoSample(1).encoded(),
                      path = "a.gltf: meshes[0].primitives[0].extensions.KHR_draco_mesh_compression";
    const auto error = [](const std::string &bytes) { return error_of(draco_file(bytes).text()); };
    EXPECT_THAT(error("DRAC"), HasSubstr(path + ": has no Draco data"));
    EXPECT_THAT(error(good.substr(0, good.size() - 4)), HasSubstr(path + ": its Draco data are corrupt"));
    std::string old = good;
    old[6] = 1;
    EXPECT_THAT(error(old), HasSubstr(path + ": has Draco data of version 2.1; glTF requires 2.2"));
    draco::PointCloudBuilder points;
    points.Start(1);
    points.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
    draco::EncoderBuffer cloud;
    ASSERT_TRUE(draco::Encoder().EncodePointCloudToBuffer(*points.Finalize(false), &cloud).ok());
    EXPECT_THAT(error({cloud.data(), cloud.size()}), HasSubstr(path + ": has a Draco point cloud instead of a mesh"));
    const auto error_after = [&](const std::string &what, const std::string &by) {
        Gltf gltf = draco_file(good);
        replace(gltf.meshes, what, by);
        return error_of(gltf.text());
    };
    EXPECT_THAT(error_after(R"("COLOR_0": 1}})", R"("COLOR_0": 9}})"),
                HasSubstr(path + ".attributes.COLOR_0: refers to the Draco attribute 9, which does not exist"));
    EXPECT_THAT(error_after(R"("COLOR_0": 1}})", R"("COLOR_1": 1}})"),
                HasSubstr(path + ".attributes.COLOR_1: is not an attribute of the primitive"));
    EXPECT_THAT(error_after(R"("COLOR_0": 1}})", R"("COLOR_0": -1}})"),
                HasSubstr(path + ".attributes.COLOR_0: must be a whole number"));
    EXPECT_THAT(error_after(R"("bufferView": 0)", R"("bufferView": 5)"), HasSubstr("refers to buffer view 5"));
    EXPECT_THAT(error_after(R"({"attributes": {"POSITION")", R"({}, {"attributes": {"POSITION")"),
                HasSubstr("meshes[0]: has a primitive without attributes"));
}

TEST(Draco, ChecksCountsBeforeItAllocates) {
    const std::string exceeded = ": the compressed meshes expand to more than 16 MiB";
    const std::string four_billion = "\xff\xff\xff\xff\x0f", flags(2, '\0');
    EXPECT_THAT(error_of(draco_file(draco_start + "\1" + flags + '\0' + "\3" + four_billion + '\0').text()),
                HasSubstr(exceeded))
        << "faces, edgebreaker";
    EXPECT_THAT(error_of(draco_file(draco_start + '\0' + flags + four_billion + "\3" + '\0').text()),
                HasSubstr(exceeded))
        << "faces, sequential";
    EXPECT_THAT(error_of(draco_file(draco_start + "\1" + flags + '\0' + "\3" + "\x80\x80\4" + "\xff").text()),
                HasSubstr(exceeded))
        << "65536 faces with seams of 255 attributes";
    DracoSample sample(128);
    sample.encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, 8);
    std::string wide = sample.encoded();
    EXPECT_EQ(error_of(draco_file(wide).text()), "no error");
    replace(wide, std::string("\2\2\3\0\1", 5), std::string("\2\2\xff\0\1", 5)); // components of the colour
    EXPECT_THAT(error_of(draco_file(wide).text()), HasSubstr(exceeded)) << "components";
}

TEST(Quantization, ReadsIntegersOfAllSizes) {
    struct Case {
        int type;
        std::string vertices; // (0, 0, 0), (1, 0, 0), (0, 2, 0) with padding
        float one;            // what 1 stands for if it is normalized
    };
    const auto shorts = [](std::uint16_t one) {
        return bytes_of(std::vector<std::uint16_t>{0, 0, 0, 0, one, 0, 0, 0, 0, std::uint16_t(2 * one), 0, 0});
    };
    const Case cases[] = {{5120, {0, 0, 0, 0, 1, 0, 0, 0, 0, 2, 0, 0}, 127},
                          {5121, {0, 0, 0, 0, 1, 0, 0, 0, 0, 2, 0, 0}, 255},
                          {5122, shorts(1), 32767},
                          {5123, shorts(1), 65535}};
    for (const Case &c : cases)
        for (const bool is_normalized : {false, true})
            for (const bool is_compressed : {false, true}) {
                SCOPED_TRACE(testing::Message() << c.type << ' ' << is_normalized << ' ' << is_compressed);
                Gltf gltf;
                const int stride = static_cast<int>(c.vertices.size() / 3);
                const int view = is_compressed ? add(gltf, vertices(c.vertices, std::size_t(stride)), stride)
                                               : gltf.view(c.vertices, stride);
                gltf.accessor(view, c.type, 3, "VEC3", is_normalized ? R"(, "normalized": true)" : "");
                gltf.accessor(view, c.type, 3, "VEC2", is_normalized ? R"(, "normalized": true)" : "");
                const int image = gltf.view(png(1, 1, 3, {1, 2, 3}));
                gltf.meshes = R"({"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]})";
                gltf.more = R"(, "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
                    "textures": [{"source": 0}], "images": [{"mimeType": "image/png", "bufferView": )" +
                            std::to_string(image) + R"(}], "extensionsRequired": ["KHR_mesh_quantization"])";
                const float one = is_normalized ? 1 / c.one : 1;
                const Arena arena = load(gltf.text()).arena;
                EXPECT_THAT(vertex(arena, 1), ElementsAre(near(one), 0, 0));
                EXPECT_THAT(vertex(arena, 2), ElementsAre(0, near(2 * one), 0));
                const float *texcoords = elements<float>(arena, geometry(arena).texcoords);
                EXPECT_THAT(std::vector<float>(texcoords + 2, texcoords + 6),
                            ElementsAre(near(one), 0, 0, near(2 * one)));
            }
}

namespace {

// Returns a triangle with a texture. Image 0 is a red PNG.
std::string with_texture(const std::string &texture, const std::string &image, const std::string &more = "") {
    Gltf gltf = triangle();
    const std::string view = std::to_string(gltf.view(png(1, 1, 3, {100, 2, 3})));
    gltf.meshes = R"({"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]})";
    gltf.more = R"(, "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}], "textures": [)" +
                texture + R"(], "images": [{"mimeType": "image/png", "bufferView": )" + view + "}, " + image + "]" +
                more;
    return gltf.text();
}

int red_of(const std::string &file) {
    const Arena arena = load(file).arena;
    return *elements<std::uint8_t>(arena, image(arena).texels);
}

} // namespace

TEST(WebpTextures, ArePreferredToOtherImages) {
    const std::string image = webp(1, 1, {50, 2, 3, 4}),
                      texture = R"({"source": 0, "extensions": {"EXT_texture_webp": {"source": 1}}})";
    for (const std::string type : {"image/webp", "application/octet-stream"})
        EXPECT_EQ(red_of(with_texture(texture, R"({"uri": "data:)" + type + ";base64," + base64(image) + "\"}",
                                      R"(, "extensionsRequired": ["EXT_texture_webp"])")),
                  50);
    EXPECT_THAT(error_of(with_texture(R"({"extensions": {"EXT_texture_webp": {}}})", R"({"uri": "a.webp"})")),
                HasSubstr("a.gltf: textures[0].extensions.EXT_texture_webp: needs 'source'"));
}

TEST(Ktx2, IsReplacedByTheImageForReadersWithoutDecoder) {
    const std::string basisu = R"("extensions": {"KHR_texture_basisu": {"source": 1}})",
                      ktx2 = R"({"uri": "data:image/ktx2;base64,q0tUWCAyMLsNChoK"})",
                      hint = "npx @gltf-transform/cli ktxdecompress MODEL.glb";
    EXPECT_EQ(red_of(with_texture(R"({"source": 0, )" + basisu + "}", ktx2)), 100);
    EXPECT_THAT(error_of(with_texture("{" + basisu + "}", ktx2)),
                AllOf(HasSubstr("a.gltf: textures[0]: "), HasSubstr(hint)));
    EXPECT_THAT(error_of(with_texture("{" + basisu + "}", ktx2, R"(, "extensionsRequired": ["KHR_texture_basisu"])")),
                HasSubstr(hint));
    EXPECT_THAT(error_of(with_texture("{}", ktx2)), HasSubstr("a.gltf: textures[0]: has no image"));
}
