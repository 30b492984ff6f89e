// SPDX-License-Identifier: Apache-2.0
#include "errors.hpp"
#include "image_samples.hpp"
#include "plugin_under_test.hpp"
#include "scene/scene_loader.hpp"
#include "scene_samples.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

using namespace arhost::scene;
using namespace arhost::scene::test;
using arhost::test::ScratchFolder;
using testing::Each;
using testing::ElementsAre;
using testing::FloatEq;
using testing::FloatNear;
using testing::HasSubstr;

namespace {

const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n";
const std::string triangle = "f 1/1 2/2 3/3\n";
const std::string plain_obj = "mtllib a.mtl\n" + vertices + "usemtl m\n" + triangle;

// A folder with a scene of one OBJ file.
class Scene {
public:
    explicit Scene(const std::string &mtl, const std::string &obj = plain_obj) {
        std::filesystem::create_directories(path("models/images"));
        write("models/a.mtl", mtl);
        write("models/a.obj", obj);
    }
    std::filesystem::path path(const std::string &name) const { return folder_.path() / name; }
    void write(const std::string &name, const std::string &content) const { write_file(path(name), content); }
    ArenaBuilder load(const std::string &more = "", const std::vector<std::filesystem::path> &readable = {}) {
        write("s.yaml", "version: 2\naxes: y-up\nbackground: 1\nmaterials: {grey: {model: diffuse, diffuse: 0.5}}\n"
                        "objects:\n  - {name: chair, mesh: models/a.obj" +
                            more + "}\n");
        LoadCallbacks callbacks;
        callbacks.info = [&](const std::string &text) { info += without_folder(text) + "; "; };
        return load_scene(path("s.yaml"), callbacks, readable);
    }
    // Returns the error message without the folder and without the start, which names the scene's line.
    std::string error(const std::vector<std::filesystem::path> &readable = {}) {
        return arhost::test::after("s.yaml:6:25: objects[0].mesh: ",
                                   without_folder(arhost::test::error_of([&] { load("", readable); })));
    }

    std::string info; // messages of the loader, each followed by "; "

private:
    std::string without_folder(std::string text) const {
        return arhost::test::without_folder(arhost::test::without_folder(std::move(text), path("models")),
                                            folder_.path());
    }

    ScratchFolder folder_;
};

arhost_material material_of(const std::string &mtl) {
    return material(build(Scene("newmtl m\n" + mtl).load()), 1); // 0: grey
}

const Texture &lookup(const ArenaBuilder &builder, std::uint32_t texture) {
    return builder.texture(texture);
}

// Returns the texels of the largest level.
std::vector<int> bytes(const ArenaBuilder &builder, std::uint32_t texture) {
    std::vector<int> values;
    const TexelImage &image = builder.image_of_texture(texture);
    for (const std::byte value : image.texels.span().first(4 * texel_count(image.width, image.height, 1)))
        values.push_back(std::to_integer<int>(value));
    return values;
}

} // namespace

TEST(Mtl, EachMaterialIsAnObject) {
    Scene scene("newmtl oak wood\nKd 1 0 0\nnewmtl unused\nmap_Kd none.png\nnewmtl #2\nKd 0 1 0\n",
                "mtllib a.mtl\n" + vertices + "v 0 0 1\n" + triangle + "usemtl oak wood\n" + triangle +
                    "usemtl #2\n" + triangle + "usemtl oak wood\nf 1/1 2/2 4/3\n");
    const Arena arena = build(scene.load(", role: catcher, transform: [{scale: 2}]"));
    ASSERT_EQ(arena.scene().objects.count, 3u);
    EXPECT_STREQ(name(arena, 0), "chair/oak wood");
    EXPECT_STREQ(name(arena, 1), "chair/#2");
    EXPECT_STREQ(name(arena, 2), "chair") << "before the first usemtl";
    EXPECT_EQ(geometry(arena, 0).indices.count, 2u);
    EXPECT_EQ(geometry(arena, 0).positions.count, 4u);
    EXPECT_EQ(geometry(arena, 0).texcoords.count, 4u);
    EXPECT_EQ(elements<glm::vec3>(arena, geometry(arena, 0).positions)[3], glm::vec3(0, 0, 2));
    EXPECT_EQ(geometry(arena, 1).positions.count, 3u);
    EXPECT_EQ(object(arena, 2).role, ARHOST_ROLE_CATCHER);
    EXPECT_THAT(material(arena, object(arena, 0).material).diffuse, ElementsAre(1, 0, 0));
    EXPECT_THAT(material(arena, object(arena, 1).material).diffuse, ElementsAre(0, 1, 0));
    EXPECT_THAT(material(arena, object(arena, 2).material).diffuse, Each(1));
    EXPECT_THAT(scene.info, HasSubstr("a.obj: 4 triangles, 4 vertices"));
}

