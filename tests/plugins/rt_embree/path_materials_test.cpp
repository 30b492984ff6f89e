// SPDX-License-Identifier: Apache-2.0
//
// Materials of the path integrator: opacity, vertex colours, texture coordinates and filtering, tangents,
// transmission, clear coats, sheen, anisotropy, iridescence, unlit surfaces and hidden back faces.
#include "linear_tracer.hpp"
#include "rich_scene.hpp"
#include "scene/image_levels.hpp"

#include <arhost/shading/scalar.hpp>

#include <array>
#include <cmath>

namespace arhost::test::path_materials {
namespace {

constexpr std::size_t transmittance = 4;

SceneBuilder in_a_furnace(float radiance, std::uint32_t max_depth = 16) {
    scene::Settings settings;
    settings.integrator = ARHOST_INTEGRATOR_PATH;
    settings.ambient = glm::vec3(0);
    settings.background = glm::vec3(radiance);
    settings.max_depth = max_depth;
    return SceneBuilder(settings);
}

LinearPicture rendered(SceneBuilder scene, const arhost_camera &view = from_above(),
                       const Options &options = {{"samples", "64"}}) {
    LinearTracer tracer(std::move(scene), options, "rt_embree");
    EXPECT_EQ(tracer.start(view.intrinsics), ARHOST_STATUS_OK) << tracer.log();
    return tracer.render(view, 0);
}

double mean_at(const LinearPicture &picture, std::uint32_t x, std::uint32_t y, std::size_t channel = 0) {
    double sum = 0;
    for (std::uint32_t row = y - 4; row <= y + 4; ++row)
        for (std::uint32_t column = x - 4; column <= x + 4; ++column)
            sum += picture.value(column, row, channel);
    return sum / 81;
}

arhost_material emissive(float radiance) {
    arhost_material material = diffuse(0, 0, 0);
    set3(material.emission, radiance, radiance, radiance);
    return material;
}
arhost_material translucent(arhost_material material, float opacity) {
    material.opacity = opacity;
    material.blends = 1;
    return material;
}
arhost_material transmissive(bool is_thin, float transmission = 1, float roughness = 0) {
    arhost_material material = metallic_roughness({1, 1, 1}, 0, roughness);
    material.transmission = transmission;
    material.thin_walled = is_thin;
    return material;
}

} // namespace

TEST(PathMaterials, TranslucentSurfacesShowWhatIsBehindInProportion) {
    SceneBuilder scene = in_a_furnace(0);
    scene.add_mesh("floor", square(200), emissive(1));
    scene.add_mesh("upper", square(40, 40), translucent(diffuse(0, 0, 0), 0.25f));
    scene.add_mesh("lower", square(20, 20), translucent(emissive(2), 0.5f));
    scene.add_mesh("invisible", square(10, 60), translucent(diffuse(0, 0, 0), 0));
    const LinearPicture picture = rendered(std::move(scene));
    EXPECT_NEAR(mean_at(picture, 130, 75), 0.75, 1e-3);
    EXPECT_NEAR(mean_at(picture, 100, 75), 0.75 * (0.5 * 2 + 0.5), 1e-3);
}

TEST(PathMaterials, TranslucentSurfacesShadowInProportion) {
    SceneBuilder scene = in_a_furnace(0);
    scene.add_mesh("table", square(200), diffuse(0.5f, 0.5f, 0.5f), ARHOST_ROLE_CATCHER);
    scene.add_mesh("shade", square(20, 40), translucent(diffuse(0, 0, 0), 0.25f));
    scene.add_light(sun(0.6f, 0, -0.8f));
    const LinearPicture picture =
        rendered(std::move(scene), from_above(), {{"samples", "256"}, {"light_samples", "1"}});
    EXPECT_NEAR(mean_at(picture, 145, 75, transmittance), 0.75, 0.02) << "in the shadow, beside the shade";
    EXPECT_NEAR(mean_at(picture, 180, 75, transmittance), 1, 1e-3);
}

TEST(PathMaterials, PixelsWithoutOpacityAreUntouched) {
    SceneBuilder scene = in_a_furnace(1);
    scene.add_mesh("invisible", square(40), translucent(diffuse(1, 1, 1), 0));
    const LinearPicture picture = rendered(std::move(scene));
    EXPECT_EQ(picture.at(100, 75), untouched);
}

TEST(PathMaterials, VertexColoursMultiplyTheDiffuseColourAndTheOpacity) {
    SceneBuilder scene = in_a_furnace(1);
    scene::TriangleMesh mesh = square(60);
    mesh.colours = {
        {0, 65535, 32768, 0}, {65535, 65535, 32768, 65535}, {65535, 65535, 32768, 65535}, {0, 65535, 32768, 0}};
    scene.add_mesh("gradient", mesh, diffuse(0.8f, 0.4f, 0.4f));
    const LinearPicture opaque = rendered(std::move(scene));
    EXPECT_NEAR(mean_at(opaque, 130, 75, 0), 0.8 * 0.754, 0.01);
    EXPECT_NEAR(mean_at(opaque, 130, 75, 1), 0.4, 0.005);
    EXPECT_NEAR(mean_at(opaque, 130, 75, 2), 0.2, 0.005);
    SceneBuilder blended = in_a_furnace(0);
    blended.add_mesh("floor", square(200), emissive(1));
    for (glm::vec3 &p : mesh.positions)
        p.z = 1;
    blended.add_mesh("gradient", mesh, translucent(diffuse(0, 0, 0), 1));
    EXPECT_NEAR(mean_at(rendered(std::move(blended)), 130, 75), 1 - 0.754, 0.01);
}

// Two texels side by side: black and white.
TEST(PathMaterials, TexturesUseTheirSetAndTransform) {
    const auto value = [](const scene::Texture &texture, std::uint32_t x) {
        SceneBuilder scene = in_a_furnace(1);
        scene::TriangleMesh mesh = square(60);
        mesh.texcoords = {{0, 0.5f}, {1, 0.5f}, {1, 0.5f}, {0, 0.5f}};                 // set 0: u to the right
        mesh.texcoords.insert(mesh.texcoords.end(), {{1, 0}, {0, 0}, {0, 0}, {1, 0}}); // set 1: to the left
        arhost_material material = diffuse(1, 1, 1);
        material.colour_texture =
            scene.add_texture("two", texture_of(2, 1, {{0, 0, 0, 255}, {255, 255, 255, 255}}), texture);
        scene.add_mesh("square", mesh, material);
        return mean_at(rendered(std::move(scene), from_above(), {{"samples", "16"}}), x, 75);
    };
    scene::Texture texture{.wrap_u = ARHOST_WRAP_CLAMP, .filter = ARHOST_TEXEL_FILTER_NEAREST};
    EXPECT_NEAR(value(texture, 90), 0, 0.01);
    EXPECT_NEAR(value(texture, 110), 1, 0.01);
    texture.texcoord_set = 1;
    EXPECT_NEAR(value(texture, 90), 1, 0.01);
    texture.image_from_texcoord = {{0.5f, 0}, {0, 1}, {0.25f, 0}}; // u from 0.25 to 0.75, to the left
    EXPECT_NEAR(value(texture, 110), 0, 0.01);
    texture.image_from_texcoord = {{0, 0}, {0, 1}, {0.75f, 0}};
    EXPECT_NEAR(value(texture, 110), 1, 0.01);
}

TEST(PathMaterials, HiddenBackFacesCastShadowsAndAreSeenByOtherRays) {
    const auto render = [](bool hides, bool turned) {
        SceneBuilder scene = in_a_furnace(0);
        scene.add_mesh("table", square(200), diffuse(0.5f, 0.5f, 0.5f), ARHOST_ROLE_CATCHER);
        scene::TriangleMesh shade = square(20, 40);
        if (turned)
            for (glm::uvec3 &t : shade.triangles)
                std::swap(t.y, t.z);
        scene.add_object("shade", scene.add_triangles(shade), scene.add_material(diffuse(0, 0, 0)),
                         ARHOST_ROLE_VIRTUAL, glm::mat4x3(1), {}, hides);
        scene.add_light(sun(0.6f, 0, -0.8f));
        return rendered(std::move(scene), from_above(), {{"samples", "16"}, {"light_samples", "1"}});
    };
    const LinearPicture seen = render(true, false), hidden = render(true, true), two_sided = render(false, true);
    EXPECT_EQ(seen.value(85, 75, transmittance), 0);
    EXPECT_EQ(two_sided.value(85, 75, transmittance), 0);
    EXPECT_EQ(hidden.value(85, 75, transmittance), 1) << "the table behind it, in the light";
    for (const LinearPicture *picture : {&seen, &hidden, &two_sided})
        EXPECT_NEAR(mean_at(*picture, 145, 75, transmittance), 0, 0.01) << "the shadow";
}

TEST(PathMaterials, UnlitSurfacesHaveTheirColourUnderAnyLight) {
    for (const float light : {0.0f, 3.0f}) {
        SceneBuilder scene = in_a_furnace(light);
        arhost_material unlit = scene::make_material(ARHOST_MATERIAL_UNLIT);
        set3(unlit.diffuse, 0.25f, 0.5f, 1);
        scene.add_ball("ball", {0, 0, 0, 40}, unlit);
        const LinearPicture picture = rendered(std::move(scene), from_above(), {{"samples", "4"}});
        EXPECT_EQ(picture.value(100, 75, 0), 0.25f);
        EXPECT_EQ(picture.value(100, 75, 2), 1);
    }
}

TEST(PathMaterials, SolidsInAFurnaceAreInvisible) {
    for (const float share : {1.0f, 0.5f}) {
        SceneBuilder scene = in_a_furnace(1, 64);
        arhost_material material = transmissive(false, share);
        if (share < 1) { // Lambert's part: the model of glTF brings energy at grazing angles
            material.index = 1;
            material.specular_weight = 0;
        }
        scene.add_ball("ball", {0, 0, 0, 40}, material);
        const LinearPicture picture = rendered(std::move(scene), from_above(), {{"samples", "256"}});
        EXPECT_NEAR(mean_at(picture, 100, 75), 1, 0.01) << share;
    }
}

TEST(PathMaterials, SolidsAbsorbAndTintAtEachSurface) {
    SceneBuilder scene = in_a_furnace(1, 32);
    arhost_material material = transmissive(false);
    set3(material.diffuse, 0.25f, 1, 1);
    set3(material.extinction, 0, 0.01f, 0);
    material.index = 1; // no reflection and no refraction
    scene.add_ball("ball", {0, 0, 0, 40}, material);
    const LinearPicture picture = rendered(std::move(scene), from_above(), {{"samples", "4"}});
    EXPECT_NEAR(mean_at(picture, 100, 75, 0), 0.5 * 0.5, 0.001);
    EXPECT_NEAR(mean_at(picture, 100, 75, 1), std::exp(-0.8), 0.01);
    EXPECT_NEAR(mean_at(picture, 100, 75, 2), 1, 0.001);
}

// A thin wall neither refracts nor absorbs, and its colour tints the light once.
TEST(PathMaterials, ThinWallsPassLightStraight) {
    for (const float roughness : {0.0f, 0.2f}) {
        SceneBuilder scene = in_a_furnace(1);
        arhost_material wall = transmissive(true, 1, roughness);
        set3(wall.diffuse, 1, 0.5f, 1);
        set3(wall.extinction, 1, 1, 1);
        scene.add_mesh("wall", square(60), wall);
        const LinearPicture picture = rendered(std::move(scene), from_above(), {{"samples", "256"}});
        EXPECT_NEAR(mean_at(picture, 100, 75, 0), 1, roughness > 0 ? 0.01 : 0.002) << roughness;
        EXPECT_NEAR(mean_at(picture, 100, 75, 1), 0.04 + 0.96 * 0.5, roughness > 0 ? 0.01 : 0.005) << roughness;
    }
}

TEST(PathMaterials, ClearCoatsInAFurnaceKeepEnergy) {
    for (const float roughness : {0.0f, 0.5f}) {
        SceneBuilder scene = in_a_furnace(1);
        arhost_material coated = metallic_roughness({1, 1, 1}, 0, 1);
        coated.specular_weight = 0; // Lambert
        coated.clearcoat = 1;
        coated.clearcoat_roughness = roughness;
        scene.add_ball("ball", {0, 0, 0, 40}, coated);
        const LinearPicture picture = rendered(std::move(scene), from_above(), {{"samples", "256"}});
        EXPECT_NEAR(mean_at(picture, 100, 75), 1, 0.01) << roughness;
    }
}

TEST(PathMaterials, SheenInAFurnaceKeepsEnergy) {
    for (const float roughness : {0.3f, 0.8f}) {
        SceneBuilder scene = in_a_furnace(1);
        arhost_material cloth = metallic_roughness({1, 1, 1}, 0, 1);
        cloth.specular_weight = 0; // Lambert
        set3(cloth.sheen, 1, 1, 1);
        cloth.sheen_roughness = roughness;
        scene.add_ball("ball", {0, 0, 0, 40}, cloth);
        const LinearPicture picture = rendered(std::move(scene), from_above(), {{"samples", "256"}});
        EXPECT_NEAR(mean_at(picture, 100, 75), 1, 0.01) << roughness;
        EXPECT_NEAR(mean_at(picture, 112, 84), 1, 0.01) << roughness;
    }
}

TEST(PathMaterials, SheenShowsAtGrazingAngles) {
    SceneBuilder scene = in_a_furnace(1);
    arhost_material cloth = metallic_roughness({0, 0, 0}, 0, 1);
    cloth.specular_weight = 0;
    set3(cloth.sheen, 1, 0, 0);
    cloth.sheen_roughness = 0.4f;
    scene.add_ball("ball", {0, 0, 0, 40}, cloth);
    const LinearPicture picture = rendered(std::move(scene), from_above(), {{"samples", "64"}});
    double brightest = 0;
    for (std::uint32_t x = 104; x < 196; ++x)
        brightest = std::max(brightest, mean_at(picture, x, 75));
    EXPECT_LT(mean_at(picture, 100, 75), 0.05);
    EXPECT_GT(brightest, 0.18);
    EXPECT_EQ(mean_at(picture, 100, 75, 1), 0);
}

// A lamp straight above a brushed square: its highlight is long in the direction of the anisotropy.
TEST(PathMaterials, AnisotropyStretchesHighlights) {
    const auto render = [](glm::vec2 direction, bool has_texture) {
        SceneBuilder scene = in_a_furnace(0);
        arhost_material brushed = metallic_roughness({1, 1, 1}, 1, 0.3f);
        brushed.anisotropy = 0.8f;
        if (has_texture) // turns by a right angle, and leaves the strength as it is
            brushed.anisotropy_texture = scene.add_texture("turn", [] {
                scene::TexelImage image = texture_of(1, 1, {{128, 255, 255, 255}});
                image.format = ARHOST_TEXEL_RGBA8;
                return image;
            }());
        std::copy_n(&direction.x, 2, brushed.anisotropy_direction);
        scene.add_mesh("square", textured_square(60, 0), brushed);
        arhost_light lamp = scene::make_light(ARHOST_LIGHT_POINT);
        lamp.position[2] = 60;
        scene.add_light(lamp);
        return rendered(std::move(scene));
    };
    const LinearPicture along_x = render({1, 0}, false), along_y = render({0, 1}, false),
                        by_texture = render({1, 0}, true);
    EXPECT_GT(mean_at(along_x, 135, 75), 2 * mean_at(along_x, 100, 40));
    EXPECT_GT(mean_at(along_y, 100, 40), 2 * mean_at(along_y, 135, 75));
    EXPECT_NEAR(mean_at(by_texture, 100, 40), mean_at(along_y, 100, 40), 0.02);
}

// A soap film in a white room, at two thicknesses that its texture chooses.
TEST(PathMaterials, ThinFilmHasTheColoursOfInterference) {
    SceneBuilder scene = in_a_furnace(1);
    arhost_material film = metallic_roughness({0, 0, 0}, 0, 0);
    film.iridescence = 1;
    film.iridescence_index = 1.8f;
    film.iridescence_thickness_nm[0] = 250;
    film.iridescence_thickness_nm[1] = 450;
    scene::TexelImage two = texture_of(2, 1, {{0, 0, 0, 255}, {0, 255, 0, 255}});
    two.format = ARHOST_TEXEL_RGBA8;
    film.iridescence_thickness_texture = scene.add_texture(
        "two", std::move(two), {.wrap_u = ARHOST_WRAP_CLAMP, .filter = ARHOST_TEXEL_FILTER_NEAREST});
    scene.add_mesh("square", textured_square(60, 0), film);
    const LinearPicture picture = rendered(std::move(scene));
    for (const auto &[x, nm] : {std::pair(95u, 250.0), std::pair(105u, 450.0)}) {
        const auto expected = shading::film_reflectance({0.04, 0.04, 0.04}, 1.8, nm, 1);
        EXPECT_NEAR(mean_at(picture, x, 75, 0), expected.x, 0.01) << nm;
        EXPECT_NEAR(mean_at(picture, x, 75, 1), expected.y, 0.01) << nm;
        EXPECT_NEAR(mean_at(picture, x, 75, 2), expected.z, 0.01) << nm;
    }
}

// A pixel covers many texels of the chessboard.
TEST(PathMaterials, FarTexturesAreFiltered) {
    const auto deviation = [](bool has_levels, float repeats) {
        SceneBuilder scene = in_a_furnace(1);
        scene::TexelImage board =
            texture_of(2, 2, {{255, 255, 255, 255}, {0, 0, 0, 255}, {0, 0, 0, 255}, {255, 255, 255, 255}});
        if (has_levels)
            scene::add_levels(board);
        arhost_material material = scene::make_material(ARHOST_MATERIAL_UNLIT);
        set3(material.diffuse, 1, 1, 1);
        material.colour_texture = scene.add_texture("board", std::move(board));
        scene::TriangleMesh mesh = textured_square(60, 0);
        for (glm::vec2 &t : mesh.texcoords)
            t *= repeats;
        scene.add_mesh("square", mesh, material);
        const LinearPicture picture = rendered(std::move(scene), from_above(), {{"samples", "1"}});
        double sum = 0;
        for (std::uint32_t y = 60; y < 90; ++y)
            for (std::uint32_t x = 85; x < 115; ++x)
                sum += std::pow(picture.value(x, y, 0) - 0.5, 2);
        return std::sqrt(sum / 900);
    };
    EXPECT_GT(deviation(false, 617.3f), 0.15) << "noise";
    EXPECT_LT(deviation(true, 617.3f), 0.02) << "grey";
    EXPECT_GT(deviation(true, 4), 0.15) << "near textures stay sharp";
}

TEST(PathMaterials, TangentsOfVerticesTurnNormalMaps) {
    const auto brightness = [](const std::vector<glm::vec4> &tangents) {
        SceneBuilder scene = in_a_furnace(0);
        scene::TexelImage slope = texture_of(1, 1, {{218, 128, 218, 255}}); // 45° towards the tangent
        slope.format = ARHOST_TEXEL_RGBA8;
        arhost_material material = metallic_roughness({1, 1, 1}, 0, 1);
        material.normal_texture = scene.add_texture("slope", std::move(slope));
        scene::TriangleMesh mesh = textured_square(60, 0);
        mesh.normals.assign(4, {0, 0, 1});
        mesh.tangents = tangents;
        scene.add_mesh("square", mesh, material);
        scene.add_light(sun(-0.6f, 0, -0.8f)); // from +x
        return mean_at(rendered(std::move(scene)), 100, 75);
    };
    const double plain = brightness({}), turned = brightness(std::vector<glm::vec4>(4, {-1, 0, 0, 1}));
    EXPECT_NEAR(brightness(std::vector<glm::vec4>(4, {1, 0, 0, 1})), plain, 1e-3);
    EXPECT_GT(plain, 4 * turned);
}

TEST(PathMaterials, CoatOfABlackSurfaceReflectsFourPercent) {
    SceneBuilder scene = in_a_furnace(1);
    arhost_material coated = metallic_roughness({0, 0, 0}, 0, 1);
    coated.specular_weight = 0;
    coated.clearcoat = 0.5f;
    coated.clearcoat_roughness = 0.1f;
    scene.add_mesh("black", square(60), coated);
    EXPECT_NEAR(mean_at(rendered(std::move(scene), from_above(), {{"samples", "256"}}), 100, 75), 0.02, 0.002);
}

// glTF 2.0, appendix B.2: the mean of a dielectric and a metal, weighted by `metallic`.
TEST(PathMaterials, PartlyMetallicSurfacesMixBothModels) {
    const auto reflected = [](float metallic) {
        SceneBuilder scene = in_a_furnace(1);
        scene.add_mesh("white", square(60), metallic_roughness({1, 1, 1}, metallic, 0.4f));
        return mean_at(rendered(std::move(scene), from_above(), {{"samples", "256"}}), 100, 75);
    };
    EXPECT_NEAR(reflected(0.5f), (reflected(0) + reflected(1)) / 2, 0.01);
}

TEST(PathMaterials, IndexAndSpecularWeightSetTheReflectanceOfNonMetals) {
    const auto reflected = [](float index, float weight, float red) {
        SceneBuilder scene = in_a_furnace(1);
        arhost_material black = metallic_roughness({0, 0, 0}, 0, 0.1f);
        black.index = index;
        black.specular_weight = weight;
        black.specular[0] = red;
        scene.add_mesh("black", square(60), black);
        return mean_at(rendered(std::move(scene), from_above(), {{"samples", "256"}}), 100, 75);
    };
    EXPECT_NEAR(reflected(1.5f, 1, 1), 0.04, 0.002);
    EXPECT_NEAR(reflected(2, 1, 1), 1.0 / 9, 0.004);
    EXPECT_NEAR(reflected(1.5f, 0.5f, 1), 0.02, 0.002);
    EXPECT_NEAR(reflected(1.5f, 1, 10), 0.4, 0.01);
    EXPECT_NEAR(reflected(1.5f, 1, 100), 1, 0.01) << "at most 1";
}

} // namespace arhost::test::path_materials
