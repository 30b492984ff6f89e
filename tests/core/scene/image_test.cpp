// SPDX-License-Identifier: Apache-2.0
#include "errors.hpp"
#include "image_samples.hpp"
#include "plugin_under_test.hpp"
#include "scene/image.hpp"
#include "scene/scene_loader.hpp"
#include "scene_samples.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

using namespace arhost::scene;
using namespace arhost::scene::test;
using arhost::test::ScratchFolder;
using testing::ElementsAre;
using testing::FloatNear;
using testing::HasSubstr;

namespace {

const std::string start = "version: 1\naxes: z-up\n";
const std::string plane = "objects:\n  - {plane: {size: 1}, material: a}\n";

// A folder with a scene and one image.
class Scene {
public:
    Scene(const std::string &image_name, const std::string &image) { write_file(folder_.path() / image_name, image); }
    Arena load(const std::string &text, const LoadCallbacks &callbacks = {}) {
        write_file(folder_.path() / "s.yaml", start + text);
        return build(load_scene(folder_.path() / "s.yaml", callbacks));
    }
    Arena load_texture(const std::string &texture, const LoadCallbacks &callbacks = {}) {
        return load("materials: {a: {model: diffuse, texture: " + texture + "}}\n" + plane, callbacks);
    }
    // Returns the error message without the folder.
    std::string error_of(const std::string &text) {
        return arhost::test::without_folder(arhost::test::error_of([&] { load(text); }), folder_.path());
    }

private:
    ScratchFolder folder_;
};

// Return the texels of the largest level.
std::vector<int> bytes(const Arena &a, std::size_t i = 0) {
    const auto *p = elements<std::uint8_t>(a, image(a, i).texels);
    return {p, p + 4 * texel_count(image(a, i).width, image(a, i).height, 1)};
}
std::vector<float> floats(const Arena &a, std::size_t i = 0) {
    const auto *p = elements<float>(a, image(a, i).texels);
    return {p, p + 4 * texel_count(image(a, i).width, image(a, i).height, 1)};
}

} // namespace

TEST(Textures, PngsHaveTheTopRowFirstAndStraightAlpha) {
    const Arena arena = Scene("a.png", png(1, 2, 4, {10, 20, 30, 40, 50, 60, 70, 80})).load_texture("a.png");
    ASSERT_EQ(arena.scene().textures.count, 1u);
    EXPECT_EQ(image(arena).format, ARHOST_TEXEL_SRGB8);
    EXPECT_EQ(image(arena).width, 1u);
    EXPECT_EQ(image(arena).height, 2u);
    EXPECT_EQ(texture(arena).wrap_u, ARHOST_WRAP_REPEAT);
    EXPECT_THAT(bytes(arena), ElementsAre(10, 20, 30, 40, 50, 60, 70, 80));
    EXPECT_EQ(image(arena).level_count, 2u);
    EXPECT_EQ(material(arena).colour_texture, 0u);
    EXPECT_THAT(material(arena).diffuse, testing::Each(1.0f)) << "default with a texture";
}

TEST(Textures, AreExpandedToRgba) {
    EXPECT_THAT(bytes(Scene("a.png", png(1, 1, 1, {7})).load_texture("a.png")), ElementsAre(7, 7, 7, 255));
    EXPECT_THAT(bytes(Scene("a.png", png(1, 1, 2, {7, 9})).load_texture("a.png")), ElementsAre(7, 7, 7, 9));
    EXPECT_THAT(bytes(Scene("a.png", png(1, 1, 3, {1, 2, 3})).load_texture("a.png")), ElementsAre(1, 2, 3, 255));
    EXPECT_THAT(bytes(Scene("a.png", png(1, 1, 1, {'\x80', 0}, 16)).load_texture("a.png")),
                ElementsAre(128, 128, 128, 255));
    EXPECT_THAT(bytes(Scene("a.ppm", "P6\n1 1\n255\n\1\2\3").load_texture("a.ppm")), ElementsAre(1, 2, 3, 255));
    const std::vector<int> grey_jpeg = bytes(Scene("a.jpg", jpeg()).load_texture("a.jpg"));
    ASSERT_EQ(grey_jpeg.size(), 256u);
    EXPECT_NEAR(grey_jpeg[0], 128, 2);
    EXPECT_EQ(grey_jpeg[255], 255);
}

