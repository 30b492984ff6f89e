// SPDX-License-Identifier: Apache-2.0
#include "documents.hpp"
#include "errors.hpp"
#include "gltf_samples.hpp"
#include "image_samples.hpp"
#include "plugin_under_test.hpp"
#include "scene/motion.hpp"
#include "scene/scene_loader.hpp"
#include "scene_samples.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

using namespace arhost::scene;
using namespace arhost::scene::test;
using arhost::test::ScratchFolder;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

namespace {

// Returns the same triangle with a skin of two joints: node 1, and its child node 2 at y = 1. Vertex 2 is bound to
// the second joint. In the animation "wave", node 2 rotates by 90° about z within 1 s.
Gltf skinned() {
    Gltf gltf = triangle();
    gltf.accessor(gltf.view(std::string("\0\0\0\0\0\0\0\0\1\0\0\0", 12)), 5121, 3, "VEC4"); // accessor 2
    gltf.accessor(gltf.view(std::string("\xff\0\0\0\xff\0\0\0\xff\0\0\0", 12)), 5121, 3, "VEC4",
                  R"(, "normalized": true)"); // accessor 3
    gltf.floats(
        {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, /**/ 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -1, 0, 1},
        "MAT4", 16);                                                      // 4
    gltf.floats({0, 1}, "SCALAR", 1);                                     // 5
    gltf.floats({0, 0, 0, 1, 0, 0, 0.70710678f, 0.70710678f}, "VEC4", 4); // 6
    gltf.meshes = R"({"primitives": [{"attributes": {"POSITION": 0, "JOINTS_0": 2, "WEIGHTS_0": 3}}]})";
    gltf.nodes =
        R"({"mesh": 0, "skin": 0, "translation": [50, 0, 0]}, {"children": [2]}, {"translation": [0, 1, 0]})";
    gltf.scene_nodes = "0, 1";
    gltf.more = R"(, "skins": [{"joints": [1, 2], "inverseBindMatrices": 4}], "animations": [{"name": "wave",
        "samplers": [{"input": 5, "output": 6}], "channels": [{"sampler": 0, "target": {"node": 2, "path": "rotation"}}]}])";
    return gltf;
}

} // namespace

TEST(Gltf, TransformsStaticMeshesToWorldSpace) {
    Gltf gltf = triangle();
    gltf.nodes = R"({"children": [1], "scale": [2, 2, 2]}, {"mesh": 0, "name": "leaf", "translation": [0, 0, 5]})";
    const Loaded loaded = load(gltf.text(), ", name: tree, transform: [{translate: [100, 0, 0]}]");
    const Arena &arena = loaded.arena;
    ASSERT_EQ(arena.scene().objects.count, 1u);
    EXPECT_STREQ(name(arena), "tree/leaf");
    EXPECT_THAT(vertex(arena, 0), ElementsAre(100, 0, 10));
    EXPECT_THAT(vertex(arena, 1), ElementsAre(102, 0, 10));
    EXPECT_EQ(geometry(arena).texcoords.count, 0u) << "no texture needs them";
    EXPECT_EQ(arena.scene().nodes.count, 0u);
    EXPECT_EQ(material(arena, object(arena).material).model, ARHOST_MATERIAL_METALLIC_ROUGHNESS);
    EXPECT_THAT(loaded.info, testing::Contains(HasSubstr("a.gltf: 1 triangles, 3 vertices, 2 x 2 x 0 mm")));
}

TEST(Gltf, FitsAndPlacesModels) {
    const auto corner = [](const std::string &object, const std::string &axes = "z-up") {
        const Loaded loaded = load(triangle().text(), object, axes);
        const std::vector<float> p = vertex(loaded.arena, 2);
        return glm::vec3(p[0], p[1], p[2]);
    };
    const auto is = [](const glm::vec3 &p, const glm::vec3 &expected) {
        EXPECT_LT(glm::distance(p, expected), 1e-4f);
    };
    // The triangle has the corners (0, 0, 0), (1, 0, 0) and (0, 1, 0); its y is up.
    is(corner(", unit: m"), {0, 0, 1000});
    is(corner(", fit_mm: 80"), {0, 0, 80});
    is(corner(", fit_mm: 80, place: on_ground"), {-40, 0, 80});
    is(corner(", fit_mm: 80, place: centred"), {-40, 0, 40});
    is(corner(", unit: cm, place: centred, transform: [{translate: [1, 2, 3]}]"), {-4, 2, 8});
    is(corner(", fit_mm: 80, place: on_ground", "y-up"), {-40, 80, 0});
    EXPECT_THAT(error_of(triangle().text(), ", unit: m, fit_mm: 3"),
                HasSubstr("objects[0].fit_mm: cannot be combined"));
    const Loaded skin = load(skinned().text(), ", animation: wave, fit_mm: 50, place: on_ground");
    MotionEvaluator evaluator(skin.arena.scene());
    const float *p = evaluator.at(0).deformed[0].positions;
    EXPECT_THAT(std::vector<float>(p, p + 9), ElementsAre(-25, 0, 0, 25, 0, 0, -25, 50, 0)) << "in the rest pose";
}

TEST(Gltf, WarnsOfUnlikelySizesAndModelsBelowTheGround) {
    const auto warning = [](const std::string &object) {
        const ScratchFolder folder;
        write_file(folder.path() / "a.gltf", triangle().text());
        write_file(folder.path() / "s.yaml",
                   "version: 1\naxes: y-up\nmaterials: {}\nobjects:\n  - {gltf: a.gltf" + object + "}\n");
        LoadCallbacks callbacks;
        std::string warning = "none";
        callbacks.warning = [&](const std::string &text) { warning = text; };
        load_scene(folder.path() / "s.yaml", callbacks);
        return warning;
    };
    EXPECT_THAT(warning(""), HasSubstr("a.gltf: is only 1 mm large; if its unit is not mm, add 'unit: m'"));
    EXPECT_THAT(warning(", transform: [{scale: 6000}]"), HasSubstr("a.gltf: is 6 m large; set its size"));
    EXPECT_THAT(warning(", fit_mm: 80, transform: [{translate: [0, -100, 0]}]"),
                HasSubstr("is below the ground: its highest point is at -20 mm; add 'place: on_ground'"));
    EXPECT_EQ(warning(", fit_mm: 80"), "none");
    EXPECT_EQ(warning(", role: occluder"), "none");
}

TEST(Gltf, ConvertsItsUpAxisInZUpScenes) {
    const Loaded loaded = load(triangle().text(), "", "z-up");
    EXPECT_THAT(vertex(loaded.arena, 2), ElementsAre(near(0), near(0), near(1))) << "its y is up";
}

TEST(Gltf, ReadsBinaryFiles) {
    const Loaded loaded = load(triangle().binary(), "", "y-up", "a.glb");
    EXPECT_THAT(vertex(loaded.arena, 1), ElementsAre(1, 0, 0));
}

