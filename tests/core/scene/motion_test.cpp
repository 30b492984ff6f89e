// SPDX-License-Identifier: Apache-2.0
#include "scene/motion.hpp"
#include "scene_samples.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

using namespace arhost::scene;
using namespace arhost::scene::test;
using testing::ElementsAre;
using testing::FloatNear;

namespace {

constexpr float half_root = 0.70710678f; // √2/2, the sine and cosine of 45°

// A ball at the origin whose node has one channel.
Arena ball_with(Channel channel, float duration_s = 2) {
    ArenaBuilder builder;
    builder.settings.duration_s = duration_s;
    MotionNode node;
    node.animated = true;
    builder.add_node(node);
    builder.add_channel(std::move(channel));
    builder.add_object("ball", builder.add_spheres({{0, 0, 0, 1}}), builder.add_material(grey()), ARHOST_ROLE_VIRTUAL,
                       glm::mat4x3(1), {true, false, 0, ARHOST_NONE});
    return build(std::move(builder));
}

float x_at(const Arena &arena, double time_s) {
    MotionEvaluator evaluator(arena.scene());
    return evaluator.at(time_s).moved[0].world_from_object[9];
}

// The bending square. Its skin has two joints; the second is a child of the first, 10 mm to the right of it.
Arena bend(const std::vector<Channel> &channels, const glm::mat4x3 &root = glm::mat4x3(1), bool morphs = false) {
    ArenaBuilder builder;
    builder.settings.duration_s = 2;
    MotionNode world;
    world.parent_from_node = root;
    builder.add_node(world);
    for (std::uint32_t i = 0; i < 2; ++i) {
        MotionNode joint;
        joint.parent = i;
        joint.animated = true;
        joint.translation = glm::vec3(i == 0 ? 0 : 10, 0, 0);
        builder.add_node(joint);
    }
    MotionNode weighted;
    weighted.morph_weights = {0};
    builder.add_node(weighted);
    for (const Channel &channel : channels)
        builder.add_channel(channel);
    const glm::mat4x3 ten_left(glm::vec3(1, 0, 0), glm::vec3(0, 1, 0), glm::vec3(0, 0, 1), glm::vec3(-10, 0, 0));
    const std::uint32_t skin = builder.add_skin({{1, 2}, {glm::mat4x3(1), ten_left}});
    TriangleMesh mesh = bending_square();
    if (!morphs)
        mesh.morph_positions = mesh.morph_normals = {};
    builder.add_object("bend", builder.add_triangles(mesh), builder.add_material(grey()), ARHOST_ROLE_VIRTUAL,
                       glm::mat4x3(1), {false, true, morphs ? 3 : ARHOST_NONE, skin});
    return build(std::move(builder));
}

std::vector<float> triple(const float *values, std::size_t i) {
    return {values[3 * i], values[3 * i + 1], values[3 * i + 2]};
}

} // namespace

TEST(Motion, InterpolatesLinearlyAndLoops) {
    const Arena arena =
        ball_with({0, ARHOST_CHANNEL_TRANSLATION, ARHOST_INTERPOLATION_LINEAR, {0.5f, 1.5f}, {1, 0, 0, 5, 0, 0}});
    EXPECT_EQ(x_at(arena, 0), 1) << "before the first key";
    EXPECT_EQ(x_at(arena, 1), 3);
    EXPECT_EQ(x_at(arena, 1.75), 5) << "after the last key";
    EXPECT_EQ(x_at(arena, 2), 1);
    EXPECT_EQ(x_at(arena, 201), 3);
    EXPECT_EQ(x_at(arena, -1), 3);
    EXPECT_EQ(x_at(arena, std::nan("")), 1);
}

TEST(Motion, HoldsStepKeyframes) {
    const Arena arena =
        ball_with({0, ARHOST_CHANNEL_TRANSLATION, ARHOST_INTERPOLATION_STEP, {0, 1}, {1, 0, 0, 5, 0, 0}});
    EXPECT_EQ(x_at(arena, 0.99), 1);
    EXPECT_EQ(x_at(arena, 1), 5);
}