TEST(Textures, AreReadFromWebp) {
    const std::string samples = {10, 20, 30, 40, 50, 60, 70, 80};
    const Arena lossless = Scene("a.webp", webp(1, 2, samples)).load_texture("a.webp");
    EXPECT_EQ(image(lossless).height, 2u);
    EXPECT_THAT(bytes(lossless), ElementsAre(10, 20, 30, 40, 50, 60, 70, 80));
    const std::vector<int> lossy = bytes(Scene("a.webp", webp(1, 2, samples, 100)).load_texture("a.webp"));
    ASSERT_EQ(lossy.size(), 8u);
    EXPECT_NEAR(lossy[0], 10, 12);
    EXPECT_EQ(lossy[3], 40) << "alpha is lossless";
    EXPECT_EQ(lossy[7], 80);
}

TEST(Textures, HaveAMemoryLimit) {
    ImageBudget budget(100);
    const LoadCallbacks callbacks;
    const auto read = [&](const std::string &image) {
        return arhost::test::error_of<ImageError>([&] {
            read_image("a.png", {reinterpret_cast<const unsigned char *>(image.data()), image.size()},
                       Reporter(callbacks, "a.png"), budget);
        });
    };
    EXPECT_EQ(read(png(20, 1, 3, "")), "no error");
    EXPECT_EQ(read(png(6, 1, 3, "")),
              "a.png: the decoded images of a scene may have at most 0 MiB together, and this one "
              "exceeds it by 1 MiB; scale some of them down");
    EXPECT_THAT(read(png(6, 1, 3, "").substr(0, 45)), HasSubstr("exceeds it by 1 MiB")) << "before it is decoded";
    EXPECT_THAT(read(webp(6, 1, std::string(24, '\1'))), HasSubstr("exceeds it by 1 MiB"));
    EXPECT_EQ(read(png(5, 1, 3, "")), "no error");
}

TEST(Textures, FloatsAreLinearAndClamped) {
    const Arena radiance = Scene("a.hdr", hdr(1, 2, {'\x80', 64, 32, '\x81', 1, 2, 4, '\x88'})).load_texture("a.hdr");
    EXPECT_EQ(image(radiance).format, ARHOST_TEXEL_RGBA32F);
    EXPECT_EQ(image(radiance).height, 2u);
    const std::vector<float> texels = floats(radiance);
    EXPECT_NEAR(texels[0], 1, 0.01);
    EXPECT_NEAR(texels[1], 0.5, 0.01);
    EXPECT_EQ(texels[3], 1);
    EXPECT_NEAR(texels[6] / texels[5], 2, 0.3);

    LoadCallbacks callbacks;
    std::vector<std::string> info;
    callbacks.info = [&](const std::string &text) { info.push_back(text); };
    const Arena arena =
        Scene("a.exr", exr({0.5f, std::nanf("")}, {-1, 2e6f}, {3, INFINITY})).load_texture("a.exr", callbacks);
    EXPECT_THAT(floats(arena), ElementsAre(3, 0, 0.5f, 1, 1e6f, 1e6f, 0, 1));
    EXPECT_THAT(info, testing::Contains(HasSubstr("a.exr: 4 values were below 0, above 1e6 or NaN")));
}

TEST(Textures, HaveWrapModeAndEncoding) {
    const Arena arena =
        Scene("a.png", png(1, 1, 1, {7})).load_texture("{image: a.png, wrap: mirror, encoding: linear}");
    EXPECT_EQ(image(arena).format, ARHOST_TEXEL_RGBA8);
    EXPECT_EQ(texture(arena).wrap_u, ARHOST_WRAP_MIRROR);
    EXPECT_EQ(texture(arena).wrap_v, ARHOST_WRAP_MIRROR);
}

TEST(Textures, TheSameFileIsStoredOnce) {
    const Arena arena = Scene("a.png", png(1, 1, 1, {7}))
                            .load("materials:\n  a: {model: metallic-roughness, texture: a.png, emission_texture: "
                                  "./a.png, metallic_roughness_texture: a.png,\n"
                                  "    normal_texture: {image: a.png, wrap: clamp}}\n" +
                                  plane);
    ASSERT_EQ(arena.scene().textures.count, 3u);
    EXPECT_EQ(material(arena).colour_texture, 0u);
    EXPECT_EQ(material(arena).emission_texture, 0u);
    EXPECT_EQ(material(arena).metallic_roughness_texture, 1u);
    EXPECT_EQ(material(arena).normal_texture, 2u);
    EXPECT_THAT(material(arena).emission, testing::Each(1.0f));
    EXPECT_EQ(image(arena, 1).format, ARHOST_TEXEL_RGBA8);
    EXPECT_EQ(texture(arena, 2).wrap_u, ARHOST_WRAP_CLAMP);
}

