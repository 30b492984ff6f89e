// SPDX-License-Identifier: Apache-2.0
#include "errors.hpp"
#include "plugin_under_test.hpp"
#include "scene/mesh_loader.hpp"
#include "scene_samples.hpp"

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <random>

#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

using namespace arhost::scene;
using namespace arhost::scene::test;
using arhost::test::ScratchFolder;
using arhost::test::shared_data;
using testing::ElementsAre;
using testing::HasSubstr;

namespace {

std::string gzipped(const std::string &content) {
    z_stream stream{};
    deflateInit2(&stream, 6, Z_DEFLATED, 16 + MAX_WBITS, 8, Z_DEFAULT_STRATEGY);
    std::string packed(deflateBound(&stream, content.size()), '\0');
    stream.next_in = reinterpret_cast<Bytef *>(const_cast<char *>(content.data()));
    stream.avail_in = static_cast<uInt>(content.size());
    stream.next_out = reinterpret_cast<Bytef *>(packed.data());
    stream.avail_out = static_cast<uInt>(packed.size());
    deflate(&stream, Z_FINISH);
    packed.resize(stream.total_out);
    deflateEnd(&stream);
    return packed;
}

// `info` has the messages of the loader, each followed by "; ".
struct Loaded {
    TriangleMesh mesh;
    std::string info;
};

Loaded load_text(const std::string &name, const std::string &content, const MeshOptions &options = {}) {
    const ScratchFolder folder;
    write_file(folder.path() / name, content);
    Loaded loaded;
    LoadCallbacks callbacks;
    callbacks.info = [&](const std::string &text) {
        loaded.info += text.substr(std::min(text.size(), folder.path().string().size() + 1)) + "; ";
    };
    loaded.mesh = load_mesh(folder.path() / name, options, callbacks);
    return loaded;
}

std::string error_at(const std::filesystem::path &file, const MeshOptions &options = {}) {
    return arhost::test::error_of<MeshError>([&] { load_mesh(file, options); });
}

// Returns the error message without the name of the file.
std::string error_of(const std::string &name, const std::string &content, const MeshOptions &options = {}) {
    const ScratchFolder folder;
    const std::filesystem::path file = folder.path() / name;
    write_file(file, content);
    return arhost::test::after(file.string() + ":", error_at(file, options));
}

// Returns the result of `validate` for a scene with this mesh.
std::string validated(TriangleMesh mesh) {
    ArenaBuilder builder;
    builder.add_object("mesh", builder.add_triangles(std::move(mesh)), builder.add_material(grey()));
    return validate(std::move(builder).build().bytes());
}

float area_of(const TriangleMesh &mesh) {
    float area = 0;
    for (const glm::uvec3 &t : mesh.triangles) {
        const glm::vec3 &a = mesh.positions[t.x];
        area += glm::length(glm::cross(mesh.positions[t.y] - a, mesh.positions[t.z] - a)) / 2;
    }
    return area;
}

const std::string three_vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
const std::string ply_start = "ply\nformat ascii 1.0\n";
const std::string ply_triangle_header = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
                                        "element face 1\nproperty list uchar int vertex_indices\nend_header\n";

template <class T> void append(std::string &bytes, T value, bool big_endian) {
    char raw[sizeof(T)];
    std::memcpy(raw, &value, sizeof(T));
    if (big_endian == (std::endian::native == std::endian::little))
        std::reverse(raw, raw + sizeof(T));
    bytes.append(raw, sizeof(T));
}

std::string binary_triangle(bool big_endian) {
    std::string bytes = std::string("ply\nformat binary_") + (big_endian ? "big" : "little") + "_endian 1.0\n" +
                        "element vertex 3\nproperty double x\nproperty float y\nproperty short z\n"
                        "property uchar red\nelement face 1\nproperty list uchar ushort vertex_index\n"
                        "property list uint char unused\nend_header\n";
    for (int i = 0; i < 3; ++i) {
        append<double>(bytes, 10.5 + i, big_endian);
        append<float>(bytes, i == 2 ? 300.25f : 0, big_endian);
        append<std::int16_t>(bytes, static_cast<std::int16_t>(-300 * i), big_endian);
        append<std::uint8_t>(bytes, 255, big_endian);
    }
    append<std::uint8_t>(bytes, 3, big_endian);
    for (const std::uint16_t index : {2, 0, 1})
        append(bytes, index, big_endian);
    append<std::uint32_t>(bytes, 2, big_endian);
    return bytes + "xy";
}

const std::string ascii_stl = "solid two words\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 1 0 0\n"
                              "   vertex 0 1e0 0\n  endloop\n endfacet\nendsolid two words\n";

// Returns triangles (0, 0, i), (1, 0, i), (0, 1, i).
std::string binary_stl(std::string header, std::uint32_t count) {
    header.resize(80, ' ');
    append(header, count, false);
    for (std::uint32_t i = 0; i < count; ++i) {
        const auto z = static_cast<float>(i);
        for (const float value : {0.f, 0.f, -9.f, 0.f, 0.f, z, 1.f, 0.f, z, 0.f, 1.f, z})
            append(header, value, false);
        append<std::uint16_t>(header, 0xffff, false);
    }
    return header;
}

} // namespace

TEST(Obj, ReadsTriangles) {
    const TriangleMesh mesh = load_text("a.obj", three_vertices + "f 1 2 3\n").mesh;
    EXPECT_THAT(mesh.positions, ElementsAre(glm::vec3(0, 0, 0), glm::vec3(1, 0, 0), glm::vec3(0, 1, 0)));
    EXPECT_THAT(mesh.triangles, ElementsAre(glm::uvec3(0, 1, 2)));
    EXPECT_TRUE(mesh.normals.empty());
    EXPECT_TRUE(mesh.texcoords.empty());
}

TEST(Obj, CountsNegativeIndicesFromTheLastVertex) {
    const TriangleMesh mesh = load_text("a.obj", three_vertices + "f -3 -2 -1\nv 5 5 5\nf -1 -4 -3\n").mesh;
    EXPECT_THAT(mesh.triangles, ElementsAre(glm::uvec3(0, 1, 2), glm::uvec3(3, 0, 1)));
}