// By glTF 2.0, appendix C.5, with t_d = 2, the value in the middle is 1/2 v0 + 2/8 b0 + 1/2 v1 − 2/8 a1.
TEST(Motion, InterpolatesCubicSplines) {
    const Arena arena = ball_with({0,
                                   ARHOST_CHANNEL_TRANSLATION,
                                   ARHOST_INTERPOLATION_CUBIC,
                                   {0, 2},
                                   {9, 9, 9, 1, 0, 0, 4, 0, 0, /**/ 8, 0, 0, 5, 0, 0, 9, 9, 9}},
                                  4);
    EXPECT_EQ(x_at(arena, 0), 1);
    EXPECT_FLOAT_EQ(x_at(arena, 1), 0.5f + 1 + 2.5f - 2);
    EXPECT_FLOAT_EQ(x_at(arena, 0.5), 27 / 32.f * 1 + 2 * 9 / 64.f * 4 + 5 / 32.f * 5 - 2 * 3 / 64.f * 8);
    EXPECT_EQ(x_at(arena, 2), 5);
}

TEST(Motion, RotatesAlongTheShortestPath) {
    // The second keyframe is a rotation by 90° about z, with the opposite sign of the quaternion. The object must
    // still rotate by 90°, not by 270°.
    const Arena arena = ball_with({0,
                                   ARHOST_CHANNEL_ROTATION,
                                   ARHOST_INTERPOLATION_LINEAR,
                                   {0, 1},
                                   {0, 0, 0, 1, 0, 0, -half_root, -half_root}});
    MotionEvaluator evaluator(arena.scene());
    const float *m = evaluator.at(1 / 3.0).moved[0].world_from_object; // 30°
    EXPECT_THAT(std::vector<float>(m, m + 6), ElementsAre(FloatNear(0.8660254f, 1e-6f), FloatNear(0.5f, 1e-6f), 0,
                                                          FloatNear(-0.5f, 1e-6f), FloatNear(0.8660254f, 1e-6f), 0));
}

TEST(Motion, KeepsAScaleOfZeroInvertible) {
    const Arena arena = ball_with({0, ARHOST_CHANNEL_SCALE, ARHOST_INTERPOLATION_LINEAR, {0, 1}, {1, 1, 1, 0, 0, 0}});
    MotionEvaluator evaluator(arena.scene());
    EXPECT_EQ(evaluator.at(1.5).moved[0].world_from_object[4], 1e-6f);
}

TEST(Motion, MovesChildJoints) {
    // Joint 0 rotates by 90° about z; joint 1 follows and moves by 2 along its own x.
    const Arena arena =
        bend({{1, ARHOST_CHANNEL_ROTATION, ARHOST_INTERPOLATION_STEP, {1}, {0, 0, half_root, half_root}},
              {2, ARHOST_CHANNEL_TRANSLATION, ARHOST_INTERPOLATION_STEP, {0}, {12, 0, 0}}});
    MotionEvaluator evaluator(arena.scene());
    const arhost_motion motion = evaluator.at(1);
    ASSERT_EQ(motion.deformed_count, 1u);
    EXPECT_EQ(motion.moved_count, 0u);
    EXPECT_EQ(motion.deformed[0].vertex_count, 4u);
    const auto near = [](float value) { return FloatNear(value, 1e-4f); };
    // A vertex of joint 0: (−10, −10, 5) → (10, −10, 5). A vertex of joint 1: (10, −10, 5) is (0, −10, 5) in the
    // space of joint 1; (12, −10, 5) in the space of joint 0 after the move; and (10, 12, 5) after the rotation.
    EXPECT_THAT(triple(motion.deformed[0].positions, 0), ElementsAre(near(10), near(-10), near(5)));
    EXPECT_THAT(triple(motion.deformed[0].positions, 1), ElementsAre(near(10), near(12), near(5)));
    EXPECT_THAT(triple(motion.deformed[0].normals, 1), ElementsAre(near(0), near(0), near(1)));
}

TEST(Motion, CollapsesAnObjectBeyondTheCoordinateLimit) {
    ArenaBuilder builder;
    builder.settings.duration_s = 2;
    MotionNode parent, child;
    parent.animated = true;
    child.parent = builder.add_node(parent);
    child.parent_from_node[3] = glm::vec3(9e8f, 0, 0);
    const std::uint32_t node = builder.add_node(child);
    builder.add_channel(
        {0, ARHOST_CHANNEL_TRANSLATION, ARHOST_INTERPOLATION_LINEAR, {0, 1}, {-9e8f, 0, 0, 9e8f, 0, 0}});
    builder.add_object("s", builder.add_triangles(square()), builder.add_material(grey()), ARHOST_ROLE_VIRTUAL,
                       glm::mat4x3(1), {true, false, node, ARHOST_NONE});
    const Arena arena = std::move(builder).build();
    MotionEvaluator fresh(arena.scene()), used(arena.scene());
    EXPECT_EQ(used.at(0).moved[0].world_from_object[0], 1);
    for (MotionEvaluator *evaluator : {&fresh, &used})
        for (int i = 0; i < 12; ++i) // at 1.8e9 mm
            EXPECT_LT(std::abs(evaluator->at(1.5).moved[0].world_from_object[i]), 1e-6f) << i;
}