TEST(Textures, ErrorsNameFileAndKey) {
    const auto error = [](const std::string &name, const std::string &content) {
        return Scene(name, content)
            .error_of("materials:\n  a: {model: diffuse, texture: " + name + "}\nobjects: []\n");
    };
    EXPECT_EQ(error("a.png", "GIF89a"), "s.yaml:4:32: materials.a.texture: a.png: is not a PNG, JPEG, WebP, PPM, HDR "
                                        "or EXR image; convert it to one of these formats");
    EXPECT_EQ(error("a.png", ""), "s.yaml:4:32: materials.a.texture: a.png: is empty");
    EXPECT_THAT(error("a.png", png(2, 2, 3, "").substr(0, 40)), HasSubstr("a.png: cannot be loaded: "));
    EXPECT_THAT(error("a.jpg", jpeg().substr(0, 60)), HasSubstr("a.jpg: cannot be loaded: "));
    EXPECT_THAT(error("a.jpg", jpeg().substr(0, jpeg().size() - 3)), HasSubstr("a.jpg: is truncated: "));
    EXPECT_EQ(error("a.png", png(16385, 1, 1, "")), "s.yaml:4:32: materials.a.texture: a.png: has 16385 x 1 pixels; "
                                                    "the limit is 16384 per side, so scale it down");
    EXPECT_EQ(Scene("a.png", "").error_of("materials:\n  a: {model: diffuse, texture: b.png}\nobjects: []\n"),
              "s.yaml:4:32: materials.a.texture: b.png: cannot be read: No such file or directory");
    EXPECT_THAT(Scene("a.png", "").error_of("materials:\n  a: {model: diffuse, texture: .}\nobjects: []\n"),
                HasSubstr("is not a regular file"));
    EXPECT_THAT(error("a.webp", webp(1, 1, {1, 2, 3, 4}).substr(0, 20)), HasSubstr("a.webp: cannot be loaded: "));
    std::string noise;
    for (int i = 0; i < 400; ++i)
        noise += static_cast<char>(i * i * 37);
    EXPECT_THAT(error("a.webp", webp(10, 10, noise).substr(0, 100)), HasSubstr("a.webp: cannot be loaded: "));
    const std::string animated("RIFF\x16\0\0\0WEBPVP8X\x0a\0\0\0\2\0\0\0\0\0\0\0\0\0", 30);
    EXPECT_THAT(error("a.webp", animated), HasSubstr("a.webp: is an animated WebP image, which cannot be a texture"));
    EXPECT_THAT(Scene("a.png", "").error_of("materials:\n  a: {model: mirror, texture: a.png}\nobjects: []\n"),
                HasSubstr("materials.a.texture: unknown key"));
    EXPECT_THAT(Scene("a.png", "")
                    .error_of("materials:\n  a: {model: diffuse, texture: {image: a.png, wrap: round}}\n"
                              "objects: []\n"),
                HasSubstr("materials.a.texture.wrap: "));
}

TEST(Textures, NeedTextureCoordinates) {
    EXPECT_EQ(Scene("a.png", png(1, 1, 1, {7}))
                  .error_of("materials:\n  a: {model: diffuse, texture: a.png}\nobjects:\n  - {sphere: {radius: 1}, "
                            "material: a}\n"),
              "s.yaml:6:14: objects[0].sphere: has no texture coordinates, so its material cannot have textures; "
              "give it another material, or a mesh with texture coordinates");
}

TEST(Textures, CanBeCancelledWhileLoading) {
    LoadCallbacks callbacks;
    callbacks.cancelled = [] { return true; };
    EXPECT_THROW(Scene("a.png", png(64, 64, 1, "")).load_texture("a.png", callbacks), Cancelled);
}