TEST(Obj, CreatesOneVertexPerPairOfPositionAndNormal) {
    const TriangleMesh mesh =
        load_text("a.obj", three_vertices + "v 1 1 0\nvn 0 0 2\nvn 0 0 -1\n"
                                            "f 1//1 2//1 3//1\nf 2//1 4//2 3//1\nf 4//2 2//1 3//2\n")
            .mesh;
    EXPECT_EQ(mesh.positions.size(), 5u);
    EXPECT_THAT(mesh.normals, ElementsAre(glm::vec3(0, 0, 1), glm::vec3(0, 0, 1), glm::vec3(0, 0, 1),
                                          glm::vec3(0, 0, -1), glm::vec3(0, 0, -1)));
    EXPECT_THAT(mesh.triangles, ElementsAre(glm::uvec3(0, 1, 2), glm::uvec3(1, 3, 2), glm::uvec3(3, 1, 4)));
    EXPECT_EQ(mesh.positions[4], glm::vec3(0, 1, 0));
}

TEST(Obj, KeepsTexcoordsAndUsesZeroForCornersWithoutThem) {
    const TriangleMesh mesh =
        load_text("a.obj", three_vertices + "vt 0.25 0.5\nvt 1\nf 1 2 3\nf 1/1 2/2 3/-1\n").mesh;
    ASSERT_EQ(mesh.texcoords.size(), mesh.positions.size());
    // v = 0 is the top of the texture in the arena, but the bottom in OBJ files.
    EXPECT_EQ(mesh.texcoords[mesh.triangles[0].y], glm::vec2(0, 1));
    EXPECT_EQ(mesh.texcoords[mesh.triangles[1].x], glm::vec2(0.25f, 0.5f));
    EXPECT_EQ(mesh.texcoords[mesh.triangles[1].z], glm::vec2(1, 1));
}

TEST(Obj, IgnoresNormalsIfOnlySomeFacesHaveThem) {
    const Loaded loaded = load_text("a.obj", three_vertices + "vn 0 0 1\nf 1 2 3\nf 1//1 2//1 3//1\n");
    EXPECT_TRUE(loaded.mesh.normals.empty());
    EXPECT_EQ(loaded.info, "a.obj: only some faces have normals; all normals are ignored; ");
}

TEST(Obj, ReportsIgnoredMaterials) {
    EXPECT_EQ(load_text("a.obj", "mtllib a.mtl\n" + three_vertices + "f 1 2 3").info,
              "a.obj: the MTL materials are ignored; the scene file defines the materials; ");
}

TEST(Obj, ReadsSyntaxVariants) {
    for (const std::string &text :
         {std::string("\xef\xbb\xbfv 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 3"), // Windows line ends
          std::string("v 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3\r"),                 // classic Mac OS line ends
          std::string("v 0 \\\n0 0\nv 1 0 0 # last\nv 0 1 0 1.0\nf 1 \\\n 2 3 # f 9 9 9\n"),
          std::string("\t v\t+0 0. .0 0.5 0.5 0.5\nvp 1\nv 1e0 0E5 -0\nv 1e-60 +1.0e+0 0\ng a\ns off\nf 1 2 3\\")}) {
        const TriangleMesh mesh = load_text("a.obj", text).mesh;
        EXPECT_THAT(mesh.positions, ElementsAre(glm::vec3(0, 0, 0), glm::vec3(1, 0, 0), glm::vec3(0, 1, 0)));
        EXPECT_EQ(mesh.triangles.size(), 1u);
    }
}

TEST(Obj, ErrorsNameFileAndLine) {
    const arhost::test::ErrorCase cases[] = {
        {"v 0 0\n", "1: a vertex needs 3 numbers, but has 2"},
        {"\n\nv 0 x 0\n", "3: 'x' is not a number"},
        {"v 0 1,5 0\n", "1: '1,5' is not a number"},
        {"v 0 nan 0\n", "1: a vertex has the invalid number 'nan'"},
        {"v 0 0 1e99\n", "1: a vertex has the invalid number '1e99'"},
        {"v 0 0 0\nvn 0 -inf 1\n", "2: a normal has the invalid number '-inf'"},
        {three_vertices + "f 1 2\n", "4: a face needs at least three corners, but this one has 2"},
        {three_vertices + "f 1 2 4\n", "4: a face refers to vertex 4, but only 3 are defined above"},
        {three_vertices + "f 1 2 -4\n", "4: a face refers to vertex -4, but only 3 are defined above"},
        {three_vertices + "f 0 1 2\n", "4: a face refers to vertex 0, but only 3 are defined above"},
        {three_vertices + "f 1/1 2/1 3/1\n", "4: a face refers to texcoord 1, but only 0 are defined above"},
        {three_vertices + "vn 0 0 1\nf 1//1 2//2 3//1\n",
         "5: a face refers to normal 2, but only 1 are defined above"},
        {three_vertices + "f 1 2 x\n", "4: 'x' is not a corner of a face"},
        {three_vertices + "f 1 2 3/1/1/1\n", "4: a face refers to texcoord 1, but only 0 are defined above"},
        {three_vertices + "f 1 2 99999999999999999999\n", "4: '99999999999999999999' is not a corner of a face"},
        {three_vertices, " contains no triangles"},
        {three_vertices + "l 1 2\n", " contains no triangles, only points, lines or curves"},
        {"hello\n", " contains no triangles, and no vertices"},
    };
    expect_errors([&](const std::string &text) { return error_of("a.obj", text); }, cases);
}