// Two balls on anchors; the second one also moves by its own keyframes, 10 mm in 1 s.
Arena anchored_balls() {
    ArenaBuilder builder;
    builder.settings.duration_s = 2;
    const std::uint32_t cup = builder.add_anchor("cup"), lid = builder.add_anchor("lid");
    MotionNode node;
    node.animated = true;
    node.parent = lid;
    const std::uint32_t moving = builder.add_node(node);
    builder.add_channel(
        {moving, ARHOST_CHANNEL_TRANSLATION, ARHOST_INTERPOLATION_LINEAR, {0, 1, 2}, {0, 0, 0, 10, 0, 0, 0, 0, 0}});
    for (const std::uint32_t on : {cup, moving})
        builder.add_object("ball", builder.add_spheres({{0, 0, 0, 1}}), builder.add_material(grey()),
                           ARHOST_ROLE_VIRTUAL, glm::mat4x3(1), {true, false, on, ARHOST_NONE});
    return build(std::move(builder));
}

Anchored at_mm(double x, double y, double z) {
    Anchored anchor{true, glm::dmat4(1)};
    anchor.world_from_anchor[3] = {x, y, z, 1};
    return anchor;
}

TEST(Motion, FollowsAnchorsAndTheirChildren) {
    const Arena arena = anchored_balls();
    MotionEvaluator evaluator(arena.scene());
    const std::vector<Anchored> anchors{at_mm(1, 2, 3), at_mm(100, 0, 0)};
    const arhost_motion motion = evaluator.at(1, anchors);
    ASSERT_EQ(motion.moved_count, 2u);
    EXPECT_EQ(motion.moved[0].world_from_object[9], 1);
    EXPECT_EQ(motion.moved[0].world_from_object[11], 3);
    EXPECT_EQ(motion.moved[1].world_from_object[9], 110) << "its own motion, in the frame of the target";
    EXPECT_TRUE(motion.moved[0].is_visible && motion.moved[1].is_visible);
}

TEST(Motion, HidesObjectsWhoseAnchorIsNotVisible) {
    const Arena arena = anchored_balls();
    MotionEvaluator evaluator(arena.scene());
    const std::vector<Anchored> anchors{at_mm(1, 2, 3), Anchored{}};
    arhost_motion motion = evaluator.at(1, anchors);
    EXPECT_EQ(motion.moved[0].is_visible, 1u);
    EXPECT_EQ(motion.moved[1].is_visible, 0u) << "a child of the anchor";
    motion = evaluator.at(1, std::vector{at_mm(1, 2, 3), at_mm(0, 0, 0)});
    EXPECT_EQ(motion.moved[1].is_visible, 1u);
}

TEST(Motion, AnchorsAreAtTheOriginIfTheirTargetsAreUnknown) {
    const Arena arena = anchored_balls();
    EXPECT_EQ(arena.scene().bounds_max[0], 1) << "at time 0";
    MotionEvaluator evaluator(arena.scene());
    EXPECT_EQ(evaluator.at(1).moved[1].world_from_object[9], 10);
}

TEST(Motion, BlendsJointsByWeight) {
    ArenaBuilder builder;
    builder.settings.duration_s = 1;
    MotionNode still, raised;
    raised.parent_from_node[3] = glm::vec3(0, 0, 8);
    builder.add_node(still);
    builder.add_node(raised);
    TriangleMesh mesh = square();
    mesh.joints.assign(4, {0, 1, 0, 0});
    mesh.weights.assign(4, {0.75f, 0.25f, 0, 0});
    const std::uint32_t skin = builder.add_skin({{0, 1}, {glm::mat4x3(1), glm::mat4x3(1)}});
    builder.add_object("s", builder.add_triangles(mesh), builder.add_material(grey()), ARHOST_ROLE_VIRTUAL,
                       glm::mat4x3(1), {false, true, ARHOST_NONE, skin});
    const Arena arena = build(std::move(builder));
    EXPECT_EQ(arena.scene().bounds_max[2], 7) << "5 and a quarter of 8";
    MotionEvaluator evaluator(arena.scene());
    EXPECT_THAT(triple(evaluator.at(0).deformed[0].positions, 2), ElementsAre(10, 10, 7));
}

