// SPDX-License-Identifier: Apache-2.0
//
// Checks that moved and deformed objects look the same as static objects of the same shape and place.
#include "bvh_quality.hpp"
#include "embree_scene.hpp"
#include "scene/motion.hpp"
#include "tracer.hpp"

#include <glm/trigonometric.hpp>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace arhost::test {
namespace {

using scene::Motion;

SceneBuilder with_floor_and_light() {
    SceneBuilder builder({.ambient = glm::vec3(0.3f), .duration_s = 1});
    builder.add_mesh("floor", square(80), diffuse(0.8f, 0.8f, 0.8f), ARHOST_ROLE_CATCHER);
    builder.add_light(light(60, -20, 200, 0.7f));
    return builder;
}

// Returns a wavy sheet of n×n squares above the floor.
scene::TriangleMesh sheet(float height, unsigned n = 40) {
    scene::TriangleMesh mesh;
    for (unsigned y = 0; y <= n; ++y)
        for (unsigned x = 0; x <= n; ++x) {
            const float u = static_cast<float>(x) / static_cast<float>(n) - 0.5f,
                        v = static_cast<float>(y) / static_cast<float>(n) - 0.5f;
            mesh.positions.push_back({60 * u, 60 * v, 30 + height * std::sin(12 * u) * std::cos(9 * v)});
            if (x < n && y < n) {
                const unsigned a = y * (n + 1) + x, b = a + n + 1;
                mesh.triangles.push_back({a, a + 1, b});
                mesh.triangles.push_back({a + 1, b + 1, b});
            }
        }
    return mesh;
}

scene::TriangleMesh flat_sheet_that_becomes_wavy() {
    scene::TriangleMesh mesh = sheet(0);
    const scene::TriangleMesh waves = sheet(16);
    for (std::size_t i = 0; i < mesh.positions.size(); ++i)
        mesh.morph_positions.push_back(waves.positions[i] - mesh.positions[i]);
    return mesh;
}
arhost_material blue() {
    return diffuse(0.2f, 0.4f, 0.8f);
}

Picture at_time(SceneBuilder builder, double time_s, const arhost_camera &view = from_the_side()) {
    Tracer tracer(std::move(builder));
    EXPECT_EQ(tracer.start(view.intrinsics), ARHOST_STATUS_OK);
    for (const double earlier : {0.0, 0.9}) // must not affect the picture
        tracer.render_at(earlier, view);
    return tracer.render_at(time_s, view);
}

void expect_alike(const Picture &a, const Picture &b) {
    int different = 0;
    const std::vector<Pixel> these = a.pixels(), those = b.pixels();
    for (std::size_t i = 0; i < these.size(); ++i)
        for (std::size_t c = 0; c < 4; ++c)
            different += std::abs(these[i][c] - those[i][c]) > 1;
    EXPECT_LE(different, 20) << "of 120000 values; rounding may change a few at edges";
}

// The functions below build a square with vertex normals. It faces the camera and the only light, which shines
// straight down.
constexpr float albedo = 0.8f;
arhost_material white() {
    return diffuse(albedo, albedo, albedo);
}
SceneBuilder under_the_sun() {
    SceneBuilder builder({.ambient = glm::vec3(0), .duration_s = 2});
    builder.add_light(sun());
    return builder;
}
scene::TriangleMesh square_with_normals() {
    scene::TriangleMesh mesh = square(40);
    mesh.normals.assign(4, {0, 0, 1});
    return mesh;
}

rt_embree::MeshView view_of(const scene::TriangleMesh &mesh) {
    return {reinterpret_cast<const std::byte *>(mesh.positions.data()),
            reinterpret_cast<const std::byte *>(mesh.triangles.data()), 12, 12,
            static_cast<std::uint32_t>(mesh.triangles.size())};
}

} // namespace

// Static catchers have a separate BVH; moving and instanced catchers are in the BVH of all objects. The picture must
// not depend on this.
TEST(Moving, CatchersReceiveShadowsInAnyBvh) {
    const auto scene = [](const glm::mat4x3 &place, bool moves, float raised) {
        SceneBuilder builder = with_floor_and_light();
        const std::uint32_t node = builder.add_moving_node({0, 0, 0}, {0, 0, 20});
        builder.add_mesh("shelf", moved(square(15), {30, 10, raised}), white(), ARHOST_ROLE_CATCHER, place,
                         moves ? Motion{.moves = true, .node = node} : Motion{});
        // This sheet has enough triangles for the plugin to build a separate BVH for catchers.
        builder.add_mesh("sheet", sheet(10), shiny(0.5f, 0.4f, 30));
        return builder;
    };
    glm::mat4x3 up(1);
    up[3].z = 10;
    const Picture plain = at_time(scene(glm::mat4x3(1), false, 15), 0.5);
    EXPECT_GT(plain.alphas().at(153), 100);
    expect_alike(at_time(scene(up, false, 5), 0.5), plain);
    expect_alike(at_time(scene(glm::mat4x3(1), true, 5), 0.5), plain);
    const Picture elsewhere = at_time(scene(glm::mat4x3(1), true, 5), 0.1);
    EXPECT_NE(elsewhere.pixels(), plain.pixels());
}