TEST(Mtl, TheMaterialOfTheSceneReplacesAll) {
    Scene scene("newmtl m\n");
    const Arena arena = build(scene.load(", material: grey"));
    ASSERT_EQ(arena.scene().objects.count, 1u);
    EXPECT_STREQ(name(arena), "chair");
    EXPECT_EQ(object(arena).material, 0u);
    EXPECT_THAT(scene.info, HasSubstr("a.obj: the MTL materials are ignored"));
}

TEST(Mtl, PartsMoveWithTheirObjectAndShareSmoothNormals) {
    Scene scene("newmtl a\nnewmtl b\n", "mtllib a.mtl\nv 0 0 0\nv 0 1 0\nv 1 0 0\nv 0 0 -1\nusemtl a\nf 1 3 2\n"
                                        "usemtl b\nf 1 2 4\n");
    const Arena arena = build(scene.load(", smooth: true, on: cup"));
    for (const std::size_t i : {0, 1}) {
        EXPECT_TRUE(object(arena, i).moves);
        EXPECT_EQ(object(arena, i).node, 0u);
    }
    const auto *a = elements<glm::vec3>(arena, geometry(arena, 0).normals),
               *b = elements<glm::vec3>(arena, geometry(arena, 1).normals);
    EXPECT_EQ(a[0], b[0]);
    EXPECT_NE(a[1], b[2]);
}

TEST(Mtl, NsAndKsBecomeRoughnessAndReflectance) {
    const arhost_material plain = material_of("Ka 1 0 1\nKd 0.2 0.4 0.6\nKs 0.5\nNs 30\nKe 2 0 0\n");
    EXPECT_EQ(plain.model, ARHOST_MATERIAL_METALLIC_ROUGHNESS);
    EXPECT_THAT(plain.diffuse, ElementsAre(0.2f, 0.4f, 0.6f));
    EXPECT_THAT(plain.ambient, ElementsAre(0.2f, 0.4f, 0.6f));
    EXPECT_THAT(plain.emission, ElementsAre(2, 0, 0));
    EXPECT_EQ(plain.metallic, 0);
    EXPECT_FLOAT_EQ(plain.roughness, 0.5f) << "alpha² = 2/(30 + 2)";
    EXPECT_EQ(plain.specular_weight, 1);
    EXPECT_THAT(plain.specular, Each(FloatEq(1)));
    EXPECT_EQ(plain.opacity, 1);
    EXPECT_EQ(plain.blends, 0u);

    const arhost_material tinted = material_of("Ks 0.1 0.05 0\n");
    EXPECT_FLOAT_EQ(tinted.specular_weight, 0.2f);
    EXPECT_THAT(tinted.specular, ElementsAre(FloatEq(1), FloatEq(0.5f), 0)) << "0.04 · specular · weight = 0.08 Ks";
    EXPECT_EQ(tinted.roughness, 1);
    EXPECT_THAT(tinted.diffuse, Each(0.8f));

    const arhost_material mirror = material_of("Kd 0\nKs 0.9 0.8 0.7\nillum 3\n");
    EXPECT_THAT(mirror.specular, ElementsAre(FloatEq(22.5f), FloatEq(20), FloatEq(17.5f))) << "reflectance = Ks";
    EXPECT_EQ(material_of("Ks 1\nillum 1\n").specular_weight, 0);
    EXPECT_EQ(material_of("Kd 1\n").specular_weight, 0);
    EXPECT_EQ(material_of("Kd 2 0 0\nillum 0\n").model, ARHOST_MATERIAL_UNLIT);
    EXPECT_EQ(material_of("Kd 2 0 0\n").diffuse[0], 1);

    const arhost_material pbr = material_of("Kd 1 0.8 0.3\nNs 7\nPr 0.25\nPm 1\nillum 1\n");
    EXPECT_EQ(pbr.roughness, 0.25f);
    EXPECT_EQ(pbr.metallic, 1);
    EXPECT_EQ(pbr.specular_weight, 1);
    EXPECT_THAT(pbr.specular, Each(FloatEq(1)));
}