TEST(Motion, TransformsNormalsByTheInverseTranspose) {
    // Shearing (z becomes z + x) tilts the normal of the plane z = 5 back. Mirroring keeps the normal on its side.
    const glm::mat4x3 sheared(glm::vec3(1, 0, 1), glm::vec3(0, 1, 0), glm::vec3(0, 0, 1), glm::vec3(0));
    const auto near = [](float value) { return FloatNear(value, 1e-6f); };
    {
        const Arena arena = bend({}, sheared);
        MotionEvaluator evaluator(arena.scene());
        EXPECT_THAT(triple(evaluator.at(0).deformed[0].normals, 0),
                    ElementsAre(near(-half_root), near(0), near(half_root)));
    }
    glm::mat4x3 mirrored(1);
    mirrored[0].x = -1;
    const Arena arena = bend({}, mirrored);
    MotionEvaluator evaluator(arena.scene());
    EXPECT_THAT(triple(evaluator.at(0).deformed[0].normals, 0), ElementsAre(near(0), near(0), near(1)));
}

TEST(Motion, AppliesMorphTargetsBeforeTheSkin) {
    const Arena arena =
        bend({{3, ARHOST_CHANNEL_MORPH_WEIGHTS, ARHOST_INTERPOLATION_LINEAR, {0, 2}, {0, 3}}}, glm::mat4x3(2), true);
    MotionEvaluator evaluator(arena.scene());
    // At 1 s the morph weight is 1.5, so z = (5 + 1.5) · 2.
    EXPECT_THAT(triple(evaluator.at(1).deformed[0].positions, 3), ElementsAre(-20, 20, 13));
    EXPECT_THAT(triple(evaluator.at(0).deformed[0].positions, 3), ElementsAre(-20, 20, 10));
}

TEST(Motion, MorphsUnskinnedObjectsInObjectSpace) {
    ArenaBuilder builder;
    builder.settings.duration_s = 2;
    MotionNode node;
    node.parent_from_node[3] = glm::vec3(100, 0, 0);
    node.morph_weights = {0};
    builder.add_node(node);
    builder.add_channel({0, ARHOST_CHANNEL_MORPH_WEIGHTS, ARHOST_INTERPOLATION_LINEAR, {0, 2}, {0, 2}});
    TriangleMesh mesh = square();
    mesh.morph_positions.assign(4, {0, 0, 1});
    mesh.morph_normals.assign(4, {1, 0, 0});
    builder.add_object("s", builder.add_triangles(mesh), builder.add_material(grey()), ARHOST_ROLE_VIRTUAL,
                       glm::mat4x3(1), {true, true, 0, ARHOST_NONE});
    const Arena arena = build(std::move(builder));
    MotionEvaluator evaluator(arena.scene());
    const arhost_motion motion = evaluator.at(1);
    EXPECT_EQ(motion.moved[0].world_from_object[9], 100);
    EXPECT_THAT(triple(motion.deformed[0].positions, 0), ElementsAre(-10, -10, 6));
    EXPECT_THAT(triple(motion.deformed[0].normals, 0),
                ElementsAre(FloatNear(half_root, 1e-6f), 0, FloatNear(half_root, 1e-6f)));
}

TEST(Motion, EvaluatesASkinOfAHundredThousandVertices) {
    ArenaBuilder builder;
    builder.settings.duration_s = 1;
    Skin skin;
    for (std::uint32_t i = 0; i < 50; ++i) {
        builder.add_node({});
        skin.joints.push_back(i);
    }
    skin.node_from_mesh.assign(50, glm::mat4x3(1));
    TriangleMesh mesh;
    for (std::uint32_t i = 0; i < 100'000; ++i) {
        mesh.positions.emplace_back(i % 300, i / 300, 0);
        mesh.normals.emplace_back(0, 0, 1);
        mesh.joints.emplace_back(i % 50, (i + 1) % 50, (i + 2) % 50, (i + 3) % 50);
        mesh.weights.emplace_back(0.25f);
    }
    mesh.triangles = {{0, 1, 300}};
    builder.add_object("s", builder.add_triangles(mesh), builder.add_material(grey()), ARHOST_ROLE_VIRTUAL,
                       glm::mat4x3(1), {false, true, ARHOST_NONE, builder.add_skin(skin)});
    const Arena arena = std::move(builder).build();
    MotionEvaluator evaluator(arena.scene());
    for (int round = 0; round < 10; ++round)
        EXPECT_EQ(evaluator.at(0.1 * round).deformed[0].positions[3 * 99'999], 99'999 % 300);
}