TEST(Gltf, IgnoresBytesAfterTheLengthOfABinaryFile) {
    const Loaded loaded = load(triangle().binary() + "more", "", "y-up", "a.glb");
    EXPECT_THAT(vertex(loaded.arena, 1), ElementsAre(1, 0, 0));
    EXPECT_THROW(load(triangle().binary().substr(0, 400), "", "y-up", "a.glb"), std::exception);
}

TEST(Gltf, NamesUnsupportedExtensionsThatItDoesNotRequire) {
    Gltf gltf = triangle();
    gltf.more = R"(, "extensionsUsed": ["KHR_texture_basisu", "KHR_mesh_quantization", "KHR_xmp"])";
    EXPECT_THAT(load(gltf.text()).info,
                testing::Contains(HasSubstr("unsupported extensions are ignored: KHR_texture_basisu, KHR_xmp")));
    gltf.more = R"(, "extensionsRequired": ["KHR_mesh_quantization"])";
    EXPECT_NO_THROW(load(gltf.text()));
}

TEST(Gltf, UsesAMaterialOfTheScene) {
    const Loaded loaded = load(triangle().text(), ", material: grey, role: occluder");
    EXPECT_EQ(material(loaded.arena, object(loaded.arena).material).model, ARHOST_MATERIAL_MIRROR);
    EXPECT_EQ(object(loaded.arena).role, ARHOST_ROLE_OCCLUDER);
}

TEST(Gltf, ReadsStridesIndicesAndSparseAccessors) {
    Gltf gltf;
    const std::vector<float> interleaved = {0, 0, 0, 9, 1, 0, 0, 9, 0, 1, 0, 9, 5, 5, 5};
    const int view = gltf.view(std::string(reinterpret_cast<const char *>(interleaved.data()), 60), 16);
    const int indices = gltf.view(std::string("\3", 1));
    const float moved[] = {1, 1, 0};
    const int values = gltf.view(std::string(reinterpret_cast<const char *>(moved), 12));
    gltf.accessor(view, 5126, 4, "VEC3",
                  R"(, "sparse": {"count": 1, "indices": {"bufferView": )" + std::to_string(indices) +
                      R"(, "componentType": 5121}, "values": {"bufferView": )" + std::to_string(values) + "}}");
    gltf.accessor(gltf.view(std::string("\0\0\1\0\2\0\3\0", 8)), 5123, 4, "SCALAR");
    gltf.meshes = R"({"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": 5}]})";
    const Arena arena = load(gltf.text()).arena;
    EXPECT_THAT(vertex(arena, 2), ElementsAre(0, 1, 0));
    EXPECT_THAT(vertex(arena, 3), ElementsAre(1, 1, 0));
    ASSERT_EQ(geometry(arena).indices.count, 2u);
    const auto *triangles = elements<glm::uvec3>(arena, geometry(arena).indices);
    EXPECT_EQ(triangles[0], glm::uvec3(0, 1, 2));
    EXPECT_EQ(triangles[1], glm::uvec3(1, 3, 2)) << "a strip flips every second triangle";
}

TEST(Gltf, ReadsMaterialsAndTextures) {
    Gltf gltf = triangle();
    const std::string image = png(1, 1, 4, {1, 2, 3, 4});
    const int view = gltf.view(image);
    gltf.meshes = R"({"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]})";
    gltf.more = R"(, "materials": [{"alphaMode": "MASK", "alphaCutoff": 0.25, "emissiveFactor": [1, 0.5, 0],
        "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 1, 0.5], "metallicFactor": 0.1, "roughnessFactor": 0.2,
        "baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 0}}, "normalTexture": {"index": 1}}],
        "textures": [{"source": 0, "sampler": 0}, {"source": 0}], "samplers": [{"wrapS": 33071, "wrapT": 33648}],
        "images": [{"mimeType": "image/png", "bufferView": )" +
                std::to_string(view) + "}]";
    const Arena arena = load(gltf.text()).arena;
    const arhost_material &m = material(arena, object(arena).material);
    EXPECT_THAT(m.diffuse, ElementsAre(0.5f, 0.25f, 1));
    EXPECT_THAT(m.emission, ElementsAre(1, 0.5f, 0));
    EXPECT_EQ(m.metallic, 0.1f);
    EXPECT_EQ(m.roughness, 0.2f);
    EXPECT_EQ(m.alpha_cutoff, 0.25f);
    EXPECT_EQ(m.opacity, 0.5f);
    ASSERT_EQ(arena.scene().textures.count, 3u);
    const auto *textures = elements<arhost_texture>(arena, arena.scene().textures);
    const auto image_of = [&](std::uint32_t number) { return test::image(arena, textures[number].image); };
    EXPECT_EQ(image_of(m.colour_texture).format, ARHOST_TEXEL_SRGB8);
    EXPECT_EQ(textures[m.colour_texture].wrap_u, ARHOST_WRAP_CLAMP);
    EXPECT_EQ(textures[m.colour_texture].wrap_v, ARHOST_WRAP_MIRROR);
    EXPECT_EQ(image_of(m.metallic_roughness_texture).format, ARHOST_TEXEL_RGBA8);
    EXPECT_EQ(textures[m.normal_texture].wrap_u, ARHOST_WRAP_REPEAT);
    EXPECT_EQ(m.emission_texture, ARHOST_NONE);
    EXPECT_EQ(elements<std::uint8_t>(arena, image_of(m.colour_texture).texels)[2], 3);
}

TEST(Gltf, ReportsAllFilesItReads) {
    const ScratchFolder folder;
    Gltf gltf = triangle();
    gltf.meshes = R"({"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]})";
    gltf.more = R"(, "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}], "images": [{"uri": "inner.png"}])";
    write_file(folder.path() / "a.gltf", gltf.json(R"(, "uri": "a.bin")"));
    write_file(folder.path() / "a.bin", gltf.bytes);
    write_file(folder.path() / "a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    write_file(folder.path() / "sky.hdr", hdr(1, 1, "abcd"));
    for (const char *image : {"inner.png", "wood.png"})
        write_file(folder.path() / image, png(1, 1, 4, {1, 2, 3, 4}));
    write_file(folder.path() / "s.yaml", "version: 1\naxes: y-up\nenvironment: {image: sky.hdr}\n"
                                         "materials: {m: {model: diffuse, texture: wood.png}, n: {model: mirror}}\n"
                                         "objects: [{gltf: a.gltf}, {mesh: a.obj, material: n}]\n");
    std::vector<std::string> read;
    LoadCallbacks callbacks;
    callbacks.reads = [&](const std::filesystem::path &file) {
        EXPECT_EQ(file.parent_path(), folder.path());
        read.push_back(file.filename().string());
    };
    load_scene(folder.path() / "s.yaml", callbacks);
    EXPECT_THAT(read, testing::UnorderedElementsAre("sky.hdr", "wood.png", "a.gltf", "a.bin", "inner.png", "a.obj"));
}

// A glTF file may come from somebody else: its buffers and images must not be files of the user.
// Names of a file outside of the folder of a glTF file.
constexpr const char *outside_of_the_folder[] = {"../../home/.ssh/id_rsa",  "parts/../../../home/.ssh/id_rsa",
                                                 "../models-secret.bin",    "file-link.bin",
                                                 "folder-link/.ssh/id_rsa", "%2e%2e/%2e%2e/home/.ssh/id_rsa"};