TEST(Obj, ReadsColoursAsSrgb) {
    const TriangleMesh mesh =
        load_text("a.obj", "v 0 0 0\nv 1 0 0 1 0.5 0\nv 0 1 0 1\nv 0 2 0 0 2 nan 0.5\nf 1 2 3\nf 1 2 4\n").mesh;
    // IEC 61966-2-1: 0.5 → 0.2140411
    EXPECT_THAT(mesh.colours, ElementsAre(glm::u16vec4(65535), glm::u16vec4(65535, 14027, 0, 65535),
                                          glm::u16vec4(65535), glm::u16vec4(0, 65535, 0, 32768)));
    EXPECT_EQ(validated(mesh), "");
    const TriangleMesh joined = load_text("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0 0 0 0\nvt 0 0\nf 3/1 1/1 2/1\n").mesh;
    EXPECT_THAT(joined.colours, ElementsAre(glm::u16vec4(0, 0, 0, 65535), glm::u16vec4(65535), glm::u16vec4(65535)));
    EXPECT_TRUE(load_text("a.obj", "v 0 0 0 1\nv 1 0 0 1\nv 0 1 0 1\nf 1 2 3\n").mesh.colours.empty());
}

TEST(Obj, NamesTheMaterialsOfItsTriangles) {
    const ScratchFolder folder;
    write_file(folder.path() / "a.obj", "mtllib a b.mtl \n" + three_vertices +
                                            "f 1 2 3\nusemtl unused\nusemtl  oak wood \nf 1 2 3\nf 1 2 3\n"
                                            "usemtl #2\nf 1 2 3\nusemtl oak wood\nf 1 2 3\nusemtl end\n");
    const MaterialUses uses = load_mesh_with_materials(folder.path() / "a.obj").uses;
    EXPECT_THAT(uses.libraries, ElementsAre("a b.mtl"));
    ASSERT_EQ(uses.names.size(), 4u);
    EXPECT_EQ(uses.names[1].text, "oak wood");
    EXPECT_EQ(uses.names[1].line, 7u);
    EXPECT_EQ(uses.names[2].text, "#2");
    EXPECT_EQ(uses.names[3].line, 14u);
    ASSERT_EQ(uses.runs.size(), 4u);
    EXPECT_EQ(uses.runs[0].first_triangle, 1u);
    EXPECT_EQ(uses.runs[0].name, 1u);
    EXPECT_EQ(uses.runs[1].first_triangle, 3u);
    EXPECT_EQ(uses.runs[2].name, 1u);
}

TEST(Polygons, AreTriangulatedWithoutGapsOrOverlaps) {
    // The polygons are a square, a concave arrow head, a U (a triangle fan would cover its gap), and a U with the
    // opposite winding.
    EXPECT_FLOAT_EQ(area_of(load_text("a.obj", "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nf 1 2 3 4\n").mesh), 4);
    const TriangleMesh arrow = load_text("a.obj", "v 0 0 0\nv 4 0 2\nv 0 0 4\nv 1 0 2\nf 1 2 3 4\n").mesh;
    EXPECT_FLOAT_EQ(area_of(arrow), 6);
    const std::string u = "v 0 0 7\nv 3 0 7\nv 3 3 7\nv 2 3 7\nv 2 1 7\nv 1 1 7\nv 1 3 7\nv 0 3 7\n";
    for (const std::string face : {"f 1 2 3 4 5 6 7 8\n", "f 8 7 6 5 4 3 2 1\n"}) {
        const TriangleMesh mesh = load_text("a.obj", u + face).mesh;
        EXPECT_EQ(mesh.triangles.size(), 6u);
        EXPECT_FLOAT_EQ(area_of(mesh), 7);
        for (const glm::uvec3 &t : mesh.triangles) { // same winding as the polygon
            const glm::vec3 &a = mesh.positions[t.x];
            const float z = glm::cross(mesh.positions[t.y] - a, mesh.positions[t.z] - a).z;
            EXPECT_GE(face[2] == '1' ? z : -z, 0);
        }
    }
}

TEST(Polygons, AreTriangulatedEvenIfTheyIntersectThemselves) {
    EXPECT_EQ(load_text("a.obj", "v 0 0 0\nv 2 2 0\nv 2 0 0\nv 0 2 0\nf 1 2 3 4\n").mesh.triangles.size(), 2u);
    EXPECT_EQ(load_text("a.obj", "v 0 0 0\nv 1 1 1\nf 1 2 1 2 1 2\n").mesh.triangles.size(), 4u);
}

TEST(Polygons, AreRejectedIfConcaveWithMoreThan1000Corners) {
    std::string text, face = "f";
    for (int i = 0; i < 1002; ++i) {
        text += "v " + std::to_string(i) + " " + std::to_string(i % 2 ? 0 : 5000 - i) + " 0\n";
        face += " " + std::to_string(i + 1);
    }
    EXPECT_EQ(error_of("a.obj", text + face + "\n"),
              "1003: a concave face has 1002 corners, more than 1000; triangulate it");
}

TEST(Ply, ReadsAscii) {
    const TriangleMesh mesh =
        load_text("a.ply",
                  "ply\r\nformat ascii 1.0\r\ncomment x\r\nobj_info y\r\nelement vertex 4\r\nproperty float x\r\n"
                  "property double y\r\nproperty int z\r\nproperty list uchar float weights\r\n"
                  "property float nx\r\nproperty float ny\r\nproperty float nz\r\nproperty float u\r\n"
                  "property float v\r\nelement edge 1\r\nproperty int a\r\nelement face 2\r\n"
                  "property uchar red\r\nproperty list uchar int vertex_indices\r\nend_header\r\n"
                  "0 0 0 0 0 0 2 0 0\r\n1 0 0 2 0.5 0.5 0 0 1 1 0\r\n1 1 0 0 0 0 1 1 1\r\n\r\n0 1e0 0 0 0 0 1 0 1\r\n"
                  "7\r\n255 4 0 1 2 3\r\n0 2 0 1")
            .mesh;
    EXPECT_THAT(mesh.positions,
                ElementsAre(glm::vec3(0, 0, 0), glm::vec3(1, 0, 0), glm::vec3(1, 1, 0), glm::vec3(0, 1, 0)));
    EXPECT_THAT(mesh.normals, testing::Each(glm::vec3(0, 0, 1)));
    EXPECT_THAT(mesh.texcoords, ElementsAre(glm::vec2(0, 1), glm::vec2(1, 1), glm::vec2(1, 0), glm::vec2(0, 0)));
    EXPECT_THAT(mesh.triangles, ElementsAre(glm::uvec3(0, 1, 2), glm::uvec3(0, 2, 3)));
}