TEST(Moving, ObjectFollowsItsNode) {
    SceneBuilder moving = with_floor_and_light();
    const std::uint32_t node = moving.add_moving_node({-40, 0, 0}, {40, 20, 0});
    moving.add_animated("box", cube(10), shiny(0.5f, 0.4f, 30), {.moves = true, .node = node});
    SceneBuilder still = with_floor_and_light();
    still.add_mesh("box", moved(cube(10), {20, 15, 0}), shiny(0.5f, 0.4f, 30));
    expect_alike(at_time(std::move(moving), 0.75), Tracer(std::move(still)).render(from_the_side()));
}

TEST(Moving, MeshFollowsItsMorphTargets) {
    SceneBuilder deforming = with_floor_and_light();
    const std::uint32_t node = deforming.add_morphing_node();
    deforming.add_animated("sheet", flat_sheet_that_becomes_wavy(), blue(), {.deforms = true, .node = node});
    SceneBuilder still = with_floor_and_light();
    still.add_mesh("sheet", sheet(8), blue());
    expect_alike(at_time(std::move(deforming), 0.5), Tracer(std::move(still)).render(from_the_side()));
}

// The skin rotates the square by 60°. By Lambert's law, its brightness drops by the factor cos 60°. If the normals
// were not rotated, the brightness would not change.
TEST(Moving, SkinRotatesNormals) {
    const auto turning = [] {
        SceneBuilder builder = under_the_sun();
        const std::uint32_t joint = builder.add_node({.animated = true, .morph_weights = {}});
        const float sine = std::sin(glm::radians(30.0f)), cosine = std::cos(glm::radians(30.0f)); // half of 60°
        builder.add_channel({.node = joint,
                             .target = ARHOST_CHANNEL_ROTATION,
                             .times = {0, 1},
                             .values = {0, 0, 0, 1, sine, 0, 0, cosine}});
        scene::TriangleMesh mesh = square_with_normals();
        mesh.joints.assign(4, glm::u16vec4(0));
        mesh.weights.assign(4, glm::vec4(1, 0, 0, 0));
        const std::uint32_t skin = builder.add_skin({{joint}, {glm::mat4x3(1)}});
        builder.add_animated("square", mesh, white(), {.deforms = true, .skin = skin});
        return builder;
    };
    const Picture before = at_time(turning(), 0, from_above()), after = at_time(turning(), 1, from_above());
    EXPECT_TRUE(is_code_of(before.at(100, 75)[1], albedo));
    EXPECT_TRUE(is_code_of(after.at(100, 75)[1], albedo * 0.5));
    EXPECT_EQ(before.alpha(100, 75 - 30), 255);
    EXPECT_EQ(after.alpha(100, 75 - 30), 0) << "half of the square's side is foreshortened to 40 mm · cos 60°";
}

// The morph target changes only normals. Halfway through the morph, the normal's offset is 0.5 · 2 tan 60°, which
// tilts the normal by 60°.
TEST(Moving, MorphTargetTiltsNormals) {
    const auto leaning = [] {
        SceneBuilder builder = under_the_sun();
        const std::uint32_t node = builder.add_morphing_node(2);
        scene::TriangleMesh mesh = square_with_normals();
        mesh.morph_positions.assign(4, glm::vec3(0));
        mesh.morph_normals.assign(4, {0, 2 * std::tan(glm::radians(60.0f)), 0});
        builder.add_animated("square", mesh, white(), {.deforms = true, .node = node});
        return builder;
    };
    EXPECT_TRUE(is_code_of(at_time(leaning(), 0, from_above()).at(100, 75)[1], albedo));
    EXPECT_TRUE(is_code_of(at_time(leaning(), 1, from_above()).at(100, 75)[1], albedo * 0.5));
}

TEST(BvhQuality, IsUnaffectedByTranslationScalingAndSlightDeformation) {
    scene::TriangleMesh mesh = sheet(4);
    rt_embree::BvhQuality quality;
    quality.record_build(view_of(mesh));
    EXPECT_NEAR(quality.degradation(view_of(mesh)), 1, 1e-9);
    for (glm::vec3 &p : mesh.positions)
        p = p * 3.0f + glm::vec3(100, 0, 0);
    EXPECT_NEAR(quality.degradation(view_of(mesh)), 1, 1e-3);
    EXPECT_LT(quality.degradation(view_of(sheet(5))), 1.3);
}