TEST(Gltf, ReadsOnlyFilesBelowItsFolderAndThoseTheCallerGrants) {
    namespace fs = std::filesystem;
    const ScratchFolder folder;
    const Gltf gltf = triangle();
    for (const char *sub : {"scene/models/parts", "home/.ssh"})
        fs::create_directories(folder.path() / sub);
    write_file(folder.path() / "home/.ssh/id_rsa", gltf.bytes);
    write_file(folder.path() / "scene/models/parts/a.bin", gltf.bytes);
    write_file(folder.path() / "scene/models-secret.bin", gltf.bytes);
    fs::create_symlink(folder.path() / "home/.ssh/id_rsa", folder.path() / "scene/models/file-link.bin");
    fs::create_directory_symlink(folder.path() / "home", folder.path() / "scene/models/folder-link");
    fs::create_symlink("parts/a.bin", folder.path() / "scene/models/inner-link.bin");
    const auto error_with = [&](const std::string &uri, const std::vector<fs::path> &readable = {},
                                const std::string &key = "") {
        write_file(folder.path() / "scene/models/a.gltf", gltf.json(R"(, "uri": ")" + uri + "\""));
        write_file(folder.path() / "scene/s.yaml",
                   "version: 1\naxes: y-up\nmaterials: {}\n" + key + "objects:\n  - {gltf: models/a.gltf}\n");
        return arhost::test::error_of([&] { load_scene(folder.path() / "scene/s.yaml", {}, readable); });
    };
    for (const char *inside : {"parts/a.bin", "parts/../parts/a.bin", "inner-link.bin"})
        EXPECT_EQ(error_with(inside), "no error") << inside;
    for (const char *outside : outside_of_the_folder)
        EXPECT_THAT(error_with(outside),
                    testing::AllOf(HasSubstr("a.gltf: refers to '"),
                                   HasSubstr("', which is outside its folder; move that file there, or list it under "
                                             "'reads' of the ray tracer in the configuration")))
            << outside;
    for (const char *granted : {"home", "home/.ssh/id_rsa", "scene/models/folder-link"})
        EXPECT_EQ(error_with("../../home/.ssh/id_rsa", {folder.path() / granted}), "no error") << granted;
    EXPECT_THAT(error_with("../../home/.ssh/id_rsa", {folder.path() / "scene/models", folder.path() / "none"}),
                HasSubstr("is outside its folder"));
    EXPECT_THAT(
        error_with("parts/a.bin", {}, "reads: [../home]\n"),
        HasSubstr("s.yaml:4:8: reads: a scene grants nothing; list these files under 'reads' of the ray tracer"));
}

// Prints the table if docs/security.md does not contain it.
TEST(SecurityDocumentation, ListsTheFilesThatGltfAsksFor) {
    std::string table;
    for (const char *outside : outside_of_the_folder)
        table += std::string("| glTF | `{\"uri\": \"") + outside +
                 "\"}` | a file outside its folder | `Gltf.ReadsOnlyFilesBelowItsFolderAndThoseTheCallerGrants` |\n";
    EXPECT_THAT(arhost::test::read_document("security.md"), HasSubstr(table));
}

// Returns a textured triangle with two sets of texture coordinates and vertex colours. `material`: JSON of its
// material.
std::string with_material(const std::string &material, const std::string &more = "") {
    Gltf gltf = triangle();
    const int view = gltf.view(png(1, 1, 4, {1, 2, 3, 4}));
    gltf.floats({0, 0, 2, 0, 0, 4}, "VEC2", 2); // accessor 2
    gltf.accessor(gltf.view(std::string("\xff\0\0\0\0\xff\0\0\x80\x80\x80\0", 12), 4), 5121, 3, "VEC3",
                  R"(, "normalized": true)"); // accessor 3
    gltf.meshes = R"({"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1, "TEXCOORD_1": 2, "COLOR_0": 3},
        "material": 0}]})";
    gltf.more = R"(, "materials": [)" + material + R"(], "textures": [{"source": 0}],
        "images": [{"mimeType": "image/png", "bufferView": )" +
                std::to_string(view) + "}]" + more;
    return gltf.text();
}

arhost_material material_of(const std::string &json) {
    const Arena arena = load(with_material(json)).arena;
    return material(arena, object(arena).material);
}

TEST(Gltf, ReadsOpacity) {
    const auto with = [](const std::string &properties) {
        return material_of(R"({"pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.2]})" + properties + "}");
    };
    EXPECT_EQ(with("").opacity, 1) << "opaque";
    EXPECT_EQ(with("").blends, 0u);
    EXPECT_EQ(with(R"(, "alphaMode": "BLEND")").opacity, 0.2f);
    EXPECT_EQ(with(R"(, "alphaMode": "BLEND")").blends, 1u);
    EXPECT_EQ(with(R"(, "alphaMode": "MASK")").alpha_cutoff, 0.5f);
    EXPECT_EQ(with(R"(, "alphaMode": "MASK", "alphaCutoff": 3)").opacity, 0) << "cuts out everything";
}

TEST(Gltf, ReadsMaterialExtensions) {
    const auto extension = [](const std::string &name, const std::string &properties) {
        return material_of(R"({"emissiveFactor": [0, 0.5, 1], "extensions": {")" + name + "\": " + properties + "}}");
    };
    EXPECT_EQ(extension("KHR_materials_unlit", "{}").model, ARHOST_MATERIAL_UNLIT);
    EXPECT_EQ(extension("KHR_materials_emissive_strength", R"({"emissiveStrength": 8})").emission[1], 4);
    EXPECT_EQ(extension("KHR_materials_ior", R"({"ior": 1.3})").index, 1.3f);
    EXPECT_NEAR(extension("KHR_materials_ior", R"({"ior": 0})").specular[0] * 0.04, 1, 1e-6) << "an infinite index";
    const arhost_material specular =
        extension("KHR_materials_specular",
                  R"({"specularFactor": 0.5, "specularColorFactor": [2, 1, 0], "specularTexture": {"index": 0}})");
    EXPECT_EQ(specular.specular_weight, 0.5f);
    EXPECT_THAT(specular.specular, ElementsAre(2, 1, 0));
    EXPECT_EQ(specular.specular_texture, 0u);
    const arhost_material coated = extension(
        "KHR_materials_clearcoat",
        R"({"clearcoatFactor": 0.75, "clearcoatRoughnessFactor": 0.5, "clearcoatNormalTexture": {"index": 0, "scale": 2}})");
    EXPECT_EQ(coated.clearcoat, 0.75f);
    EXPECT_EQ(coated.clearcoat_roughness, 0.5f);
    EXPECT_EQ(coated.clearcoat_normal_scale, 2);
    const arhost_material cloth =
        extension("KHR_materials_sheen", R"({"sheenColorFactor": [0.5, 1, 0], "sheenColorTexture": {"index": 0},
            "sheenRoughnessFactor": 0.25, "sheenRoughnessTexture": {"index": 0}})");
    EXPECT_THAT(cloth.sheen, ElementsAre(0.5f, 1, 0));
    EXPECT_EQ(cloth.sheen_roughness, 0.25f);
    EXPECT_EQ(cloth.sheen_texture, cloth.sheen_roughness_texture) << "one image";
    const arhost_material brushed =
        extension("KHR_materials_anisotropy", R"({"anisotropyStrength": 0.5, "anisotropyRotation": 1.5707964})");
    EXPECT_EQ(brushed.anisotropy, 0.5f);
    EXPECT_NEAR(brushed.anisotropy_direction[0], 0, 1e-6);
    EXPECT_NEAR(brushed.anisotropy_direction[1], 1, 1e-6);
    const arhost_material film =
        extension("KHR_materials_iridescence", R"({"iridescenceFactor": 0.5, "iridescenceThicknessMaximum": 800})");
    EXPECT_EQ(film.iridescence, 0.5f);
    EXPECT_EQ(film.iridescence_index, 1.3f);
    EXPECT_THAT(film.iridescence_thickness_nm, ElementsAre(100, 800));
}