TEST(Mtl, TransparentMaterialsAreGlassOrBlend) {
    for (const std::string mtl : {"illum 6\nTf 0.5 1 1\n", "illum 7\nTf 0.5 1 1\n", "d 0.9\nTf 0.5 1 1\n",
                                  "Tr 0.1\nillum 4\nTf 0.5 1 1\n", "d 0\nillum 9\nTf 0.5 1 1\n"}) {
        const arhost_material glass = material_of(mtl + "Ni 1.25\nPr 0.3\n");
        EXPECT_EQ(glass.model, ARHOST_MATERIAL_GLASS) << mtl;
        EXPECT_THAT(glass.refraction, ElementsAre(0.5f, 1, 1)) << mtl;
        EXPECT_EQ(glass.index, 1.25f);
        EXPECT_FLOAT_EQ(glass.fresnel_minimum, 1 / 81.f);
        EXPECT_EQ(glass.roughness, 0.3f);
        EXPECT_FLOAT_EQ(glass.shadow_attenuation[0], 0.3f);
    }
    EXPECT_THAT(material_of("illum 9\nd 0.5\nKd 0 1 0\n").refraction, ElementsAre(0.5f, 1, 0.5f));
    EXPECT_EQ(material_of("illum 7\n").refraction[0], 1);
    EXPECT_EQ(material_of("illum 7\nNi 0\n").index, 1);
    for (const std::string mtl : {"d 0.25\n", "d -halo 0.25\n", "Tr 0.75\n", "d 0.25\nTr 0\n", "Tr 0.2\nd 0.25\n"}) {
        const arhost_material blend = material_of(mtl);
        EXPECT_EQ(blend.model, ARHOST_MATERIAL_METALLIC_ROUGHNESS) << mtl;
        EXPECT_EQ(blend.opacity, 0.25f) << mtl;
        EXPECT_NE(blend.blends, 0u) << mtl;
    }
    const arhost_material of_maya = material_of("illum 4\nKd 0.5\nTf 1 1 1\nNi 1\n");
    EXPECT_EQ(of_maya.model, ARHOST_MATERIAL_METALLIC_ROUGHNESS);
    EXPECT_EQ(of_maya.blends, 0u);
}

TEST(Mtl, ReadsTexturesWithOptions) {
    Scene scene("newmtl m\nmap_Kd -s 2 3 1 -o 0.5 0.25 -mm 0 1 -clamp on images\\oak wood.png\n"
                "norm -bm 0.5 normal.png\nmap_Ks -s 4 grey.png\nmap_Ke -t 1 1 grey.png\nrefl x.png\nKm 1\n");
    scene.write("models/images/oak wood.png", png(1, 1, 3, {1, 2, 3}));
    scene.write("models/normal.png", png(1, 1, 3, {'\x80', '\x80', '\xff'}));
    scene.write("models/grey.png", png(1, 1, 1, {9}));
    const ArenaBuilder builder = scene.load();
    const arhost_material &m = builder.material(1);
    EXPECT_THAT(m.diffuse, Each(1)) << "default with a texture";
    EXPECT_THAT(bytes(builder, m.colour_texture), ElementsAre(1, 2, 3, 255));
    EXPECT_EQ(builder.image_of_texture(m.colour_texture).format, ARHOST_TEXEL_SRGB8);
    const Texture &colour = lookup(builder, m.colour_texture);
    EXPECT_EQ(colour.wrap_u, ARHOST_WRAP_CLAMP);
    // The texcoord (0.25, 0.75) of the file, (0.25, 0.25) in the arena, is at (2, 3) · (0.25, 0.75) + (0.5, 0.25).
    EXPECT_EQ(colour.image_from_texcoord * glm::vec3(0.25f, 0.25f, 1), glm::vec2(1, 1 - 2.5f));
    EXPECT_EQ(builder.image_of_texture(m.normal_texture).format, ARHOST_TEXEL_RGBA8);
    EXPECT_EQ(m.normal_scale, 0.5f);
    EXPECT_EQ(builder.image_of_texture(m.specular_colour_texture).format, ARHOST_TEXEL_SRGB8);
    EXPECT_EQ(lookup(builder, m.specular_colour_texture).image_from_texcoord[0].x, 4);
    EXPECT_EQ(lookup(builder, m.specular_colour_texture).image_from_texcoord[1].y, 1);
    EXPECT_THAT(m.emission, Each(1));
    EXPECT_NE(m.emission_texture, ARHOST_NONE);
    EXPECT_THAT(scene.info, HasSubstr("a.mtl: these statements and options are ignored: -mm, -t, Km, refl; "));
}