// With u = ½ + atan2(x, −z)/2π, the direction −z is at the centre of the image (u = ½), and +x is at u = ¾.
TEST(Environments, AreOrientedByTheScenesUpAxis) {
    const auto environment_direction = [](const std::string &axes, double degrees, glm::vec3 d) {
        ScratchFolder folder;
        write_file(folder.path() / "a.png", png(1, 1, 1, {7}));
        write_file(folder.path() / "s.yaml", "version: 1\naxes: " + axes +
                                                 "\nenvironment: {image: a.png, rotate_degrees: " +
                                                 std::to_string(degrees) + "}\nmaterials: {}\nobjects: []\n");
        const Arena arena = build(load_scene(folder.path() / "s.yaml"));
        const float *m = arena.scene().environment.environment_from_world;
        const auto row = [&](int i) { return m[i] * d.x + m[3 + i] * d.y + m[6 + i] * d.z + 0.f; };
        return std::vector<float>{std::round(row(0) * 1e5f) / 1e5f + 0.f, std::round(row(1) * 1e5f) / 1e5f + 0.f,
                                  std::round(row(2) * 1e5f) / 1e5f + 0.f};
    };
    EXPECT_THAT(environment_direction("y-up", 0, {1, 2, 3}), ElementsAre(1, 2, 3));
    EXPECT_THAT(environment_direction("z-up", 0, {0, 0, 1}), ElementsAre(0, 1, 0)) << "up";
    EXPECT_THAT(environment_direction("z-up", 0, {0, 1, 0}), ElementsAre(0, 0, -1)) << "away: the image's centre";
    EXPECT_THAT(environment_direction("z-up", 0, {1, 0, 0}), ElementsAre(1, 0, 0));
    // The environment is rotated left by 90° seen from above, so the centre of the image is on the left.
    EXPECT_THAT(environment_direction("z-up", 90, {-1, 0, 0}), ElementsAre(0, 0, -1));
    EXPECT_THAT(environment_direction("y-up", 90, {-1, 0, 0}), ElementsAre(0, 0, -1));
}

TEST(Environments, HaveCumulativeSums) {
    // The upper row is white on the left and black on the right; the lower row is black.
    const Arena arena = Scene("a.png", png(2, 2, 1, {'\xff', 0, 0, 0}))
                            .load("environment: {image: a.png, intensity: 3}\nmaterials: {}\nobjects: []\n");
    const arhost_environment &environment = arena.scene().environment;
    EXPECT_EQ(environment.texture, 0u);
    EXPECT_EQ(environment.intensity, 3);
    EXPECT_EQ(image(arena).format, ARHOST_TEXEL_RGBA32F);
    EXPECT_THAT(floats(arena), ElementsAre(1, 1, 1, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1));
    const auto *rows = elements<float>(arena, environment.rows),
               *columns = elements<float>(arena, environment.columns);
    // Interpolation extends the light by half a texel, horizontally across the image's edge.
    EXPECT_THAT(std::vector<float>(rows, rows + 2), ElementsAre(0.875f, 1));
    EXPECT_THAT(std::vector<float>(columns, columns + 4), ElementsAre(0.75f, 1, 0.75f, 1));
    EXPECT_THAT(arena.scene().ambient, testing::Each(0.0f)) << "the environment replaces ambient light";
}

TEST(Environments, AreSampledUniformlyIfBlack) {
    const Arena arena =
        Scene("a.png", png(2, 1, 1, {0, 0})).load("environment: {image: a.png}\nmaterials: {}\nobjects: []\n");
    const auto *columns = elements<float>(arena, arena.scene().environment.columns);
    EXPECT_THAT(std::vector<float>(columns, columns + 2), ElementsAre(0.5f, 1));
}

TEST(Environments, WeightRowsBySolidAngle) {
    const Arena arena = Scene("a.png", png(1, 3, 1, {'\xbc', '\xbc', '\xbc'}))
                            .load("ambient: 0.1\nenvironment: {image: a.png}\nmaterials: {}\nobjects: []\n");
    const auto *rows = elements<float>(arena, arena.scene().environment.rows);
    EXPECT_NEAR(rows[0], 0.25, 1e-6) << "sin 30° : sin 90° : sin 150°";
    EXPECT_NEAR(rows[1], 0.75, 1e-6);
    EXPECT_EQ(rows[2], 1);
    EXPECT_NEAR(floats(arena)[0], 0.5029, 1e-3) << "188 of 255 in sRGB";
    EXPECT_EQ(arena.scene().ambient[0], 0.1f);
}

TEST(Environments, ErrorsNameFileAndKey) {
    const auto error = [](const std::string &text) {
        return Scene("a.png", png(1, 1, 1, {7})).error_of(text + "\nmaterials: {}\nobjects: []\n");
    };
    EXPECT_EQ(error("environment: a.png"), "s.yaml:3:14: environment: must be a map with the key 'image'");
    EXPECT_THAT(error("environment: {intensity: 2}"), HasSubstr("environment: the key 'image' is missing"));
    EXPECT_THAT(error("environment: {image: b.png}"),
                HasSubstr("s.yaml:3:22: environment.image: b.png: cannot be read"));
    EXPECT_THAT(error("environment: {image: a.png, intensity: -1}"), HasSubstr("environment.intensity: "));
}