TEST(Ply, ReadsBinaryInBothByteOrders) {
    for (const bool big_endian : {false, true}) {
        const TriangleMesh mesh = load_text("a.ply", binary_triangle(big_endian)).mesh;
        EXPECT_THAT(mesh.positions,
                    ElementsAre(glm::vec3(10.5, 0, 0), glm::vec3(11.5, 0, -300), glm::vec3(12.5, 300.25, -600)));
        EXPECT_THAT(mesh.triangles, ElementsAre(glm::uvec3(2, 0, 1)));
    }
}

TEST(Ply, ReadsCarriageReturnLineEndings) {
    std::string text = ply_start + ply_triangle_header + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    std::replace(text.begin(), text.end(), '\n', '\r');
    EXPECT_EQ(load_text("a.ply", text).mesh.triangles.size(), 1u);
}

TEST(Ply, LinearisesIntegerColours) {
    const auto colours_with = [](const std::string &type, const std::string &colour, bool alpha = true) {
        std::string header = ply_start + "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
        for (const std::string name : {"red", "green", "blue", "alpha"})
            if (alpha || name != "alpha")
                header += "property " + type + " " + name + "\n";
        header += "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
        return load_text("a.ply",
                         header + "0 0 0 " + colour + "\n1 0 0 " + colour + "\n0 1 0 " + colour + "\n3 0 1 2")
            .mesh.colours;
    };
    // IEC 61966-2-1: 128/255 → 0.2158605
    EXPECT_THAT(colours_with("uchar", "255 128 0 128"), testing::Each(glm::u16vec4(65535, 14146, 0, 32896)));
    EXPECT_THAT(colours_with("ushort", "65535 32896 0 32896"), testing::Each(glm::u16vec4(65535, 14146, 0, 32896)));
    EXPECT_THAT(colours_with("float", "1.5 0.5 -1", false), testing::Each(glm::u16vec4(65535, 32768, 0, 65535)));
    EXPECT_EQ(colours_with("uchar", "1 2 3", false).size(), 3u);
    EXPECT_TRUE(load_text("a.ply", binary_triangle(false)).mesh.colours.empty()) << "red alone is no colour";
}

TEST(Stl, ReadsAsciiAndJoinsVertices) {
    for (const std::string &text :
         {ascii_stl + "solid empty\nendsolid\n",
          "SOLID\r\nFACET NORMAL nan 0 0\r\nOUTER LOOP\r\nVERTEX 0 0 0 VERTEX 1 0 0\r\nVERTEX 0 1 0\r\nENDLOOP "
          "ENDFACET\r\n" +
              std::string("ENDSOLID")}) {
        const TriangleMesh mesh = load_text("a.stl", text).mesh;
        EXPECT_THAT(mesh.positions, ElementsAre(glm::vec3(0, 0, 0), glm::vec3(1, 0, 0), glm::vec3(0, 1, 0)));
        EXPECT_THAT(mesh.triangles, ElementsAre(glm::uvec3(0, 1, 2)));
        EXPECT_TRUE(mesh.normals.empty());
    }
    std::string classic_mac = ascii_stl;
    std::ranges::replace(classic_mac, '\n', '\r');
    EXPECT_EQ(load_text("a.stl", classic_mac).mesh.triangles.size(), 1u);
    EXPECT_EQ(load_text("a.stl", ascii_stl + ascii_stl).mesh.positions.size(), 3u);
    EXPECT_THAT(load_text("a.stl", ascii_stl, {true}).mesh.normals, testing::Each(glm::vec3(0, 0, 1)));
}

TEST(Stl, ReadsBinaryEvenIfItsHeaderBeginsLikeAscii) {
    for (const std::string header : {"solid exported", "made by hand"}) {
        const TriangleMesh mesh = load_text("a.stl", binary_stl(header, 2)).mesh;
        EXPECT_THAT(mesh.triangles, ElementsAre(glm::uvec3(0, 1, 2), glm::uvec3(3, 4, 5)));
        EXPECT_EQ(mesh.positions[4], glm::vec3(1, 0, 1));
        EXPECT_TRUE(mesh.normals.empty()) << "the normals in the file point to the wrong side";
        EXPECT_EQ(validated(mesh), "");
    }
    EXPECT_EQ(load_text("a.stl.gz", gzipped(binary_stl("", 1))).mesh.triangles.size(), 1u);
    EXPECT_EQ(load_text("a.stl", binary_stl("", 1) + "rest").mesh.triangles.size(), 1u);
}

TEST(Stl, ErrorsNameTheLineOrTheByteOffset) {
    std::string infinite = binary_stl("", 2);
    std::string infinity;
    append<float>(infinity, INFINITY, false);
    infinite.replace(84 + 50 + 12 + 8, 4, infinity);
    const std::string facet = "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n";
    const arhost::test::ErrorCase cases[] = {
        {"solid\nendsolid\n", " contains no triangles"},
        {binary_stl("", 0), " contains no triangles"},
        {"surface\n", "1: 'solid' is expected here, not 'surface'"},
        {"solid\nvertex 0 0 0\n", "2: 'facet' or 'endsolid' is expected here, not 'vertex'"},
        {"solid\nfacet 0 0 1\n", "2: 'normal' is expected here, not '0'"},
        {facet + "vertex 1 1 0\n", "7: 'endloop' is expected here, not 'vertex'"},
        {facet + "endloop\n", "8: the file is truncated: 'endfacet' is expected here"},
        {"solid\nfacet normal 0 0 1\nouter loop\nvertex 0 x 0\n", "4: a finite number is expected here, not 'x'"},
        {"solid\nfacet normal 0 0 1\nouter loop\nvertex 0 inf 0\n", "4: a finite number is expected here, not 'inf'"},
        {"solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0",
         "4: the file is truncated: a finite number is expected here"},
        {binary_stl("", 2).substr(0, 183),
         " byte 80: the header declares 2 triangles, which need 184 bytes, but the file has 183"},
        {infinite, " byte 146: triangle 1 has a coordinate that is not finite"},
    };
    expect_errors([&](const std::string &text) { return error_of("a.stl", text); }, cases);
    EXPECT_THAT(error_of("a.stl", ply_start), HasSubstr("has the extension .stl but contains a PLY mesh"));
}

