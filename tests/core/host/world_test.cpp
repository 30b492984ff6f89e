// SPDX-License-Identifier: Apache-2.0
#include "host/world.hpp"

#include <glm/gtc/matrix_transform.hpp>
#include <glm/gtc/type_ptr.hpp>
#include <gtest/gtest.h>

#include <cstring>
#include <vector>

using namespace arhost::host;

namespace {

constexpr std::uint64_t grace_frames = 10;

struct Visible {
    const char *name;
    glm::dmat4 mt;
    arhost_target_state state = ARHOST_TARGET_DETECTED;
};

std::vector<arhost_target> targets(const std::vector<Visible> &visible) {
    std::vector<arhost_target> all;
    for (const Visible &one : visible) {
        arhost_target &target = all.emplace_back();
        std::strcpy(target.name, one.name);
        target.state = one.state;
        std::copy_n(glm::value_ptr(one.mt), 16, target.mt);
    }
    return all;
}

glm::dmat4 moved(double x, double y, double z, double degrees = 0) {
    return glm::rotate(glm::translate(glm::dmat4(1), {x, y, z}), glm::radians(degrees),
                       glm::dvec3(1, 2, 3) / std::sqrt(14.));
}

struct WorldTest : testing::Test {
    std::optional<glm::dmat4> locate(const std::vector<Visible> &visible, std::uint64_t frame) {
        const auto mt = world.locate("desk", targets(visible), frame, grace_frames);
        return mt ? std::optional(glm::make_mat4(mt->data())) : std::nullopt;
    }
    static void expect_near(const std::optional<glm::dmat4> &mt, const glm::dmat4 &expected) {
        ASSERT_TRUE(mt);
        for (int column = 0; column < 4; ++column)
            for (int row = 0; row < 4; ++row)
                EXPECT_NEAR((*mt)[column][row], expected[column][row], 1e-9) << column << ", " << row;
    }
    World world;
    const glm::dmat4 desk = moved(10, 20, -500, 30), cup = moved(-80, 5, -450, 70), lid = moved(40, -5, -400, 10);
};

} // namespace

TEST_F(WorldTest, IsThePoseOfTheFirstTarget) {
    EXPECT_FALSE(locate({}, 0));
    expect_near(locate({{"cup", cup}, {"desk", desk}}, 1), desk);
}

TEST_F(WorldTest, DoesNotJumpToAnotherTarget) {
    EXPECT_FALSE(locate({{"cup", cup}}, 0)) << "the relation of the cup to the desk is not known yet";
    locate({{"desk", desk}, {"cup", cup}, {"lid", lid}}, 1);
    const glm::dmat4 camera = moved(3, -7, 20, 5); // all targets move in the same way
    expect_near(
        locate({{"desk", camera * desk, ARHOST_TARGET_LOST}, {"cup", camera * cup}, {"lid", camera * lid}}, 2),
        camera * desk);
    expect_near(locate({{"lid", camera * camera * lid}}, 3), camera * camera * desk);
    expect_near(locate({{"desk", lid}}, 4), lid);
}

TEST_F(WorldTest, StaysWithASubstituteWhileItIsVisible) {
    locate({{"desk", desk}, {"cup", cup}, {"lid", lid}}, 0);
    locate({{"lid", lid}}, 1);
    const glm::dmat4 pushed = moved(100, 0, -450); // the cup alone was pushed
    expect_near(locate({{"cup", pushed}, {"lid", lid}}, 2), desk);
}

TEST_F(WorldTest, IsLostAfterTheGracePeriod) {
    locate({{"desk", desk}, {"cup", cup}}, 5);
    EXPECT_TRUE(locate({{"cup", cup}}, 5 + grace_frames));
    EXPECT_FALSE(locate({{"cup", cup}}, 6 + grace_frames));
    EXPECT_TRUE(locate({{"desk", desk}, {"cup", cup}}, 7 + grace_frames));
    EXPECT_TRUE(locate({{"cup", cup}}, 8 + grace_frames)) << "the relation is known again";
}

TEST_F(WorldTest, ARelationThatIsOldIsNotTrusted) {
    locate({{"desk", desk}, {"cup", cup}}, 0);
    for (std::uint64_t frame = 1; frame <= 2 * grace_frames; ++frame)
        locate({{"desk", desk}}, frame); // the cup is out of view, and may be moved
    EXPECT_FALSE(locate({{"cup", cup}}, 2 * grace_frames + 1));
}

TEST_F(WorldTest, LearnsRelationsOnlyFromDetectedTargets) {
    locate({{"desk", desk}, {"cup", cup, ARHOST_TARGET_PREDICTED}}, 0);
    EXPECT_FALSE(locate({{"cup", cup}}, 1));
    locate({{"desk", desk, ARHOST_TARGET_PREDICTED}, {"cup", cup}}, 2);
    EXPECT_FALSE(locate({{"cup", cup}}, 3));
}

TEST_F(WorldTest, RotationsStayOrthonormal) {
    locate({{"desk", desk}, {"cup", cup}}, 0);
    for (std::uint64_t frame = 1; frame < 5; ++frame) {
        const auto mt = locate({{"cup", moved(1, 2, -300, 17.0 * double(frame))}}, frame);
        ASSERT_TRUE(mt);
        const glm::dmat3 rotation(*mt);
        const glm::dmat3 product = glm::transpose(rotation) * rotation;
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j)
                EXPECT_NEAR(product[i][j], i == j, 1e-12);
    }
}