TEST(Mtl, CombinesImagesOfDifferentSizes) {
    Scene scene("newmtl m\nmap_Kd a.png\nmap_d mask.png\nmap_Pr rough.png\nPm 0.5\nmap_Pm metal.png\n"
                "newmtl n\nmap_d rgba.png\nmap_Pr rough.png\n",
                plain_obj + "usemtl n\n" + triangle);
    scene.write("models/a.png", png(1, 1, 3, {1, 2, 3}));
    scene.write("models/mask.png", png(2, 1, 1, {0, 100}));
    scene.write("models/rough.png", png(1, 1, 1, {50}));
    scene.write("models/metal.png", png(1, 2, 1, {60, 70}));
    scene.write("models/rgba.png", png(1, 1, 4, {9, 9, 9, 40}));
    const ArenaBuilder builder = scene.load();
    const arhost_material &m = builder.material(1), &n = builder.material(2);
    EXPECT_THAT(bytes(builder, m.colour_texture), ElementsAre(1, 2, 3, 0, 1, 2, 3, 100));
    EXPECT_EQ(builder.image_of_texture(m.colour_texture).format, ARHOST_TEXEL_SRGB8);
    EXPECT_NE(m.blends, 0u);
    EXPECT_THAT(bytes(builder, m.metallic_roughness_texture), ElementsAre(255, 50, 60, 255, 255, 50, 70, 255));
    EXPECT_EQ(builder.image_of_texture(m.metallic_roughness_texture).format, ARHOST_TEXEL_RGBA8);
    EXPECT_EQ(m.metallic, 0.5f);
    EXPECT_EQ(m.roughness, 1);
    EXPECT_THAT(bytes(builder, n.colour_texture), ElementsAre(255, 255, 255, 40)) << "of an image with alpha";
    EXPECT_THAT(bytes(builder, n.metallic_roughness_texture), ElementsAre(255, 50, 255, 255));
    EXPECT_EQ(n.metallic, 0);
}

TEST(Mtl, MapBumpMayBeAHeightMapOrANormalMap) {
    Scene scene("newmtl m\nmap_Bump -bm 2 bump.png\n");
    scene.write("models/bump.png", png(1, 1, 3, {'\x80', '\x80', '\xff'}));
    const ArenaBuilder normals = scene.load();
    EXPECT_THAT(bytes(normals, normals.material(1).normal_texture), ElementsAre(128, 128, 255, 255));
    EXPECT_EQ(normals.material(1).normal_scale, 2);
    // Heights that increase to the right by 1/5 per texel, and upwards by 2/5
    scene.write("models/bump.png", png(3, 3, 1, {102, '\x99', '\xcc', 0, 51, 102, 0, 0, 0}));
    const ArenaBuilder heights = scene.load();
    const TexelImage &image = heights.image_of_texture(heights.material(1).normal_texture);
    ASSERT_EQ(image.format, ARHOST_TEXEL_RGBA8);
    const auto &middle = reinterpret_cast<const glm::u8vec4 *>(image.texels.bytes.get())[4];
    const float length = std::sqrt(0.04f + 0.09f + 1);
    EXPECT_NEAR(middle.x, 127.5f - 127.5f * 0.2f / length, 0.5f);
    EXPECT_NEAR(middle.y, 127.5f - 127.5f * 0.3f / length, 0.5f);
    EXPECT_NEAR(middle.z, 127.5f + 127.5f / length, 0.5f);
}

TEST(Mtl, LibrariesMayBeSeveralOrHaveBlanksInTheirNames) {
    Scene several("newmtl m\nKd 0.1\n", "mtllib a.mtl b.mtl\nmtllib .\\c d.mtl\n" + vertices + "usemtl m\n" +
                                            triangle + "usemtl n\n" + triangle + "usemtl o\n" + triangle);
    several.write("models/b.mtl", "newmtl n\nnewmtl m\nKd 0.2\n");
    several.write("models/c d.mtl", "\xef\xbb\xbfnewmtl o\r\nKd 0.3\r\n");
    const Arena arena = build(several.load());
    EXPECT_EQ(material(arena, 1).diffuse[0], 0.1f) << "the first definition applies";
    EXPECT_EQ(material(arena, 3).diffuse[0], 0.3f);
}