TEST(Ply, HeaderErrorsNameFileAndLine) {
    EXPECT_EQ(error_of("a.ply", "plx\n"), "1: the first line must be 'ply'");
    EXPECT_EQ(error_of("a.ply", "ply\n"), "1: the header has no line 'end_header'");
    EXPECT_EQ(error_of("a.ply", "ply\nend_header\n"), "1: the header has no line 'format'");
    EXPECT_EQ(error_of("a.ply", "ply\nformat utf8 1.0\nend_header\n"),
              "2: the format 'utf8' is not ascii, binary_little_endian or binary_big_endian");
    EXPECT_EQ(error_of("a.ply", "ply\nformat ascii 2.0\n"), "2: the format version is '2.0', not 1.0");
    EXPECT_EQ(error_of("a.ply", ply_start + "element vertex -1\n"),
              "3: the element 'vertex' has the invalid count '-1'");
    EXPECT_EQ(error_of("a.ply", ply_start + "property float x\n"),
              "3: the header has a property before the first element");
    EXPECT_EQ(error_of("a.ply", ply_start + "element vertex 1\nproperty half x\n"),
              "4: the property type 'half' is unknown");
    EXPECT_EQ(error_of("a.ply", ply_start + "element face 1\nproperty list float int vertex_indices\n"),
              "4: the count of a list must have an integer type");
    EXPECT_EQ(error_of("a.ply", ply_start + "element vertex 0\nend_header\n"),
              " contains no triangles: the header has no element 'face' with a list 'vertex_indices'");
    EXPECT_EQ(error_of("a.ply", ply_start + "element vertex 1\nproperty float x\nelement face 1\n"
                                            "property list uchar int vertex_index\nend_header\n1\n3 0 0 0\n"),
              " each vertex must have the properties x, y and z");
}

