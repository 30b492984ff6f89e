// SPDX-License-Identifier: Apache-2.0
#include "view/bounds.hpp"
#include "view/ground.hpp"
#include "view/report.hpp"

#include <gmock/gmock.h>

using namespace arhost;
using scene::ArenaBuilder;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

namespace {

// A ball that moves from x = 0 to 100 and back, above a catcher.
ArenaBuilder moving_ball(arhost_axes axes = ARHOST_AXES_Z_UP) {
    ArenaBuilder builder;
    builder.settings.axes = axes;
    builder.settings.duration_s = 2;
    const std::uint32_t grey = builder.add_material(scene::make_material(ARHOST_MATERIAL_DIFFUSE), "gr\x1b[2Jey");
    scene::MotionNode node;
    node.animated = true;
    const std::uint32_t moving = builder.add_node(node);
    builder.add_channel(
        {moving, ARHOST_CHANNEL_TRANSLATION, ARHOST_INTERPOLATION_LINEAR, {0, 1, 2}, {0, 0, 0, 100, 0, 0, 0, 0, 0}});
    builder.add_object("ball", builder.add_spheres({{0, 0, 0, 10}}), grey, ARHOST_ROLE_VIRTUAL, glm::mat4x3(1),
                       {true, false, moving, ARHOST_NONE});
    builder.add_object("desk", builder.add_spheres({{0, 0, -500, 100}}), grey, ARHOST_ROLE_CATCHER);
    return builder;
}

} // namespace

TEST(Bounds, ContainVirtualObjectsOverTheWholeAnimation) {
    const scene::Arena arena = moving_ball().build();
    const scene::Box start = view::box_at_start(arena.scene()), all = view::box_over_animation(arena.scene());
    EXPECT_EQ(start.min, glm::vec3(-10));
    EXPECT_EQ(start.max, glm::vec3(10));
    EXPECT_EQ(all.min, glm::vec3(-10));
    EXPECT_NEAR(all.max.x, 110, 1e-3);
    EXPECT_EQ(all.max.z, 10);
}

TEST(Ground, IsAValidCatcherBelowTheModelThatFacesUp) {
    for (const arhost_axes axes : {ARHOST_AXES_Z_UP, ARHOST_AXES_Y_UP}) {
        const scene::Arena plain = moving_ball(axes).build();
        const scene::Box box = view::box_over_animation(plain.scene());
        const scene::Arena grounded = view::with_ground(plain.scene(), box);
        EXPECT_EQ(scene::validate(grounded.bytes()), "");
        const arhost_scene &scene = grounded.scene();
        const arhost_object ground = view::elements<arhost_object>(scene, scene.objects).back();
        EXPECT_EQ(scene.objects.count, plain.scene().objects.count + 1);
        EXPECT_EQ(ground.role, ARHOST_ROLE_CATCHER);
        const auto geometry = view::elements<arhost_geometry>(scene, scene.geometries)[ground.geometry];
        const auto corners = view::elements<glm::vec3>(scene, geometry.positions);
        const int up = axes == ARHOST_AXES_Z_UP ? 2 : 1;
        for (const glm::vec3 &corner : corners)
            EXPECT_NEAR(corner[up], -10, 0.1);
        for (const glm::uvec3 &t : view::elements<glm::uvec3>(scene, geometry.indices)) {
            const glm::vec3 normal = glm::cross(corners[t.y] - corners[t.x], corners[t.z] - corners[t.x]);
            EXPECT_GT(normal[up], 0);
        }
        EXPECT_LE(scene.bounds_max[0], corners[2].x + 1);
        EXPECT_EQ(view::box_over_animation(scene).max, box.max) << "the ground is no part of the model";
    }
}

TEST(Report, ListsTheContentsInEscapedLines) {
    ArenaBuilder builder = moving_ball();
    builder.contents.animations = {{"Walk", 2}, {"R\nun", 1.5f}};
    builder.contents.variants = {"beach"};
    builder.contents.nodes = 3;
    const scene::Contents contents = builder.contents;
    const scene::Arena arena = std::move(builder).build();
    const view::Report report{"duck.GLB",
                              120'000,
                              view::box_at_start(arena.scene()),
                              view::box_over_animation(arena.scene()),
                              "0",
                              {"duck.GLB: cameras are ignored"}};
    const std::string text = view::to_text(report, arena.scene(), contents);
    EXPECT_THAT(text, AllOf(HasSubstr("duck.GLB: glTF, binary, 120 KB\n"), HasSubstr("  nodes       3\n"),
                            HasSubstr("2 spheres"),
                            HasSubstr("box         20 × 20 × 20 mm, from (-10, -10, -10) to (10, 10, 10)\n"),
                            HasSubstr("120 × 20 × 20 mm"), HasSubstr("over the animation")));
    EXPECT_THAT(text, AllOf(HasSubstr("animations  0 Walk, 2 s, shown\n"), HasSubstr("1 R un, 1.5 s\n"),
                            HasSubstr("variants    beach\n"), HasSubstr("materials   gr [2Jey: diffuse\n"),
                            HasSubstr("notes       cameras are ignored\n"), Not(HasSubstr("\x1b"))));
}