TEST(Gltf, GivesNormalMapsTangents) {
    const auto tangents = [](const std::string &attributes, const std::string &texture) {
        Gltf gltf = triangle();
        const int view = gltf.view(png(1, 1, 4, {1, 2, 3, 4}));
        gltf.floats({0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3", 3);             // accessor 2
        gltf.floats({0, 2, 0, -1, 0, 2, 0, -1, 0, 2, 0, -1}, "VEC4", 4); // accessor 3
        gltf.meshes = R"({"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1)" + attributes +
                      R"(}, "material": 0}]})";
        gltf.more = R"(, "materials": [{"normalTexture": {"index": 0)" + texture +
                    R"(}}], "textures": [{"source": 0}], "images": [{"mimeType": "image/png", "bufferView": )" +
                    std::to_string(view) + "}]";
        const Arena arena = load(gltf.text()).arena;
        const arhost_buffer &buffer = geometry(arena).tangents;
        const auto *first = reinterpret_cast<const glm::vec4 *>(arena.bytes().data() + buffer.offset);
        return std::vector<glm::vec4>(first, first + buffer.count);
    };
    const std::string normals = R"(, "NORMAL": 2)";
    EXPECT_EQ(tangents(normals, ""), std::vector<glm::vec4>(3, {1, 0, 0, -1}));
    EXPECT_EQ(tangents(normals + R"(, "TANGENT": 3)", ""), std::vector<glm::vec4>(3, {0, 1, 0, -1})) << "the file's";
    EXPECT_TRUE(tangents("", "").empty()) << "flat shading";
    EXPECT_TRUE(tangents(normals, R"(, "extensions": {"KHR_texture_transform": {"rotation": 1}})").empty());
}

TEST(Gltf, ReadsLights) {
    const auto with = [](const std::string &light, const std::string &node = "") {
        Gltf gltf = triangle();
        gltf.nodes =
            R"({"mesh": 0}, {"translation": [1, 2, 3], "extensions": {"KHR_lights_punctual": {"light": 0}})" + node +
            "}";
        gltf.scene_nodes = "0, 1";
        gltf.more = R"(, "extensions": {"KHR_lights_punctual": {"lights": [)" + light + "]}}";
        return gltf.text();
    };
    const auto scene_of = [](const std::string &gltf, const std::string &keys, const char *version = "2") {
        const ScratchFolder folder;
        write_file(folder.path() / "a.gltf", gltf);
        write_file(folder.path() / "s.yaml", std::string("version: ") + version +
                                                 "\naxes: y-up\nmaterials: {}\nobjects: [{gltf: a.gltf" + keys +
                                                 "}]\n");
        return build(load_scene(folder.path() / "s.yaml"));
    };
    const auto light_of = [&](const std::string &light, const std::string &node = "") {
        const Arena arena = scene_of(with(light, node), ", unit: m");
        EXPECT_EQ(arena.scene().lights.count, 1u);
        return *reinterpret_cast<const arhost_light *>(arena.bytes().data() + arena.scene().lights.offset);
    };
    // 3 cd at a distance of 2 m: 3/4 lx, a radiance of 3/4 / π of white surfaces.
    const arhost_light point = light_of(R"({"type": "point", "intensity": 3, "color": [1, 0.5, 0]})");
    EXPECT_EQ(point.type, ARHOST_LIGHT_POINT);
    EXPECT_THAT(point.position, ElementsAre(1000, 2000, 3000));
    EXPECT_NEAR(point.intensity[0] / (2000.0 * 2000.0), 0.75 / std::numbers::pi, 1e-6);
    EXPECT_NEAR(point.intensity[1] / point.intensity[0], 0.5, 1e-6);
    const arhost_light sun =
        light_of(R"({"type": "directional", "intensity": 2})", R"(, "rotation": [0, 0.70710678, 0, 0.70710678])");
    EXPECT_THAT(sun.direction, ElementsAre(near(-1), near(0), near(0)));
    EXPECT_NEAR(sun.intensity[0], 2 / std::numbers::pi, 1e-6);
    const arhost_light spot = light_of(R"({"type": "spot", "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.2}})");
    EXPECT_NEAR(spot.cosine_inner, std::cos(0.1), 1e-6);
    EXPECT_NEAR(spot.cosine_outer, std::cos(0.2), 1e-6);

    const std::string any = with(R"({"type": "point"})");
    EXPECT_EQ(scene_of(any, ", lights: false").scene().lights.count, 0u);
    EXPECT_EQ(scene_of(any, "", "1").scene().lights.count, 0u) << "integrator: whitted";
    EXPECT_EQ(scene_of(any, ", on: cube").scene().lights.count, 0u) << "moves";
    const auto error_of = [&](const std::string &gltf) {
        return arhost::test::error_of([&] { scene_of(gltf, ""); });
    };
    EXPECT_THAT(error_of(with(R"({"type": "lamp"})")),
                HasSubstr("lights[0].type: must be point, spot or directional"));
    EXPECT_THAT(error_of(with("")),
                HasSubstr("nodes[1].extensions.KHR_lights_punctual.light: the file has only 0 lights"));
    EXPECT_THAT(error_of(with(R"({"type": "spot", "spot": {"innerConeAngle": 1}})")),
                HasSubstr("innerConeAngle: must not exceed outerConeAngle"));
}

TEST(Gltf, ReadsThinWallsAndVolumes) {
    const auto with = [](const std::string &volume) {
        return with_material(R"({"extensions": {"KHR_materials_transmission": {"transmissionFactor": 0.5})" + volume +
                             "}}");
    };
    const std::string volume = R"(, "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 2,
        "attenuationColor": [1, 0.5, 0.25]})";
    const Loaded thin = load(with("")), solid = load(with(volume), ", transform: [{scale: 10}]");
    EXPECT_EQ(material(thin.arena, 1).transmission, 0.5f);
    EXPECT_EQ(material(thin.arena, 1).thin_walled, 1u);
    EXPECT_EQ(material(solid.arena, 1).thin_walled, 0u);
    EXPECT_THAT(material(solid.arena, 1).extinction,
                ElementsAre(0, near(std::log(2.f) / 20), near(std::log(4.f) / 20)))
        << "the distance is scaled, too";
}