// A glTF mesh without a skin can move and deform at the same time.
TEST(Moving, MeshCanMoveAndDeform) {
    SceneBuilder both = with_floor_and_light();
    const std::uint32_t node = both.add_morphing_node();
    both.add_channel({.node = node, .times = {0, 1}, .values = {500, 0, 0, 540, 0, 0}});
    // The mesh is out of view unless its node moves it back.
    both.add_animated("sheet", moved(flat_sheet_that_becomes_wavy(), {-500, 0, 0}), blue(),
                      {.moves = true, .deforms = true, .node = node});
    SceneBuilder still = with_floor_and_light();
    still.add_mesh("sheet", moved(sheet(8), {20, 0, 0}), blue());
    expect_alike(at_time(std::move(both), 0.5), Tracer(std::move(still)).render(from_the_side()));
}

// The plugin skips tiles that the bounds of no object overlap, so the bounds must follow the deformation.
TEST(Moving, DeformedMeshIsTracedOutsideItsOriginalTiles) {
    constexpr float left = -60, right = 60;
    SceneBuilder deforming = under_the_sun(), still = under_the_sun();
    const std::uint32_t node = deforming.add_morphing_node(2);
    scene::TriangleMesh mesh = moved(square(8), {left, 0, 0});
    mesh.morph_positions.assign(mesh.positions.size(), {2 * (right - left), 0, 0});
    deforming.add_animated("square", mesh, white(), {.deforms = true, .node = node});
    still.add_mesh("square", moved(square(8), {right, 0, 0}), white());
    expect_alike(at_time(std::move(deforming), 1, from_above()), Tracer(std::move(still)).render(from_above()));
}

// Returns a wavy sheet whose vertices are shifted along x in strips, each strip further than the previous one.
scene::TriangleMesh sheared(float amount, unsigned n = 40) {
    scene::TriangleMesh mesh = sheet(4, n);
    for (glm::vec3 &p : mesh.positions)
        p.x += amount * std::round(p.y / 3);
    return mesh;
}

TEST(BvhQuality, DegradesWhenNeighboursSeparate) {
    const scene::TriangleMesh whole = sheet(4), torn = sheared(40);
    rt_embree::BvhQuality quality;
    quality.record_build(view_of(whole));
    EXPECT_LT(quality.degradation(view_of(sheared(0.5f))), 1.3);
    EXPECT_GT(quality.degradation(view_of(torn)), 1.3);
    quality.record_build(view_of(torn));
    EXPECT_NEAR(quality.degradation(view_of(torn)), 1, 1e-9);
}

// The mesh has 80,000 triangles; for a mesh of this size, BvhQuality measures only a sample of the triangles.
TEST(BvhQuality, TriggersRebuilds) {
    scene::TriangleMesh mesh = sheet(4, 200);
    const auto vertices = static_cast<std::uint32_t>(mesh.positions.size());
    SceneBuilder builder({.duration_s = 1});
    const std::uint32_t node = builder.add_morphing_node();
    mesh.morph_positions.resize(mesh.positions.size());
    builder.add_animated("sheet", mesh, flat(1, 1, 1), {.deforms = true, .node = node});
    const scene::Arena arena = std::move(builder).build();
    const PluginUnderTest plugin("rt_embree"); // for its host
    rt_embree::EmbreeScene scene(arena.scene(), 1, false, Host(plugin.host()));
    std::vector<std::uint64_t> rebuilds;
    for (const float amount : {0.1f, 200.0f, 200.0f, 0.1f}) {
        std::vector<glm::vec3> positions = sheared(amount, 200).positions;
        positions.resize(vertices + 2); // Embree may read beyond the last vertex
        const arhost_deformed_geometry deformed{0, 1, vertices, 0, &positions[0].x, nullptr};
        scene.move({sizeof(arhost_motion), 0, nullptr, &deformed, 1, 0});
        rebuilds.push_back(scene.rebuilds());
    }
    EXPECT_EQ(rebuilds, (std::vector<std::uint64_t>{0, 1, 1, 2}));
}

// After random displacement, a rebuilt BVH would not be better than the refitted one.
TEST(BvhQuality, IsUnaffectedByRandomDisplacement) {
    scene::TriangleMesh mesh = sheet(4);
    rt_embree::BvhQuality quality;
    quality.record_build(view_of(mesh));
    std::minstd_rand random(1);
    std::uniform_real_distribution<float> unit(-1, 1);
    for (glm::vec3 &p : mesh.positions)
        p += 20.0f * glm::vec3(unit(random), unit(random), unit(random));
    EXPECT_NEAR(quality.degradation(view_of(mesh)), 1, 0.2);
}

} // namespace arhost::test
