// SPDX-License-Identifier: Apache-2.0
//
// Compares the images of rt_vulkan's path integrator with those of rt_embree's. Both use the same random numbers, so
// their noise is similar. Lavapipe takes some 10 s to compile the shader for each combination of features that a
// scene has, so the scenes have few such combinations.
#include "linear_tracer.hpp"
#include "rich_scene.hpp"
#include "scene/image_levels.hpp"
#include "two_tracers.hpp"

namespace arhost::test {
namespace {

const arhost_intrinsics small = pinhole(48, 36, 48);

// Expects that the mean of each channel in each of 4×3 regions differs by at most 1 %.
void expect_like(const LinearPicture &got, const LinearPicture &expected) {
    const std::uint32_t width = got.width / 4, height = got.height / 3;
    for (std::uint32_t region = 0; region < 12; ++region)
        for (const std::size_t channel : {0, 1, 2, 4, 5, 6}) {
            double sum = 0, wanted = 0;
            for (std::uint32_t y = region / 4 * height; y < (region / 4 + 1) * height; ++y)
                for (std::uint32_t x = region % 4 * width; x < (region % 4 + 1) * width; ++x) {
                    sum += double{got.value(x, y, channel)};
                    wanted += double{expected.value(x, y, channel)};
                }
            EXPECT_NEAR(sum, wanted, 0.01 * wanted + 1e-3 * width * height)
                << "region " << region % 4 << ", " << region / 4 << ", channel " << channel;
        }
}

scene::Settings path_settings(const glm::vec3 &background = glm::vec3(0), std::uint32_t max_depth = 5) {
    return {.max_depth = max_depth, .background = background, .integrator = ARHOST_INTEGRATOR_PATH};
}

arhost_material emissive(float r, float g, float b) {
    arhost_material material = diffuse(0, 0, 0);
    set3(material.emission, r, g, b);
    return material;
}

arhost_light round_spot() {
    arhost_light lamp = placed(ARHOST_LIGHT_SPOT, {30, -20, 80}, 3000, ARHOST_FALLOFF_INVERSE_SQUARE);
    set3(lamp.direction, -0.6f, 0, -0.8f);
    lamp.cosine_inner = 0.9f;
    lamp.cosine_outer = 0.7f;
    lamp.radius = 6;
    return lamp;
}

// A box that is open to the front, with an emissive panel and ball and a round spot lamp.
SceneBuilder lit_box() {
    SceneBuilder builder(path_settings());
    builder.add_mesh("floor", square(60), diffuse(0.7f, 0.7f, 0.7f));
    builder.add_mesh("back", quad({-60, 60, 0}, {60, 60, 0}, {60, 60, 100}, {-60, 60, 100}),
                     diffuse(0.6f, 0.6f, 0.6f));
    builder.add_mesh("left", quad({-60, -60, 0}, {-60, 60, 0}, {-60, 60, 100}, {-60, -60, 100}),
                     diffuse(0.8f, 0.1f, 0.1f));
    builder.add_mesh("right", quad({60, 60, 0}, {60, -60, 0}, {60, -60, 100}, {60, 60, 100}), shiny(0.3f, 0.4f, 20));
    builder.add_mesh("ceiling", square(60, 100), diffuse(0.7f, 0.7f, 0.7f));
    builder.add_mesh("panel", square(15, 95), emissive(6, 5, 4));
    builder.add_ball("bulb", {-30, 10, 20, 8}, emissive(1, 2, 4));
    builder.add_mesh("block", moved(cube(12), {25, 20, 12}), metallic_roughness({0.7f, 0.6f, 0.3f}, 0.5f, 0.4f));
    builder.add_light(round_spot());
    return builder;
}

// Balls of all materials that reflect, in an environment.
SceneBuilder balls_in_an_environment() {
    SceneBuilder builder(path_settings(glm::vec3(0), 6));
    add_environment(builder, [](std::uint32_t column) {
        return glm::vec3(0.2f + 0.1f * static_cast<float>(column), 0.5f, 1.2f - 0.1f * static_cast<float>(column));
    });
    arhost_material glass = glass_of(1.5f), metal = scene::make_material(ARHOST_MATERIAL_METAL);
    set3(glass.extinction, 0.02f, 0.005f, 0.01f);
    set3(metal.diffuse, 0.3f, 0.2f, 0.1f);
    set3(metal.reflectivity, 0.6f, 0.5f, 0.3f);
    builder.add_ball("glass", {-30, 0, 22, 20}, glass);
    builder.add_ball("frosted", {-2, -35, 13, 12}, glass_of(1.5f, 0.4f));
    builder.add_ball("metal", {12, 20, 22, 20}, metal);
    builder.add_ball("rough", {35, -20, 17, 15}, metallic_roughness({0.9f, 0.7f, 0.4f}, 1, 0.3f));
    builder.add_mesh("floor", square(90), diffuse(0.5f, 0.6f, 0.4f));
    return builder;
}

// Squares over a floor: translucent, coated, of thin and solid glass, unlit, with hidden back faces, and textured
// with vertex colours.
SceneBuilder squares_of_all_materials() {
    SceneBuilder builder(path_settings(glm::vec3(0.6f, 0.5f, 0.4f), 6));
    builder.add_mesh("floor", square(90), diffuse(0.5f, 0.6f, 0.4f));
    builder.add_light(placed(ARHOST_LIGHT_POINT, {30, -40, 120}, 9000, ARHOST_FALLOFF_INVERSE_SQUARE));
    int count = 0;
    const auto add = [&](const arhost_material &material, scene::TriangleMesh mesh = square(14), bool hides = false) {
        const glm::vec3 position(-64 + 32 * (count % 5), 45 - 45 * (count / 5), 12);
        mesh.texcoords = {{0, 1}, {1, 1}, {1, 0}, {0, 0}, /* set 1 */ {0, 2}, {2, 2}, {2, 0}, {0, 0}};
        builder.add_object("square " + std::to_string(count++),
                           builder.add_triangles(moved(std::move(mesh), position)), builder.add_material(material),
                           ARHOST_ROLE_VIRTUAL, glm::mat4x3(1), {}, hides);
    };
    const scene::Texture turned{.texcoord_set = 1, .image_from_texcoord = {{0, 0.5f}, {-1, 0}, {0.25f, 0}}};
    arhost_material material = metallic_roughness({0.9f, 0.3f, 0.2f}, 0, 0.6f);
    material.opacity = 0.6f;
    material.blends = 1;
    add(material);
    material = metallic_roughness({0.2f, 0.3f, 0.8f}, 0, 0.7f);
    material.clearcoat = 0.8f;
    material.clearcoat_roughness = 0.3f;
    add(material);
    material = metallic_roughness({0.9f, 0.8f, 0.3f}, 0.1f, 0.4f);
    material.transmission = 0.7f;
    material.thin_walled = 1;
    add(material);
    material.thin_walled = 0;
    material.roughness = 0.2f;
    set3(material.extinction, 0.01f, 0.05f, 0.02f);
    builder.add_mesh("solid", moved(cube(12), {32, 45, 14}), material);
    ++count;
    material = scene::make_material(ARHOST_MATERIAL_UNLIT);
    set3(material.diffuse, 0.2f, 0.7f, 0.3f);
    add(material);
    scene::TriangleMesh back = square(14);
    for (glm::uvec3 &t : back.triangles)
        std::swap(t.y, t.z);
    add(diffuse(0.8f, 0.8f, 0.8f), back, true);
    material = metallic_roughness({1, 1, 1}, 0, 0.5f);
    material.index = 2;
    set3(material.specular, 1, 0.5f, 0.2f);
    material.specular_weight = 0.9f;
    material.colour_texture = builder.add_texture(
        "colours", texture_of(2, 2, {{255, 0, 0, 255}, {0, 255, 0, 128}, {0, 0, 255, 0}, {255, 255, 255, 255}}),
        turned);
    material.blends = 1;
    scene::TriangleMesh coloured = square(14);
    coloured.colours = {
        {65535, 0, 0, 65535}, {0, 65535, 0, 65535}, {0, 0, 65535, 30000}, {65535, 65535, 65535, 65535}};
    add(material, coloured);
    material.blends = 0;
    material.alpha_cutoff = 0.4f;
    add(material, coloured);
    material = metallic_roughness({0.3f, 0.2f, 0.5f}, 0, 0.8f);
    set3(material.sheen, 0.9f, 0.7f, 0.5f);
    material.sheen_roughness = 0.4f;
    add(material);
    material = metallic_roughness({0.9f, 0.8f, 0.6f}, 1, 0.4f);
    material.anisotropy = 0.9f;
    material.anisotropy_direction[0] = 0.6f;
    material.anisotropy_direction[1] = 0.8f;
    add(material);
    scene::TriangleMesh with_tangents = square(14);
    with_tangents.normals.assign(4, {0, 0, 1});
    with_tangents.tangents.assign(4, {0.8f, -0.6f, 0, -1});
    scene::TexelImage slope = texture_of(1, 1, {{180, 150, 220, 255}});
    slope.format = ARHOST_TEXEL_RGBA8;
    material.normal_texture = builder.add_texture("slope", std::move(slope));
    add(material, with_tangents);
    material = metallic_roughness({0.2f, 0.2f, 0.2f}, 0.3f, 0.3f);
    material.iridescence = 0.9f;
    material.iridescence_thickness_nm[1] = 450;
    add(material);
    scene::TexelImage board = texture_of(4, 2,
                                         {{255, 0, 0, 255},
                                          {0, 255, 0, 255},
                                          {0, 0, 255, 255},
                                          {255, 255, 255, 255},
                                          {0, 0, 0, 255},
                                          {255, 255, 255, 255},
                                          {255, 255, 0, 255},
                                          {0, 255, 255, 255}});
    scene::add_levels(board);
    material = diffuse(1, 1, 1);
    material.colour_texture =
        builder.add_texture("board", std::move(board), {.image_from_texcoord = {{11, 0}, {0, 7}, {0.3f, 0.1f}}});
    add(material);
    return builder;
}

// A desk with a ball that shadows and colours it, one that shines onto it, and an occluder in front.
SceneBuilder desk(const arhost_material &of_ball, const arhost_material &of_desk = diffuse(0.6f, 0.6f, 0.6f)) {
    SceneBuilder builder(path_settings(glm::vec3(0.4f)));
    builder.add_mesh("desk", square(90), of_desk, ARHOST_ROLE_CATCHER);
    builder.add_mesh("box", moved(cube(10), {-40, -40, 10}), diffuse(0.6f, 0.6f, 0.6f), ARHOST_ROLE_OCCLUDER);
    builder.add_ball("ball", {0, 0, 20, 20}, of_ball);
    builder.add_ball("bulb", {40, -30, 12, 6}, emissive(4, 3, 1));
    return builder;
}
SceneBuilder desk_with_lamps() {
    SceneBuilder builder = desk(diffuse(0.8f, 0.2f, 0.1f));
    builder.add_light(bulb({-60, 40, 150}, 20, 8000, ARHOST_FALLOFF_INVERSE_SQUARE));
    builder.add_light(sun(0.6f, 0, -0.8f));
    return builder;
}
SceneBuilder desk_with_a_lit_cube() {
    SceneBuilder builder(path_settings());
    builder.add_mesh("desk", square(90), diffuse(0.6f, 0.6f, 0.6f), ARHOST_ROLE_CATCHER);
    builder.add_mesh("cube", moved(cube(10), {0, 0, 15}), emissive(2, 1, 0.5f));
    return builder;
}
// The ball mirrors a filmed desk and a filmed can of metal.
SceneBuilder desk_in_a_mirror() {
    SceneBuilder builder = desk(mirror(0.9f));
    builder.add_mesh("can", moved(cube(8), {10, -40, 8}), metallic_roughness({0.6f, 0.6f, 0.6f}, 1, 0.3f),
                     ARHOST_ROLE_OCCLUDER);
    builder.add_light(bulb({-60, -40, 120}, 10, 5000, ARHOST_FALLOFF_INVERSE_SQUARE));
    return builder;
}
// The desk mirrors the balls and hides the mirrored box and lamp behind them.
SceneBuilder lacquered_desk() {
    SceneBuilder builder(path_settings(glm::vec3(0.4f)));
    builder.add_mesh("desk", square(90), metallic_roughness({0.6f, 0.6f, 0.6f}, 0, 0.25f), ARHOST_ROLE_CATCHER);
    builder.add_mesh("box", moved(cube(10), {5, 50, 10}), diffuse(0.6f, 0.6f, 0.6f), ARHOST_ROLE_OCCLUDER);
    builder.add_ball("ball", {0, 0, 25, 20}, diffuse(0.8f, 0.2f, 0.1f));
    builder.add_ball("bulb", {40, 10, 25, 6}, emissive(4, 3, 1));
    builder.add_light(bulb({-20, 180, 130}, 20, 1500, ARHOST_FALLOFF_INVERSE_SQUARE));
    return builder;
}
SceneBuilder lacquered_desk_with_glass() {
    SceneBuilder builder = desk(mirror(0.9f), metallic_roughness({0.6f, 0.6f, 0.6f}, 0.2f, 0.25f));
    add_environment(builder,
                    [](std::uint32_t column) { return glm::vec3(1, 1 + 0.1f * static_cast<float>(column), 1); });
    builder.environment.follows_video = true;
    builder.add_light(bulb({-60, -40, 120}, 10, 5000, ARHOST_FALLOFF_INVERSE_SQUARE));
    builder.add_ball("glass", {-35, 20, 12, 12}, glass_of(1.5f));
    builder.add_ball("red", {-5, 45, 10, 10}, diffuse(0.8f, 0.2f, 0.1f));
    return builder;
}

arhost_light coloured(arhost_light lamp, float r, float g, float b) {
    for (int i = 0; i < 3; ++i)
        lamp.intensity[i] *= (i == 0 ? r : i == 1 ? g : b);
    return lamp;
}

// A mirror, a glass ball and metal, which throw the light of lamps onto a desk and a wall.
SceneBuilder caustics() {
    SceneBuilder builder(path_settings(glm::vec3(0.1f)));
    arhost_material glass = glass_of(1.5f), metal = scene::make_material(ARHOST_MATERIAL_METAL);
    set3(glass.extinction, 0.02f, 0.005f, 0.01f);
    set3(metal.diffuse, 0.3f, 0.2f, 0.1f);
    set3(metal.reflectivity, 0.6f, 0.5f, 0.3f);
    builder.add_mesh("desk", square(90), diffuse(0.6f, 0.6f, 0.6f), ARHOST_ROLE_CATCHER);
    builder.add_mesh("wall", quad({-80, 60, 0}, {80, 60, 0}, {80, 60, 80}, {-80, 60, 80}),
                     metallic_roughness({0.6f, 0.6f, 0.6f}, 0, 0.5f));
    builder.add_mesh("mirror", quad({-70, 30, 1}, {-60, -30, 1}, {-60, -30, 40}, {-70, 30, 40}), mirror(0.9f));
    builder.add_ball("glass", {-15, -10, 18, 15}, glass);
    builder.add_ball("frosted", {-30, 25, 15, 14}, glass_of(1.5f, 0.3f));
    builder.add_ball("metal", {30, 20, 18, 15}, metal);
    return builder;
}
// Each colour channel shows one type of lamp.
SceneBuilder caustics_of_wide_lamps() {
    SceneBuilder builder = caustics();
    builder.add_light(coloured(round_spot(), 1, 0, 0));
    builder.add_light(coloured(panel({0, 0, 120}, {20, 10}, 8000, ARHOST_FALLOFF_INVERSE_SQUARE), 0, 1, 0));
    builder.add_light(coloured(bulb({40, -40, 100}, 15, 1), 0, 0, 1));
    return builder;
}
SceneBuilder caustics_of_small_lamps() {
    SceneBuilder builder = caustics();
    for (const glm::vec3 &position :
         {glm::vec3(40, -40, 100), glm::vec3(-15, -10, 18)}) // the latter in the glass ball
        builder.add_light(coloured(bulb(position, 1, 8000, ARHOST_FALLOFF_INVERSE_SQUARE), 1, 0, 0));
    builder.add_light(coloured(light(-20, -60, 80, 1), 0, 1, 0));
    builder.add_light(coloured(sun(-0.6f, 0, -0.8f), 0, 0, 1));
    return builder;
}

// An emissive square and a mirror that move over a desk within a second.
SceneBuilder moving_lamp_and_mirror() {
    SceneBuilder builder(path_settings());
    builder.settings.duration_s = 1;
    builder.add_mesh("desk", square(90), diffuse(0.6f, 0.6f, 0.6f));
    builder.add_light(round_spot());
    const scene::Motion motion{.moves = true, .node = builder.add_moving_node({-40, 0, 0}, {40, 0, 0})};
    builder.add_animated("lamp", square(10, 40), emissive(8, 4, 2), motion);
    builder.add_animated("mirror", quad({-35, 20, 1}, {-35, -20, 1}, {-35, -20, 30}, {-35, 20, 30}), mirror(0.9f),
                         motion);
    return builder;
}

arhost_camera into_the_box() {
    return camera({0, -150, 60}, {0, 0, 45}, {0, 0, 1}, small);
}

} // namespace

class PathIntegrator : public testing::Test {
protected:
    void SetUp() override { ARHOST_REQUIRE_VULKAN(); }
};

namespace {

void expect_rt_embrees_picture(SceneBuilder (*scene)(), const arhost_camera &view, const Options &options,
                               const std::string &path = "plain", const Video *video = nullptr) {
    Options with_path = options;
    with_path["path"] = path;
    LinearTracer vulkan(scene(), with_path, "rt_vulkan"), embree(scene(), options, "rt_embree");
    for (LinearTracer *tracer : {&vulkan, &embree})
        ASSERT_EQ(tracer->start(view.intrinsics, video), ARHOST_STATUS_OK) << tracer->log();
    expect_like(vulkan.render(view, 3, video), embree.render(view, 3, video));
}

} // namespace

TEST_F(PathIntegrator, LightsABoxAsRtEmbreeDoes) {
    expect_rt_embrees_picture(&lit_box, into_the_box(), {{"samples", "64"}});
}

TEST_F(PathIntegrator, ScattersLightInGlassAndMetalAsRtEmbreeDoes) {
    expect_rt_embrees_picture(&balls_in_an_environment, from_the_side(small), {{"samples", "64"}});
}

TEST_F(PathIntegrator, ShadesAllMaterialsAsRtEmbreeDoes) {
    expect_rt_embrees_picture(&squares_of_all_materials, from_the_side(small), {{"samples", "128"}});
}

TEST_F(PathIntegrator, ChangesCatchersAsRtEmbreeDoes) {
    expect_rt_embrees_picture(&desk_with_lamps, from_the_side(small), {{"samples", "64"}, {"max_radiance", "0"}});
}

// The brightness of the video tells how much a lamp of a room without known light brightens the desk.
TEST_F(PathIntegrator, RelatesEmissiveObjectsToTheVideoAsRtEmbreeDoes) {
    const Video video(small);
    expect_rt_embrees_picture(&desk_with_a_lit_cube, from_the_side(small), {{"samples", "64"}}, "plain", &video);
}

TEST_F(PathIntegrator, ChangesFilmedSurfacesAsRtEmbreeDoes) {
    const Video video(small);
    expect_rt_embrees_picture(&desk_in_a_mirror, from_the_side(small), {{"samples", "64"}, {"light_samples", "4"}},
                              "plain", &video);
}

TEST_F(PathIntegrator, ThrowsTheLightOfWideLampsAsRtEmbreeDoes) {
    expect_rt_embrees_picture(&caustics_of_wide_lamps, from_the_side(small),
                              {{"samples", "64"}, {"photons", "2048"}});
}

TEST_F(PathIntegrator, ThrowsTheLightOfSmallLampsAsRtEmbreeDoes) {
    expect_rt_embrees_picture(&caustics_of_small_lamps, from_the_side(small),
                              {{"samples", "5"}, {"photons", "100000"}, {"light_samples", "16"}});
}

TEST_F(PathIntegrator, MoreSamplesBringMorePhotons) {
    const arhost_camera view = from_the_side(small);
    const auto picture_of = [&](Tracer &tracer) {
        Picture picture(small);
        EXPECT_EQ(tracer.try_render(view, picture), ARHOST_STATUS_OK) << tracer.log();
        return picture.pixels();
    };
    Tracer tracer(caustics_of_small_lamps(), {{"samples", "2"}, {"photons", "2000"}}, "rt_vulkan");
    ASSERT_EQ(tracer.start(small), ARHOST_STATUS_OK) << tracer.log();
    const auto few = picture_of(tracer);
    ASSERT_EQ(tracer.plugin().set_text("samples", "8"), ARHOST_STATUS_OK) << tracer.log();
    const auto many = picture_of(tracer);
    EXPECT_NE(few, many);
    Tracer other(caustics_of_small_lamps(), {{"samples", "8"}, {"photons", "2000"}}, "rt_vulkan");
    ASSERT_EQ(other.start(small), ARHOST_STATUS_OK) << other.log();
    EXPECT_EQ(picture_of(other), many);
    ASSERT_EQ(tracer.plugin().set_text("samples", "2"), ARHOST_STATUS_OK) << tracer.log();
    EXPECT_EQ(picture_of(tracer), few);
}

TEST_F(PathIntegrator, LeavesOtherPixelsUntouched) {
    LinearTracer tracer(desk_with_lamps(), {{"samples", "4"}}, "rt_vulkan");
    ASSERT_EQ(tracer.start(small), ARHOST_STATUS_OK) << tracer.log();
    const LinearPicture picture = tracer.render(camera({0, -300, 220}, {0, 0, 0}, {0, 0, 1}, small));
    const arhost_render_info &info = picture.info;
    int inside = 0;
    for (std::uint32_t y = 0; y < small.height; ++y)
        for (std::uint32_t x = 0; x < small.width; ++x) {
            const bool in_region = x >= info.region_x && x < info.region_x + info.region_width &&
                                   y >= info.region_y && y < info.region_y + info.region_height;
            inside += in_region;
            EXPECT_TRUE(in_region || picture.at(x, y) == untouched) << x << " " << y;
        }
    EXPECT_EQ(picture.at(0, 0), untouched) << "beside the desk";
    EXPECT_GT(inside, 50);
    EXPECT_LT(inside, 1500);
    EXPECT_EQ(picture.at(24, 17)[4], 0) << "the ball lets no light through";
}

TEST_F(PathIntegrator, KeepsEnergyInAFurnace) {
    SceneBuilder builder(path_settings(glm::vec3(0), 32));
    add_environment(builder, [](std::uint32_t) { return glm::vec3(0.5f); });
    builder.add_ball("diffuse", {-45, 0, 0, 20}, diffuse(1, 1, 1));
    builder.add_ball("glass", {0, 0, 0, 20}, glass_of(1.5f));
    builder.add_ball("mirror", {45, 0, 0, 20}, mirror(1));
    LinearTracer tracer(std::move(builder), {{"samples", "64"}}, "rt_vulkan");
    ASSERT_EQ(tracer.start(small), ARHOST_STATUS_OK) << tracer.log();
    const LinearPicture picture = tracer.render(camera({0, -150, 0}, {0, 0, 0}, {0, 0, 1}, small));
    for (const std::uint32_t middle : {9u, 24u, 38u}) {
        double sum = 0;
        for (std::uint32_t y = 15; y < 21; ++y)
            for (std::uint32_t x = middle - 3; x < middle + 3; ++x) {
                sum += double{picture.value(x, y, 1)} / 36;
                EXPECT_EQ(picture.value(x, y, 5), 0) << x << " " << y;
            }
        EXPECT_NEAR(sum, 0.5, 0.005) << middle;
    }
}

TEST_F(PathIntegrator, FollowsMovingEmittersAndMirrors) {
    const Options options{{"samples", "32"}};
    LinearTracer vulkan(moving_lamp_and_mirror(), options, "rt_vulkan"),
        embree(moving_lamp_and_mirror(), options, "rt_embree");
    for (LinearTracer *tracer : {&vulkan, &embree})
        ASSERT_EQ(tracer->start(small), ARHOST_STATUS_OK) << tracer->log();
    for (const double time_s : {0.0, 1.0})
        expect_like(vulkan.render(from_the_side(small), 0, nullptr, time_s),
                    embree.render(from_the_side(small), 0, nullptr, time_s));
}

TEST_F(PathIntegrator, AccumulatesToRtEmbreesPicture) {
    const Options options{{"samples", "8"}, {"accumulate", "true"}};
    const Video saturated(small, 255);
    for (const Video *video : {static_cast<const Video *>(nullptr), &saturated}) {
        LinearTracer vulkan(lacquered_desk(), options, "rt_vulkan"), embree(lacquered_desk(), options, "rt_embree");
        for (LinearTracer *tracer : {&vulkan, &embree}) {
            ASSERT_EQ(tracer->start(small, video), ARHOST_STATUS_OK) << tracer->log();
            for (int i = 0; i < 7; ++i)
                tracer->render(from_the_side(small), 0, video);
        }
        expect_like(vulkan.render(from_the_side(small), 0, video), embree.render(from_the_side(small), 0, video));
    }
}

TEST_F(PathIntegrator, WritesStraightImages) {
    const Options options{{"samples", "32"}};
    const Picture got = Tracer(desk_with_lamps(), options, "rt_vulkan").render(from_the_side(small)),
                  expected = Tracer(desk_with_lamps(), options).render(from_the_side(small));
    int differ = 0, shadowed = 0;
    for (std::uint32_t y = 0; y < small.height; ++y)
        for (std::uint32_t x = 0; x < small.width; ++x) {
            differ += std::abs(got.alpha(x, y) - expected.alpha(x, y)) > 2;
            shadowed += got.alpha(x, y) > 20 && got.alpha(x, y) < 255;
        }
    EXPECT_LE(differ, 17) << "1 % of the pixels";
    EXPECT_GT(shadowed, 50);
    const Likeness like = likeness(got, expected);
    EXPECT_GE(like.psnr(), 40) << like;
}

// A lamp of one colour behind coloured glass lights the desk in the glass's colour.
TEST_F(PathIntegrator, LampsShineThroughGlass) {
    const auto light_of = [](bool has_glass) {
        SceneBuilder builder(path_settings());
        add_environment(builder, [](std::uint32_t) { return glm::vec3(0); });
        arhost_material glass = glass_of(1.0f);
        set3(glass.refraction, 0.8f, 0.4f, 0.4f);
        builder.add_mesh("desk", square(90), diffuse(0.5f, 0.5f, 0.5f));
        builder.add_light(light(0, 0, 100, 2000, ARHOST_FALLOFF_INVERSE_SQUARE));
        builder.add_mesh("pane", square(5, has_glass ? 90.0f : 200.0f), glass);
        LinearTracer tracer(std::move(builder), {{"samples", "4"}}, "rt_vulkan");
        EXPECT_EQ(tracer.start(small), ARHOST_STATUS_OK) << tracer.log();
        const LinearPicture picture = tracer.render(camera({0, -60, 20}, {0, 0, 0}, {0, 0, 1}, small));
        std::array<double, 2> mean{};
        for (std::uint32_t y = 15; y < 27; ++y)
            for (std::uint32_t x = 12; x < 36; ++x)
                for (std::size_t channel : {0, 1})
                    mean[channel] += double{picture.value(x, y, channel)} / (12 * 24);
        return mean;
    };
    const auto without = light_of(false), with = light_of(true);
    EXPECT_GT(without[0], 0.05);
    EXPECT_NEAR(with[0] / without[0], 0.8, 0.01);
    EXPECT_NEAR(with[1] / without[1], 0.4, 0.01);
}

// Each traversal path (option `path` of rt_vulkan), with all kinds of rays.
class PathIntegratorOnEachPath : public testing::TestWithParam<std::string> {
protected:
    void SetUp() override { ARHOST_REQUIRE_VULKAN(GetParam()); }
};
INSTANTIATE_TEST_SUITE_P(Paths, PathIntegratorOnEachPath, testing::Values("plain", "query", "pipeline"),
                         [](const auto &info) { return info.param; });

TEST_P(PathIntegratorOnEachPath, ShowsTheVideoInAMirrorAsRtEmbreeDoes) {
    const arhost_intrinsics lens = with_lens(small, ARHOST_DISTORTION_BROWN, {-0.2, 0.05, 0.001, -0.002});
    const Video video(lens);
    expect_rt_embrees_picture(&lacquered_desk_with_glass, from_the_side(lens),
                              {{"samples", "64"}, {"photons", "2048"}}, GetParam(), &video);
}

TEST_P(PathIntegratorOnEachPath, EqualRequestsGiveEqualBytes) {
    const Video video(small);
    LinearTracer tracer(lacquered_desk_with_glass(), {{"samples", "2"}, {"path", GetParam()}}, "rt_vulkan");
    ASSERT_EQ(tracer.start(small, &video), ARHOST_STATUS_OK) << tracer.log();
    const auto first = tracer.render(from_the_side(small), 7, &video).pixels(); // in bands
    EXPECT_NE(tracer.render(from_the_side(small), 7).pixels(), first) << "the mirror shows the video";
    EXPECT_NE(tracer.render(from_the_side(small), 8, &video).pixels(), first) << "the noise of each frame differs";
    EXPECT_EQ(tracer.render(from_the_side(small), 7, &video).pixels(), first);
}

TEST_P(PathIntegratorOnEachPath, ValidationReportsNothing) {
    if (PluginUnderTest("rt_vulkan").create({{"validate", "true"}}) != ARHOST_STATUS_OK)
        GTEST_SKIP() << "needs Vulkan's validation layers";
    const Options options{{"validate", "true"}, {"path", GetParam()}};
    const Video video(small);
    LinearTracer filmed(lacquered_desk_with_glass(), options, "rt_vulkan"),
        moving(moving_lamp_and_mirror(), options, "rt_vulkan");
    ASSERT_EQ(filmed.start(small, &video), ARHOST_STATUS_OK) << filmed.log();
    ASSERT_EQ(moving.start(small), ARHOST_STATUS_OK) << moving.log();
    for (std::uint64_t i = 0; i < 4; ++i) {
        filmed.render(from_the_side(small), i, &video);
        moving.render(from_the_side(small), i, nullptr, 0.2 * static_cast<double>(i));
    }
    EXPECT_EQ(filmed.log().find("Vulkan validation: "), std::string::npos) << filmed.log();
    EXPECT_EQ(moving.log().find("Vulkan validation: "), std::string::npos) << moving.log();
}

TEST(PathIntegratorPlugin, DeclaresLinearImagesAndVideo) {
    const PluginUnderTest plugin("rt_vulkan");
    EXPECT_TRUE(plugin.descriptor().capabilities & ARHOST_RAYTRACER_CAPABILITY_LINEAR_IMAGES);
    EXPECT_TRUE(plugin.descriptor().capabilities & ARHOST_RAYTRACER_CAPABILITY_VIDEO);
}

TEST(PathIntegratorPlugin, RejectsLinearImagesOfTheOtherIntegrator) {
    ARHOST_REQUIRE_VULKAN();
    LinearTracer tracer(rich_scene(), {}, "rt_vulkan");
    EXPECT_EQ(tracer.start(small), ARHOST_STATUS_ERROR_INVALID_ARGUMENT);
    EXPECT_NE(tracer.log().find("linear images need a scene with the path integrator"), std::string::npos)
        << tracer.log();
}

} // namespace arhost::test