TEST(Gltf, ReadsTextureTransformsSetsAndVertexColours) {
    const Loaded loaded =
        load(with_material(R"({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "extensions":
        {"KHR_texture_transform": {"offset": [0.25, 0.5], "rotation": 1.5707963, "scale": [2, 3], "texCoord": 1}}}},
        "normalTexture": {"index": 0, "scale": 0.5}})"));
    const Arena &arena = loaded.arena;
    const arhost_material &m = material(arena, object(arena).material);
    const arhost_texture &colour = texture(arena, m.colour_texture);
    EXPECT_EQ(colour.texcoord_set, 1u);
    EXPECT_THAT(colour.image_from_texcoord, ElementsAre(near(0), near(-2), near(3), near(0), 0.25f, 0.5f));
    EXPECT_EQ(texture(arena, m.normal_texture).texcoord_set, 0u);
    EXPECT_EQ(m.normal_scale, 0.5f);
    EXPECT_EQ(arena.scene().images.count, 2u) << "as a colour and as data";
    ASSERT_EQ(geometry(arena).texcoords.count, 6u);
    EXPECT_EQ(elements<glm::vec2>(arena, geometry(arena).texcoords)[2], glm::vec2(0, 1)) << "v starts at the top";
    EXPECT_EQ(elements<glm::vec2>(arena, geometry(arena).texcoords)[5], glm::vec2(0, 4));
    ASSERT_EQ(geometry(arena).colours.count, 3u);
    EXPECT_EQ(elements<glm::u16vec4>(arena, geometry(arena).colours)[0], glm::u16vec4(65535, 0, 0, 65535));
    EXPECT_EQ(elements<glm::u16vec4>(arena, geometry(arena).colours)[2].z, 32896);
}

TEST(Gltf, MalformedMaterialsAreRefusedWithTheirPath) {
    const auto error = [](const std::string &material) { return error_of(with_material(material)); };
    EXPECT_THAT(error(R"({"alphaMode": "HASHED"})"),
                HasSubstr("a.gltf: materials[0].alphaMode: must be OPAQUE, MASK or BLEND"));
    EXPECT_THAT(error(R"({"alphaMode": "MASK", "alphaCutoff": -1})"),
                HasSubstr("materials[0].alphaCutoff: must be a number from 0 to 1e+09"));
    EXPECT_THAT(error(R"({"pbrMetallicRoughness": {"metallicFactor": "no"}})"),
                HasSubstr("materials[0].pbrMetallicRoughness.metallicFactor: must be a number from 0 to 1"));
    EXPECT_THAT(error(R"({"pbrMetallicRoughness": {"baseColorFactor": [1, 1, 2, 1]}})"),
                HasSubstr("materials[0].pbrMetallicRoughness.baseColorFactor[2]: must be a number from 0 to 1"));
    EXPECT_THAT(error(R"({"extensions": {"KHR_materials_specular": {"specularColorFactor": [1, 1]}}})"),
                HasSubstr("KHR_materials_specular.specularColorFactor: must have 3 numbers"));
    EXPECT_THAT(error(R"({"extensions": {"KHR_materials_ior": {"ior": 0.5}}})"),
                HasSubstr("materials[0].extensions.KHR_materials_ior.ior: must be 0, or 1 or greater"));
    EXPECT_THAT(error(R"({"normalTexture": {"index": -1}})"),
                HasSubstr("materials[0].normalTexture.index: must be an index, 0 or greater"));
    EXPECT_THAT(error(R"({"normalTexture": {"index": 0, "texCoord": 16}})"),
                HasSubstr("materials[0].normalTexture.texCoord: must be 0 to 15"));
    EXPECT_THAT(error(R"({"doubleSided": 1})"), HasSubstr("materials[0].doubleSided: must be true or false"));
}

TEST(Gltf, HidesBackFacesOfOpenMeshesOnly) {
    const auto hides = [](const std::string &material, const std::string &indices, const std::string &object = "") {
        Gltf gltf = triangle();
        gltf.floats({0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1}, "VEC3", 3); // accessor 2: corners of a tetrahedron
        gltf.accessor(gltf.view(indices), 5121, static_cast<int>(indices.size()), "SCALAR");
        gltf.meshes = R"({"primitives": [{"attributes": {"POSITION": 2}, "indices": 3, "material": 0}]})";
        gltf.more = R"(, "materials": [)" + material + "]";
        return arhost::scene::test::object(load(gltf.text(), object).arena).hides_back_faces != 0;
    };
    EXPECT_FALSE(hides(R"({"extensions": {"KHR_materials_transmission": {"transmissionFactor": 1},
        "KHR_materials_volume": {"thicknessFactor": 1}}})",
                       std::string("\0\1\2", 3)))
        << "the back faces of a volume end it";
    const std::string open("\0\1\2", 3), closed("\0\2\1\0\1\3\0\3\2\1\2\3", 12),
        inside_out("\0\1\2\0\3\1\0\2\3\1\3\2", 12);
    EXPECT_TRUE(hides("{}", open));
    EXPECT_FALSE(hides(R"({"doubleSided": true})", open));
    EXPECT_FALSE(hides("{}", closed));
    EXPECT_TRUE(hides("{}", inside_out));
    EXPECT_FALSE(hides("{}", open, ", material: grey")) << "materials of the scene are double-sided";
}

TEST(Gltf, SkipsMeshesWithoutPrimitivesAndRefusesPrimitivesWithoutAttributes) {
    Gltf gltf = triangle();
    gltf.meshes += ", {}";
    gltf.nodes += R"(, {"mesh": 1})";
    gltf.scene_nodes = "0, 1";
    EXPECT_EQ(load(gltf.text()).arena.scene().objects.count, 1u);
    gltf.meshes = R"({"primitives": [{"material": 0}, {"attributes": {"POSITION": 0}}]})";
    gltf.nodes = R"({"mesh": 0})";
    gltf.scene_nodes = "0";
    EXPECT_THAT(error_of(gltf.text()), HasSubstr("meshes[0]: has a primitive without attributes"));
}

TEST(Gltf, PlacesASingleInstance) {
    Gltf gltf = triangle();
    gltf.floats({100, 50, 0}, "VEC3", 3); // accessor 2
    gltf.nodes = R"({"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 2}}}})";
    const Arena arena = load(gltf.text()).arena;
    EXPECT_EQ(object(arena).world_from_object[9], 100);
    EXPECT_EQ(object(arena).world_from_object[10], 50);
}