TEST(Ply, DataErrorsNameFileAndLine) {
    const std::string header = ply_start + ply_triangle_header; // these are lines 1 to 9
    const arhost::test::ErrorCase cases[] = {
        {header + "0 0 0\n1 0\n0 1 0\n3 0 1 2\n", "11: vertex 1 is truncated"},
        {header + "0 0 0\n1 0 0 0\n0 1 0\n3 0 1 2\n",
         "11: vertex 1 has more values than the header declares properties"},
        {header + "0 0 0\n1 zero 0\n0 1 0\n3 0 1 2\n", "11: 'zero' is not a number"},
        {header + "0 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n", "11: vertex 1: 'y' is not finite"},
        {header + "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "13: face 0 refers to vertex 3, but only 3 are defined"},
        {header + "0 0 0\n1 0 0\n0 1 0\n3 0 -1 2\n", "13: face 0 refers to vertex -1, but only 3 are defined"},
        {header + "0 0 0\n1 0 0\n0 1 0\n3 0 1.5 2\n", "13: '1.5' is not an integer"},
        {header + "0 0 0\n1 0 0\n0 1 0\n3 0 1\n", "13: face 0 is truncated"},
        {header + "0 0 0\n1 0 0\n0 1 0\n\n\n", "15: the file is truncated before face 0 of 1"},
        {header + "0 0 0\n1 0 0\n0 1 0\n4000000 0 1 2\n",
         "13: face 0: the list 'vertex_indices' has the length 4000000"},
        {header + "0 0 0\n1 0 0\n0 1 0\n2 0 1\n", " contains no triangles: all faces have fewer than three corners"},
    };
    expect_errors([&](const std::string &text) { return error_of("a.ply", text); }, cases);
}

TEST(Ply, BinaryDataErrorsNameTheByteOffset) {
    const std::string whole = binary_triangle(false);
    const std::size_t header = whole.find("end_header\n") + 11;
    EXPECT_EQ(error_of("a.ply", whole.substr(0, whole.size() - 1)),
              " byte " + std::to_string(whole.size() - 2) + ": face 0: the list 'unused' has the length 2");
    EXPECT_EQ(error_of("a.ply", whole.substr(0, header + 10)),
              " the header declares 3 elements 'vertex', but the file has only 10 bytes for them");
    std::string wrong = whole;
    wrong[header + 3 * 15 + 1] = 77;
    EXPECT_EQ(error_of("a.ply", wrong), " byte " + std::to_string(header + 3 * 15 + 3) +
                                            ": face 0 refers to vertex 77, but only 3 are defined");
}

TEST(Ply, RejectsCountsBeyondTheFileSizeBeforeReservingMemory) {
    for (const std::string count : {"4000000000", "4611686018427387904", "9223372036854775807"})
        for (const std::string format : {"ascii", "binary_little_endian"}) {
            const std::string text = "ply\nformat " + format + " 1.0\nelement vertex " + count +
                                     "\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
                                     "property list uchar int vertex_indices\nend_header\n0 0 0\n";
            EXPECT_THAT(error_of("a.ply", text),
                        HasSubstr(" the header declares " + count + " elements 'vertex', but the file has only"));
        }
}

TEST(MeshFile, IsDecompressedIfItIsGzip) {
    const std::string text = three_vertices + "f 1 2 3\n";
    EXPECT_EQ(load_text("a.obj.gz", gzipped(text)).mesh.triangles.size(), 1u);
    EXPECT_EQ(load_text("A.OBJ.GZ", gzipped(text)).mesh.triangles.size(), 1u);
    EXPECT_EQ(load_text("a.obj", gzipped(text)).mesh.triangles.size(),
              1u); // gzip is recognised by content, not by extension
    EXPECT_EQ(load_text("a.ply.gz", gzipped(binary_triangle(true))).mesh.triangles.size(), 1u);
    // Two gzip members followed by zero padding, as on tapes (RFC 1952, 2.2).
    const std::string parts = gzipped(text.substr(0, 9)) + gzipped(text.substr(9)) + std::string(5, '\0');
    EXPECT_EQ(load_text("a.obj.gz", parts).mesh.triangles.size(), 1u);
}

TEST(MeshFile, GzipErrorsNameTheByteOffset) {
    std::string text = three_vertices;
    for (int i = 0; i < 5000; ++i)
        text += "v " + std::to_string(i * 7919 % 1013) + " 0 1\n";
    const std::string packed = gzipped(text + "f 1 2 3\n");
    ASSERT_GT(packed.size(), 1000u);
    EXPECT_THAT(error_of("a.obj.gz", packed.substr(0, packed.size() - 3)),
                HasSubstr(" the gzip data is truncated after byte"));
    EXPECT_THAT(error_of("a.obj.gz", packed.substr(0, 12)), HasSubstr("the gzip data is truncated after byte"));
    std::string damaged = packed;
    damaged[packed.size() / 2] ^= 0x55;
    EXPECT_THAT(error_of("a.obj.gz", damaged), HasSubstr("the gzip data is corrupt at byte"));
    damaged = packed;
    damaged[packed.size() - 6] ^= 1; // the checksum
    EXPECT_THAT(error_of("a.obj.gz", damaged), HasSubstr("incorrect data check"));
    EXPECT_THAT(error_of("a.obj.gz", packed + "unused"), HasSubstr("a gzip header is expected here"));
    EXPECT_EQ(error_of("a.obj.gz", gzipped("")), " is empty");
}

TEST(MeshFile, IsRejectedAboveTheSizeLimit) {
    const std::string bomb = gzipped(std::string(20 << 20, '#'));
    MeshOptions options;
    options.byte_limit = 4 << 20;
    EXPECT_EQ(error_of("a.obj.gz", bomb, options), " its decompressed content exceeds the limit of 4 MiB");
    EXPECT_EQ(error_of("a.obj", std::string(5 << 20, '#'), options), " is 5 MiB large; the limit is 4 MiB");
}

TEST(MeshFile, IsRejectedIfItExpandsToAHundredTimesItsSize) {
    EXPECT_EQ(error_of("a.obj.gz", gzipped(std::string(17 << 20, '#'))),
              " its decompressed content exceeds the limit of 16 MiB for a file of this size; meshes do "
              "not compress so well: decompress it with gunzip if it is genuine");
}

TEST(MeshFile, IsRejectedIfTheFormatIsUnsupported) {
    EXPECT_EQ(error_of("a.glb", "glTF"), " is a glTF file; name it with the key 'gltf' instead of 'mesh'");
    EXPECT_EQ(error_of("a.off", "OFF\n"), " the format '.off' is unsupported; convert the mesh to .obj, .ply or .stl "
                                          "(optionally compressed: .obj.gz, .ply.gz, .stl.gz)");
    EXPECT_THAT(error_of("mesh", "v 0 0 0\n"), HasSubstr(" the file name has no extension"));
    EXPECT_EQ(error_of("a.obj", "\xff\xfev\0"), " is UTF-16 text; save it as UTF-8 or ASCII");
    EXPECT_EQ(error_of("a.obj", ply_start), " has the extension .obj but contains a PLY mesh; rename it to .ply");
    EXPECT_EQ(error_of("a.obj", ""), " is empty");
}

TEST(MeshFile, ErrorsNameTheConverterOfOtherFormats) {
    const std::string assimp = "convert the file with `assimp export 'a.";
    for (const std::string extension : {"3mf", "dae", "fbx", "x3d"})
        EXPECT_EQ(error_of("a." + extension, "x"),
                  " the format '." + extension + "' is unsupported; " + assimp + extension +
                      "' 'a.glb' -fglb2`, and name the result with the key 'gltf' instead of 'mesh'");
    for (const std::string extension : {"usd", "usda", "usdc", "USDZ"})
        EXPECT_THAT(error_of("a." + extension, "x"),
                    HasSubstr("convert the file with `blender --background --python-expr \"import bpy; "
                              "bpy.ops.wm.read_factory_settings(use_empty=True); bpy.ops.wm.usd_import(filepath='a." +
                              extension + "'); bpy.ops.export_scene.gltf(filepath='a.glb')\"`, and"));
    EXPECT_THAT(error_of("a.blend", "x"),
                HasSubstr("convert the file with `blender --background 'a.blend' --python-expr \"import bpy; "
                          "bpy.ops.export_scene.gltf(filepath='a.glb')\"`, and"));
}

TEST(MeshFile, ReportsWhyItCannotBeRead) {
    const ScratchFolder folder;
    EXPECT_EQ(error_at("/no/such.ply"), "/no/such.ply: cannot be read: No such file or directory");
    std::filesystem::create_directory(folder.path() / "folder.obj");
    EXPECT_THAT(error_at(folder.path() / "folder.obj"), HasSubstr("is a folder, not a mesh file"));
    ASSERT_EQ(mkfifo((folder.path() / "fifo.obj").c_str(), 0600), 0);
    EXPECT_THAT(error_at(folder.path() / "fifo.obj"), HasSubstr("is not a regular file"));
}

TEST(MeshFile, LoadingCanBeCancelled) {
    const ScratchFolder folder;
    write_file(folder.path() / "a.obj", three_vertices + "f 1 2 3\n");
    LoadCallbacks callbacks;
    callbacks.cancelled = [] { return true; };
    EXPECT_THROW(load_mesh(folder.path() / "a.obj", {}, callbacks), Cancelled);
}

TEST(Normals, AreComputedIfSmoothIsTrue) {
    // Two triangles meet at a ridge. At their common edge, the normals are weighted by area, in the ratio 1 : 3.
    const std::string ridge = "v 0 0 0\nv 0 1 0\nv 1 0 0\nv 0 0 -3\nf 1 3 2\nf 1 2 4\n";
    EXPECT_TRUE(load_text("a.obj", ridge).mesh.normals.empty());
    const TriangleMesh mesh = load_text("a.obj", ridge, {true}).mesh;
    const glm::vec3 edge = glm::normalize(glm::vec3(-3, 0, 1));
    ASSERT_EQ(mesh.normals.size(), 4u);
    EXPECT_LT(glm::distance(mesh.normals[0], edge), 1e-6f);
    EXPECT_LT(glm::distance(mesh.normals[1], edge), 1e-6f);
    EXPECT_EQ(mesh.normals[2], glm::vec3(0, 0, 1));
    EXPECT_EQ(mesh.normals[3], glm::vec3(-1, 0, 0));
}

TEST(Normals, AreSharedAcrossTextureSeams) {
    const std::string seam = "v 0 0 0\nv 0 1 0\nv 1 0 0\nv 0 0 -1\nvt 0 0\nvt 1 1\nf 1/1 3/1 2/1\nf 1/2 2/2 4/2\n";
    const TriangleMesh mesh = load_text("a.obj", seam, {true}).mesh;
    ASSERT_EQ(mesh.positions.size(), 6u);
    EXPECT_EQ(mesh.normals[mesh.triangles[0].x], mesh.normals[mesh.triangles[1].x]);
}

TEST(Normals, NormalsInTheFileAreDroppedIfSmoothIsFalse) {
    const std::string text = three_vertices + "vn 0 0 1\nf 1//1 2//1 3//1\n";
    EXPECT_EQ(load_text("a.obj", text).mesh.normals.size(), 3u);
    EXPECT_EQ(load_text("a.obj", text, {true}).mesh.normals.size(), 3u);
    EXPECT_TRUE(load_text("a.obj", text, {false}).mesh.normals.empty());
}

TEST(Normals, NormalsOfLengthZeroAreComputed) {
    const TriangleMesh mesh =
        load_text("a.obj",
                  three_vertices + "v 9 9 9\nv 9 9 9\nvn 0 0 0\nvn 1 0 0\nf 1//1 2//2 3//1\nf 4//1 5//1 4//1\n")
            .mesh;
    EXPECT_EQ(mesh.normals[0], glm::vec3(0, 0, 1));
    EXPECT_EQ(mesh.normals[1], glm::vec3(1, 0, 0));
    EXPECT_EQ(validated(mesh), ""); // the mesh includes a degenerate triangle
}

TEST(Normals, AreCorrectInATinyMesh) { // where squared lengths underflow in floats
    TriangleMesh mesh = square();
    for (glm::vec3 &p : mesh.positions)
        p *= 1e-24f;
    EXPECT_THAT(smooth_normals(mesh), testing::Each(glm::vec3(0, 0, 1)));
}

struct SharedMesh {
    const char *file;
    std::size_t triangles;
};

class SharedMeshes : public testing::TestWithParam<SharedMesh> {};

TEST_P(SharedMeshes, HaveTheExpectedTriangleCount) {
    ARHOST_REQUIRE_SHARED_DATA("meshes");
    const TriangleMesh mesh = load_mesh(shared_data(std::string("meshes/") + GetParam().file));
    EXPECT_EQ(mesh.triangles.size(), GetParam().triangles);
    EXPECT_EQ(validated(mesh), "");
}

INSTANTIATE_TEST_SUITE_P(Real, SharedMeshes,
                         testing::Values(SharedMesh{"bunny_4968.obj", 4968}, SharedMesh{"bunny_4968.ply", 4968},
                                         SharedMesh{"bunny_69451.ply.gz", 69451}, SharedMesh{"teapot_6320.obj", 6320},
                                         SharedMesh{"lucy_99970.obj.gz", 99970}, SharedMesh{"lucy_15000.ply", 15000},
                                         SharedMesh{"buddha_100000.obj.gz", 100000},
                                         SharedMesh{"buddha_20000.obj", 20000}, SharedMesh{"dragon_20000.obj", 20000},
                                         SharedMesh{"dragon_vrip.ply.gz", 871414},
                                         SharedMesh{"dragon_vrip_res2.ply.gz", 202520},
                                         SharedMesh{"dragon_vrip_res3.ply.gz", 47794},
                                         SharedMesh{"dragon_vrip_res4.ply.gz", 11102},
                                         SharedMesh{"spot_5856.obj", 5856}, SharedMesh{"suzanne_968.obj", 968}));

struct LoaderCase {
    const char *file;
    std::size_t triangles, vertices;
    const char *message = nullptr; // expected error; null if a mesh is expected
};

class LoaderCases : public testing::TestWithParam<LoaderCase> {};

TEST_P(LoaderCases, YieldAMeshOrAClearError) {
    ARHOST_REQUIRE_SHARED_DATA("meshes/loader_cases");
    const std::filesystem::path file = shared_data(std::string("meshes/loader_cases/") + GetParam().file);
    try {
        const TriangleMesh mesh = load_mesh(file);
        EXPECT_EQ(GetParam().message, nullptr);
        EXPECT_EQ(mesh.triangles.size(), GetParam().triangles);
        EXPECT_EQ(mesh.positions.size(), GetParam().vertices);
        EXPECT_EQ(validated(mesh), "");
    } catch (const MeshError &error) {
        ASSERT_NE(GetParam().message, nullptr) << error.what();
        EXPECT_EQ(error.what(), file.string() + GetParam().message);
    }
}

namespace {
constexpr char no_mtl[] = ": the format '.mtl' is unsupported; convert the mesh to .obj, .ply or .stl (optionally "
                          "compressed: .obj.gz, .ply.gz, .stl.gz)";
constexpr char no_faces[] = ": contains no triangles: the header has no element 'face' with a list 'vertex_indices'";
constexpr char only_lines[] = ": contains no triangles, only points, lines or curves";
} // namespace

INSTANTIATE_TEST_SUITE_P(
    Real, LoaderCases,
    testing::Values(
        LoaderCase{"Spider_ascii.stl", 1368, 722}, LoaderCase{"Spider_binary.stl", 1368, 722},
        LoaderCase{"Wuson.ply", 3732, 11184}, LoaderCase{"WusonOBJ.obj", 3732, 2117}, LoaderCase{"box.obj", 12, 8},
        LoaderCase{"box_UTF16BE.obj", 0, 0, ": is UTF-16 text; save it as UTF-8 or ASCII"},
        LoaderCase{"box_longline.obj", 944, 8}, LoaderCase{"box_mat_with_spaces.obj", 12, 8},
        LoaderCase{"box_spaces.mtl", 0, 0, no_mtl}, LoaderCase{"box_without_lineending.obj", 12, 8},
        LoaderCase{"concave_polygon.mtl", 0, 0, no_mtl}, LoaderCase{"concave_polygon.obj", 64, 64},
        LoaderCase{"cube.ply", 12, 8}, LoaderCase{"cube_binary.ply", 12, 8},
        LoaderCase{"cube_mtllib_after_g.mtl", 0, 0, no_mtl}, LoaderCase{"cube_mtllib_after_g.obj", 12, 24},
        LoaderCase{"cube_usemtl.mtl", 0, 0, no_mtl}, LoaderCase{"cube_usemtl.obj", 12, 24},
        LoaderCase{"cube_uv.ply", 12, 24}, LoaderCase{"cube_with_vertexcolors.obj", 12, 24},
        LoaderCase{"cube_with_vertexcolors_uni.obj", 12, 24}, LoaderCase{"empty_mat.mtl", 0, 0, no_mtl},
        LoaderCase{"empty_mat.obj", 256, 450}, LoaderCase{"float-color.ply", 1, 3},
        LoaderCase{"issue623.ply", 0, 0, no_faces}, LoaderCase{"multiple_spaces.obj", 1, 4},
        LoaderCase{"number_formats.obj", 0, 0, ":11: '3.1+e2' is not a number"},
        LoaderCase{"point_cloud.obj", 0, 0, ": contains no triangles"}, LoaderCase{"points.ply", 0, 0, no_faces},
        LoaderCase{"regr01.mtl", 0, 0, no_mtl}, LoaderCase{"regr_3429812.mtl", 0, 0, no_mtl},
        LoaderCase{"regr_3429812.obj", 4, 4}, LoaderCase{"space_in_material_name.mtl", 0, 0, no_mtl},
        LoaderCase{"space_in_material_name.obj", 64, 64}, LoaderCase{"sphereWithHole.stl", 285, 146},
        LoaderCase{"spider.mtl", 0, 0, no_mtl}, LoaderCase{"spider.obj", 1368, 974},
        LoaderCase{"testline.obj", 0, 0, only_lines}, LoaderCase{"testmixed.obj", 12, 8},
        LoaderCase{"testpoints.obj", 0, 0, only_lines}, LoaderCase{"triangle.stl", 1, 3},
        LoaderCase{"triangle_with_empty_solid.stl", 1, 3}, LoaderCase{"triangle_with_two_solids.stl", 2, 6}));

TEST(LoaderCaseTable, CoversEveryFileInTheFolder) {
    ARHOST_REQUIRE_SHARED_DATA("meshes/loader_cases");
    const auto files = std::filesystem::directory_iterator(shared_data("meshes/loader_cases"));
    EXPECT_EQ(std::distance(begin(files), end(files)), 43);
}

// For a corrupt file, the loader must return a mesh that the validator accepts or throw a MeshError. Any other
// exception or a sanitizer finding is a bug.
TEST(MeshMutations, YieldAMeshOrAnError) {
    std::vector<std::pair<std::string, std::string>> seeds = {
        {"a.obj",
         three_vertices + "vt 0 1\nvn 0 0 1\nv 1 1 0 \\\n 1\nf 1/1/1 2/1/1 4/1/1 3/1/1\nf -1//1 -2//1 -3//1\n"},
        {"a.ply", ply_start + ply_triangle_header + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"},
        {"b.ply", binary_triangle(false)},
        {"c.ply", binary_triangle(true)},
        {"a.stl", ascii_stl},
        {"b.stl", binary_stl("solid", 2)},
        {"a.obj.gz", gzipped(three_vertices + "f 1 2 3\n")}};
    std::mt19937 random(7);
    // The folder is in memory, which makes writing thousands of files fast.
    const int memory = memfd_create("mesh", 0);
    ASSERT_GE(memory, 0);
    const ScratchFolder folder;
    for (const auto &[name, content] : seeds)
        std::filesystem::create_symlink("/proc/self/fd/" + std::to_string(memory), folder.path() / name);
    int loaded = 0, rejected = 0;
    for (int round = 0; round < 4000; ++round) {
        auto [name, content] = seeds[static_cast<std::size_t>(round) % seeds.size()];
        for (unsigned edits = 1 + random() % 2; edits > 0 && !content.empty(); --edits) {
            const std::size_t at = random() % content.size();
            switch (random() % 4) {
            case 0:
                content[at] = static_cast<char>(random());
                break;
            case 1:
                content.erase(at, random() % 8 == 0 ? std::string::npos : 1 + random() % 8);
                break;
            case 2:
                content.insert(at, content.substr(random() % content.size(), random() % 16));
                break;
            case 3:
                content[at] = "0123456789-+.e/ \n\\#"[random() % 19];
                break;
            }
        }
        ASSERT_EQ(ftruncate(memory, 0), 0);
        ASSERT_EQ(pwrite(memory, content.data(), content.size(), 0), static_cast<ssize_t>(content.size()));
        try {
            TriangleMesh mesh = load_mesh(folder.path() / name, {random() % 2 == 0});
            const bool in_limits = // the scene loader checks these limits
                std::ranges::all_of(mesh.positions, [](const glm::vec3 &p) { return glm::length(p) < 1e9f; }) &&
                std::ranges::all_of(mesh.texcoords, [](const glm::vec2 &p) { return glm::length(p) < 1e9f; });
            if (in_limits) {
                EXPECT_EQ(validated(std::move(mesh)), "");
            }
            ++loaded;
        } catch (const MeshError &) {
            ++rejected;
        }
    }
    close(memory);
    EXPECT_GT(loaded, 200);
    EXPECT_GT(rejected, 200);
}