TEST(Mtl, ErrorsNameFileAndLine) {
    const arhost::test::ErrorCase cases[] = {
        {"newmtl m\nKd 1 1\n", "a.mtl:2: Kd needs 1 or 3 numbers, but has 2"},
        {"newmtl m\nKs\n", "a.mtl:2: Ks needs 1 or 3 numbers, but has 0"},
        {"newmtl m\nKd spectral a.rfl\n", "a.mtl:2: 'spectral' is not a number"},
        {"newmtl m\nNs -1\n", "a.mtl:2: Ns must be 0 or more, but is -1"},
        {"newmtl m\n\nNs nan\n", "a.mtl:3: the number 'nan' is invalid"},
        {"newmtl m\nd\n", "a.mtl:2: d needs a number"},
        {"Kd 1\nnewmtl m\n", "a.mtl:1: 'Kd' precedes the first 'newmtl'; move it below"},
        {"newmtl m\nmap_Kd -s 1 1 1\n", "a.mtl:2: the name of an image is missing"},
        {"newmtl m\nmap_Kd -s x.png\n", "a.mtl:2: -s needs one to three numbers"},
        {"newmtl m\nbump -bm x.png\n", "a.mtl:2: 'x.png' is not a number"},
        {"newmtl m\nmap_Kd C:\\x y.png\n",
         "a.mtl:2: map_Kd: 'C:/x y.png' does not exist; write a path relative to this file"},
        {"newmtl m\nmap_Kd a.mtl\n",
         HasSubstr("a.mtl:2: map_Kd: a.mtl: is not a PNG, JPEG, WebP, PPM, HDR or EXR image")},
        {"newmtl n\n", "a.obj:8: no MTL file defines the material 'm'; define it, or add the key 'material' to the "
                       "object"},
    };
    expect_errors([](const std::string &mtl) { return Scene(mtl).error(); }, cases);
    for (const std::string &obj : {vertices + triangle, vertices + "usemtl m\n" + triangle})
        EXPECT_EQ(Scene("newmtl m\n", obj).error(), "has no materials; add the key 'material' to the object");
    EXPECT_EQ(Scene("newmtl m\n", "mtllib a.mtl\n" + vertices + triangle).error(), "no error")
        << "faces without 'usemtl' are white";
    EXPECT_EQ(Scene("", "mtllib no such.mtl\n" + vertices + "usemtl m\n" + triangle).error(),
              "a.obj: the MTL file 'no such.mtl' does not exist; move it there, or add the key 'material' to the "
              "object");
    Scene untextured("newmtl m\nmap_Kd a.png\n", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n");
    untextured.write("models/a.png", png(1, 1, 1, {1}));
    EXPECT_THAT(untextured.error(), HasSubstr("has no texture coordinates"));
}

// An OBJ file may come from somebody else: its MTL files and images must not be files of the user.
TEST(Mtl, ReadsOnlyFilesBelowItsFolderAndThoseTheCallerGrants) {
    for (const std::string image : {"../secret.png", "link.png"}) {
        Scene scene("newmtl m\nmap_Kd " + image + "\n");
        scene.write("secret.png", png(1, 1, 1, {1}));
        std::filesystem::create_symlink(scene.path("secret.png"), scene.path("models/link.png"));
        EXPECT_EQ(scene.error(), "a.obj: refers to 'secret.png', which is outside its folder; move that file there, "
                                 "or list it under 'reads' of the ray tracer in the configuration");
        EXPECT_EQ(scene.error({scene.path("secret.png")}), "no error");
    }
    Scene scene("", "mtllib ../b.mtl\n" + vertices + "usemtl m\n" + triangle);
    scene.write("b.mtl", "newmtl m\n");
    EXPECT_THAT(scene.error(), HasSubstr("a.obj: refers to 'b.mtl', which is outside its folder"));
    EXPECT_EQ(scene.error({scene.path("b.mtl")}), "no error");
}

TEST(Mtl, ReportsAllFilesItReads) {
    Scene scene("newmtl m\nmap_Kd a.png\n");
    scene.write("models/a.png", png(1, 1, 1, {1}));
    scene.load();
    std::vector<std::string> read;
    LoadCallbacks callbacks;
    callbacks.reads = [&](const std::filesystem::path &file) { read.push_back(file.filename().string()); };
    load_scene(scene.path("s.yaml"), callbacks);
    EXPECT_THAT(read, ElementsAre("a.obj", "a.mtl", "a.png"));
}