TEST(Gltf, ChoosesAVariant) {
    const auto diffuse = [](const std::string &object) {
        Gltf gltf = triangle();
        gltf.meshes = R"({"primitives": [{"attributes": {"POSITION": 0}, "material": 0, "extensions":
            {"KHR_materials_variants": {"mappings": [{"material": 1, "variants": [1]}]}}}]})";
        gltf.more =
            R"(, "materials": [{}, {"name": "paint", "pbrMetallicRoughness": {"baseColorFactor": [0, 1, 0, 1]}}],
            "extensions": {"KHR_materials_variants": {"variants": [{"name": "beach"}, {"name": "street"}]}})";
        const Loaded loaded = load(gltf.text(), object);
        EXPECT_THAT(loaded.contents.variants, ElementsAre("beach", "street"));
        EXPECT_THAT(loaded.contents.materials.back(), object.ends_with("street") ? "paint" : "");
        if (object.empty()) {
            EXPECT_THAT(loaded.info,
                        Contains(HasSubstr("no variant selected; available for 'variant': 'beach', 'street'")));
        }
        return material(loaded.arena, arhost::scene::test::object(loaded.arena).material).diffuse[0];
    };
    EXPECT_EQ(diffuse(""), 1);
    EXPECT_EQ(diffuse(", variant: beach"), 1);
    EXPECT_EQ(diffuse(", variant: street"), 0);
    try {
        diffuse(", variant: snow");
        FAIL();
    } catch (const std::exception &error) {
        EXPECT_THAT(error.what(), AllOf(HasSubstr("objects[0].variant"),
                                        HasSubstr("has no variant 'snow'; available: 'beach', 'street'")));
    }
}

TEST(Gltf, StoresMeshesOfSeveralNodesAndInstancesOnce) {
    Gltf gltf = triangle();
    gltf.floats({1, 0, 0, 0, 2, 0, 0, 0, 3}, "VEC3", 3); // accessor 2: translations
    gltf.floats({1, 1, 1, 2, 2, 2, 3, 3, 3}, "VEC3", 3); // accessor 3: scales
    gltf.nodes = R"({"mesh": 0, "translation": [10, 0, 0], "extensions": {"EXT_mesh_gpu_instancing":
        {"attributes": {"TRANSLATION": 2, "SCALE": 3}}}}, {"mesh": 0, "name": "last"})";
    gltf.scene_nodes = "0, 1";
    const Loaded loaded = load(gltf.text(), ", name: field, transform: [{scale: 2}]");
    const Arena &arena = loaded.arena;
    ASSERT_EQ(arena.scene().objects.count, 4u);
    EXPECT_EQ(arena.scene().geometries.count, 1u);
    EXPECT_THAT(std::span(object(arena, 1).world_from_object), ElementsAre(4, 0, 0, 0, 4, 0, 0, 0, 4, 20, 4, 0));
    EXPECT_EQ(object(arena, 3).world_from_object[0], 2);
    EXPECT_STREQ(arhost::scene::test::name(arena, 3), "field/last");
    EXPECT_THAT(loaded.info, Contains(HasSubstr("4 triangles, 12 vertices, 26 x 8 x 6 mm")));
    EXPECT_EQ(load(gltf.text(), ", on: card").arena.scene().objects.count, 4u) << "of a target";
}

TEST(Gltf, IsStaticWithoutAnAnimation) {
    const Loaded loaded = load(skinned().text());
    EXPECT_EQ(loaded.arena.scene().duration_s, 0);
    ASSERT_EQ(loaded.contents.animations.size(), 1u);
    EXPECT_EQ(loaded.contents.animations[0].name, "wave");
    EXPECT_GT(loaded.contents.nodes, 0u);
    EXPECT_EQ(object(loaded.arena).deforms, 0u);
    EXPECT_EQ(geometry(loaded.arena).joints.count, 0u);
    EXPECT_THAT(vertex(loaded.arena, 2), ElementsAre(0, 1, 0)) << "the transform of a skinned node is ignored";
    EXPECT_THAT(loaded.info,
                testing::Contains(HasSubstr("no animation selected; available for 'animation': 0 'wave'")));
}

TEST(Gltf, DeformsSkinsAccordingToTheAnimation) {
    for (const std::string animation : {"wave", "0"}) {
        const Loaded loaded = load(skinned().text(), ", animation: " + animation +
                                                         ", transform: [{scale: 10}, {translate: [1, 2, 3]}]");
        const Arena &arena = loaded.arena;
        EXPECT_EQ(arena.scene().duration_s, 1);
        EXPECT_EQ(object(arena).deforms, 1u);
        EXPECT_EQ(object(arena).moves, 0u);
        MotionEvaluator evaluator(arena.scene());
        const arhost_motion motion = evaluator.at(0.5);
        ASSERT_EQ(motion.deformed_count, 1u);
        const float *p = motion.deformed[0].positions;
        EXPECT_THAT(std::vector<float>(p, p + 9), ElementsAre(1, 2, 3, 11, 2, 3, near(1), near(12), near(3)));
        EXPECT_EQ(arena.scene().bounds_max[0], 11);
    }
}

TEST(Gltf, MovesRigidNodesAndTheirDescendants) {
    Gltf gltf = triangle();
    const int times = gltf.floats({0, 2}, "SCALAR", 1), translations = gltf.floats({0, 0, 0, 0, 4, 0}, "VEC3", 3);
    gltf.nodes = R"({"children": [1]}, {"mesh": 0, "translation": [7, 0, 0]}, {"mesh": 0})";
    gltf.scene_nodes = "0, 2";
    gltf.more = R"(, "animations": [{"samplers": [{"input": )" + std::to_string(times) + R"(, "output": )" +
                std::to_string(translations) +
                R"(}], "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]}])";
    const Arena arena = load(gltf.text(), ", animation: 0, transform: [{scale: 10}]").arena;
    ASSERT_EQ(arena.scene().objects.count, 2u);
    EXPECT_EQ(object(arena, 0).moves, 1u);
    EXPECT_EQ(object(arena, 1).moves, 0u) << "no ancestor is animated";
    MotionEvaluator evaluator(arena.scene());
    const arhost_motion motion = evaluator.at(1);
    ASSERT_EQ(motion.moved_count, 1u);
    EXPECT_THAT(motion.moved[0].world_from_object, ElementsAre(10, 0, 0, 0, 10, 0, 0, 0, 10, 70, 20, 0));
}

TEST(Gltf, MorphsAccordingToTheAnimation) {
    Gltf gltf = triangle();
    const int target = gltf.floats({0, 0, 0, 0, 0, 2, 0, 0, 0}, "VEC3", 3);
    const int times = gltf.floats({0, 1}, "SCALAR", 1), weights = gltf.floats({0, 1}, "SCALAR", 1);
    gltf.meshes = R"({"weights": [0.5], "primitives": [{"attributes": {"POSITION": 0}, "targets": [{"POSITION": )" +
                  std::to_string(target) + "}]}]}";
    EXPECT_THAT(vertex(load(gltf.text()).arena, 1), ElementsAre(1, 0, 1)) << "the rest pose uses the mesh's weights";
    gltf.more = R"(, "animations": [{"samplers": [{"input": )" + std::to_string(times) + R"(, "output": )" +
                std::to_string(weights) +
                R"(}], "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}]}])";
    const Arena arena = load(gltf.text(), ", animation: 0").arena;
    MotionEvaluator evaluator(arena.scene());
    EXPECT_EQ(evaluator.at(0.25).deformed[0].positions[5], 0.5f);
}

// Two animations: "rise" moves node 0 along y by 4 within 2 s, "slide" moves node 1 along x by 3 within 1 s.
Loaded with_two_animations(const std::string &object) {
    Gltf gltf = triangle();
    const int two = gltf.floats({0, 2}, "SCALAR", 1), one = gltf.floats({0, 1}, "SCALAR", 1);
    const int up = gltf.floats({0, 0, 0, 0, 4, 0}, "VEC3", 3), aside = gltf.floats({0, 0, 0, 3, 0, 0}, "VEC3", 3);
    gltf.nodes = R"({"mesh": 0}, {"mesh": 0})";
    gltf.scene_nodes = "0, 1";
    const auto animation = [](const char *name, int input, int output, int node) {
        return std::string(R"({"name": ")") + name + R"(", "samplers": [{"input": )" + std::to_string(input) +
               R"(, "output": )" + std::to_string(output) +
               R"(}], "channels": [{"sampler": 0, "target": {"path": "translation", "node": )" +
               std::to_string(node) + "}}]}";
    };
    gltf.more =
        R"(, "animations": [)" + animation("rise", two, up, 0) + ", " + animation("slide", one, aside, 1) + "]";
    return load(gltf.text(), object);
}

TEST(Gltf, PlaysSeveralAnimationsEachWithItsPeriod) {
    for (const char *all : {", animation: all", ", animation: [slide, rise]"}) {
        const Loaded loaded = with_two_animations(all);
        EXPECT_EQ(loaded.arena.scene().duration_s, 2);
        MotionEvaluator evaluator(loaded.arena.scene());
        const arhost_motion motion = evaluator.at(1.5);
        ASSERT_EQ(motion.moved_count, 2u);
        EXPECT_EQ(motion.moved[0].world_from_object[10], 3);
        EXPECT_EQ(motion.moved[1].world_from_object[9], 1.5f) << "in its second period";
    }
    EXPECT_EQ(object(with_two_animations(", animation: slide").arena, 0).moves, 0u);
}

TEST(Gltf, AnimationsPlayOnceAndFasterIfAsked) {
    const auto height = [](const std::string &object, double time_s) {
        const Loaded loaded = with_two_animations(", animation: rise" + object);
        MotionEvaluator evaluator(loaded.arena.scene());
        return evaluator.at(time_s).moved[0].world_from_object[10];
    };
    EXPECT_EQ(height("", 2.5), 1);
    EXPECT_EQ(height(", loop: false", 2.5), 4);
    EXPECT_EQ(height(", speed: 2", 0.5), 2);
    EXPECT_EQ(height(", speed: 0.5, loop: false", 3), 3);
    EXPECT_THAT(error_of(triangle().text(), ", loop: false"), HasSubstr("is only allowed with 'animation'"));
}

TEST(Gltf, BindsVerticesToMoreThanFourJoints) {
    Gltf gltf = skinned();
    gltf.accessor(gltf.view(std::string("\0\0\0\0\0\0\0\0\0\0\0\0", 12)), 5121, 3, "VEC4"); // 7
    gltf.accessor(gltf.view(std::string("\xff\0\0\0\xff\0\0\0\xff\0\0\0", 12)), 5121, 3, "VEC4",
                  R"(, "normalized": true)"); // 8
    gltf.meshes = R"({"primitives": [{"attributes":
        {"POSITION": 0, "JOINTS_0": 2, "WEIGHTS_0": 3, "JOINTS_1": 7, "WEIGHTS_1": 8}}]})";
    const Arena arena = load(gltf.text(), ", animation: wave").arena;
    EXPECT_EQ(geometry(arena).weights.count, 6u);
    MotionEvaluator evaluator(arena.scene());
    // The other joint, which does not move, has half of the weight of each vertex.
    const float *p = evaluator.at(1).deformed[0].positions;
    EXPECT_THAT(std::vector<float>(p + 6, p + 9), ElementsAre(near(0), near(1), near(0)));
    const float *second = evaluator.at(0).deformed[0].positions;
    EXPECT_THAT(std::vector<float>(second, second + 3), ElementsAre(0, 0, 0));
}

TEST(Gltf, CombinesItsAnimationWithAMotion) {
    const Arena arena =
        load(skinned().text(), ", animation: wave, motion: {keys: [{at_s: 0}, {at_s: 4, translate: [0, 0, 8]}]}")
            .arena;
    EXPECT_EQ(arena.scene().duration_s, 4);
    MotionEvaluator evaluator(arena.scene());
    EXPECT_EQ(evaluator.at(1).deformed[0].positions[2], 2);
}

TEST(Gltf, ErrorsNameTheProblem) {
    EXPECT_THAT(error_of("{"), HasSubstr("s.yaml:5:12: objects[0].gltf: "));
    EXPECT_THAT(error_of("{"), HasSubstr("cannot be loaded as glTF 2.0: "));
    const auto with_uri = [](const std::string &uri) {
        return R"({"asset": {"version": "2.0"}, "buffers": [{"byteLength": 36, "uri": ")" + uri + R"("}]})";
    };
    EXPECT_THAT(error_of(with_uri("/nonexistent/a.bin")), HasSubstr("write a path relative to the glTF file"));
    EXPECT_THAT(error_of(with_uri("https://example.org/a.bin")), HasSubstr("arhost downloads nothing"));
    EXPECT_THAT(error_of("glTF\2"), HasSubstr("cannot be loaded as glTF 2.0: "));
    EXPECT_THAT(error_of(skinned().text(), ", animation: jump"), HasSubstr("objects[0].animation: "));
    EXPECT_THAT(error_of(skinned().text(), ", animation: jump"),
                HasSubstr("has no animation 'jump'; available: 0 'wave'"));
    EXPECT_THAT(error_of(triangle().text(), ", animation: 0"),
                HasSubstr("has no animation '0'; the file has no animations"));
    const auto error_after = [](const auto &corrupt) {
        Gltf gltf = skinned();
        corrupt(gltf);
        return error_of(gltf.text(), ", animation: wave");
    };
    const auto replace = [](std::string &in, const std::string &what, const std::string &by) {
        in.replace(in.find(what), what.size(), by);
    };
    EXPECT_THAT(error_after([](Gltf &g) { g.meshes = R"({"primitives": [{"attributes": {"POSITION": 99}}]})"; }),
                HasSubstr("refers to accessor 99, but the file has only 7"));
    EXPECT_THAT(error_after([&](Gltf &g) { replace(g.accessors, "\"count\": 3", "\"count\": 300"); }),
                HasSubstr("POSITION (accessor 0) extends past the end of its buffer"));
    EXPECT_THAT(error_after([&](Gltf &g) { replace(g.accessors, "VEC3", "VEC2"); }),
                HasSubstr("POSITION (accessor 0) must have elements of the type VEC3"));
    EXPECT_THAT(error_after([&](Gltf &g) { replace(g.accessors, "5126", "5130"); }),
                HasSubstr("double-precision components"));
    EXPECT_THAT(error_after([&](Gltf &g) {
                    replace(g.accessors, "\"bufferView\": 0, ", "");
                    replace(g.accessors, "\"count\": 3", "\"count\": 2000000000");
                }),
                HasSubstr("too many elements"));
    EXPECT_THAT(error_after([&](Gltf &g) { replace(g.views, "\"byteOffset\": 0", "\"byteOffset\": 100000"); }),
                HasSubstr("extends past the end"));
    EXPECT_THAT(error_after([](Gltf &g) { g.scene_nodes = "0"; }),
                HasSubstr("joint 1, which is not in the default scene"));
    EXPECT_THAT(error_after([&](Gltf &g) { replace(g.nodes, "\"children\": [2]", "\"children\": [2, 2]"); }),
                HasSubstr("node 2 has more than one parent"));
    EXPECT_THAT(error_after([&](Gltf &g) { replace(g.nodes, "\"children\": [2]", "\"children\": [1]"); }),
                HasSubstr("more than one parent"));
    EXPECT_THAT(error_after([&](Gltf &g) { g.bytes[60] = 5; }),
                HasSubstr("refers to joint 5, but the skin has only 2 joints"));
    EXPECT_THAT(error_after([&](Gltf &g) { replace(g.more, "\"input\": 5", "\"input\": 6"); }),
                HasSubstr("must have elements of the type SCALAR"));
    EXPECT_THAT(error_after([&](Gltf &g) { replace(g.accessors, "5121", "5126"); }),
                HasSubstr("JOINTS_0 (accessor 2) must have unsigned integer components"));
    EXPECT_THAT(error_after([&](Gltf &g) {
                    replace(g.more, "\"output\": 6", "\"output\": 6, \"interpolation\": \"BEZIER\"");
                }),
                HasSubstr("the unknown interpolation 'BEZIER'; glTF defines LINEAR, STEP and CUBICSPLINE"));
    std::string old = triangle().text();
    replace(old, "\"2.0\"", "\"1.0\"");
    EXPECT_THAT(error_of(old), HasSubstr("is not glTF 2: its asset.version must be"));
    std::string newer = triangle().text();
    replace(newer, "\"version\": \"2.0\"", "\"version\": \"2.1\", \"minVersion\": \"2.1\"");
    EXPECT_THAT(error_of(newer), HasSubstr("its asset.minVersion is \"2.1\", but arhost reads glTF 2.0"));
    for (const std::string extension : {"KHR_materials_dispersion", "KHR_texture_basisu"})
        EXPECT_THAT(error_after([&](Gltf &g) {
                        g.more += R"(, "extensionsRequired": ["KHR_mesh_quantization", ")" + extension + "\"]";
                    }),
                    HasSubstr("extensionsRequired[1] requires the unsupported extension '" + extension + "'"));
    // The loader must detect these errors before tinygltf reads out of bounds or recurses without limit.
    EXPECT_THAT(
        error_after([&](Gltf &g) { replace(g.views, "\"byteOffset\": 0", "\"byteOffset\": 18446744073709551615"); }),
        HasSubstr("buffer view 0 extends past the end of its buffer"));
    EXPECT_THAT(error_after([&](Gltf &g) { replace(g.views, "\"byteOffset\": 0", "\"byteOffset\": -4"); }),
                HasSubstr("a value of 'byteOffset' is not an unsigned integer"));
    std::string deep;
    for (int i = 0; i < 20000; ++i)
        deep += "{\"a\":";
    EXPECT_THAT(error_after([&](Gltf &g) { g.more += ", \"extras\": " + deep + "1" + std::string(20000, '}'); }),
                HasSubstr("its JSON is nested more than 64 levels deep"));
    EXPECT_THAT(error_of(std::string("glTF\2\0\0\0\x1c\0\0\0\xff\0\0\0JSON{}      ", 28)),
                HasSubstr("a chunk extends past the end of the file"));
    Gltf points = triangle();
    points.meshes = R"({"primitives": [{"attributes": {"POSITION": 0}, "mode": 0}]})";
    EXPECT_THAT(error_of(points.text()), HasSubstr("its default scene contains no triangles"));
}

TEST(YamlMotion, MovesAnyObject) {
    const Arena arena = build(load_scene(arhost::yaml::Node::parse(
        "version: 1\naxes: z-up\nmaterials: {grey: {model: mirror}}\nobjects:\n"
        "  - {cuboid: {size: 2}, material: grey, transform: [{translate: [5, 0, 0]}], motion: {keys: [\n"
        "      {at_s: 0}, {at_s: 2, translate: [0, 0, 6], rotate: {axis: [0, 0, 1], degrees: 90}, scale: "
        "3}]}}\n",
        "s.yaml")));
    EXPECT_EQ(arena.scene().duration_s, 2);
    EXPECT_EQ(arena.scene().bounds_max[0], 6);
    MotionEvaluator evaluator(arena.scene());
    const float *m = evaluator.at(1).moved[0].world_from_object; // rotated by 45°, scaled by 2, moved up by 3
    EXPECT_THAT(std::vector<float>(m, m + 12), ElementsAre(near(1.4142135f), near(1.4142135f), 0, near(-1.4142135f),
                                                           near(1.4142135f), 0, 0, 0, near(2), 0, 0, 3));
}

TEST(YamlMotion, ErrorsNameTheProblem) {
    const auto error = [](const std::string &keys) {
        const std::string text = "version: 1\naxes: z-up\nmaterials: {a: {model: mirror}}\nobjects:\n"
                                 "  - {sphere: {radius: 2}, material: a, motion: {keys: " +
                                 keys + "}}\n";
        return arhost::test::error_of([&] { load_scene(arhost::yaml::Node::parse(text, "s.yaml")); });
    };
    EXPECT_EQ(error("[{at_s: 0, scale: 1}]"), "s.yaml:5:55: objects[0].motion.keys: needs at least two keys");
    EXPECT_THAT(error("[{at_s: 0}, {at_s: 1}]"), HasSubstr("must set at least one of translate, rotate and scale"));
    EXPECT_THAT(error("[{at_s: 1, scale: 1}, {at_s: 1, scale: 2}]"),
                HasSubstr("keys[1].at_s: must be later than the previous key"));
    EXPECT_THAT(error("[{at_s: 0, scale: 0}, {at_s: 1}]"),
                HasSubstr("keys[0].scale: each factor must be 1e-6 to 1e6"));
    EXPECT_THAT(error("[{at_s: 0, scale: [1, 1, 2]}, {at_s: 1}]"), HasSubstr("scales a sphere non-uniformly"));
    EXPECT_THAT(error("[{at_s: 0, spin: 3}, {at_s: 1}]"), HasSubstr("keys[0].spin: unknown key"));
    EXPECT_THAT(error("[{at_s: 0}, {at_s: 1, rotate: {axis: [0, 0, 1], degrees: 180}}]"),
                HasSubstr("keys[1].rotate: the object rotates by 180 degrees between this key and the previous one; "
                          "it must be less than 180"));
    EXPECT_THAT(error("[{at_s: 0, rotate: {axis: [1, 0, 0], degrees: -270}}, {at_s: 1}]"),
                HasSubstr("rotates by 270"));
}
