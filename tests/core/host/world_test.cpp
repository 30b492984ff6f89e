// SPDX-License-Identifier: Apache-2.0
#include "host/world.hpp"

#include <glm/gtc/matrix_transform.hpp>
#include <glm/gtc/type_ptr.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <vector>

using namespace arhost::host;

namespace {

constexpr std::uint64_t grace_frames = 10;

struct Visible {
    const char *name;
    glm::dmat4 mt;
    arhost_target_state state = ARHOST_TARGET_DETECTED;
    double sigma_mm = 0, sigma_rad = 0, ambiguity = 0; // sigma 0: unknown
};

std::vector<arhost_target> targets(const std::vector<Visible> &visible) {
    std::vector<arhost_target> all;
    for (const Visible &one : visible) {
        arhost_target &target = all.emplace_back();
        std::strcpy(target.name, one.name);
        target.state = one.state;
        std::copy_n(glm::value_ptr(one.mt), 16, target.mt);
        target.ambiguity = one.ambiguity;
        for (int i = 0; i < 6; ++i)
            target.covariance[7 * i] = std::pow(i < 3 ? one.sigma_mm : one.sigma_rad, 2);
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

// Targets with the noise that they tell: `bad` is listed first.
struct NoisyWorld : WorldTest {
    std::mt19937 generator{1};
    std::normal_distribution<double> normal;

    Visible noisy(const char *name, const glm::dmat4 &truth, double sigma_mm, double sigma_rad) {
        const auto three = [&](double sigma) {
            return sigma * glm::dvec3(normal(generator), normal(generator), normal(generator));
        };
        const glm::dvec3 turn = three(sigma_rad), shift = three(sigma_mm), place(truth[3]);
        glm::dmat4 mt = glm::rotate(glm::dmat4(1), glm::length(turn), glm::normalize(turn)) * truth;
        mt[3] = glm::dvec4(place + shift, 1);
        return {name, mt, ARHOST_TARGET_DETECTED, sigma_mm, sigma_rad};
    }
    Visible good() { return noisy("lid", lid, 0.3, 0.001); }
    Visible bad() { return noisy("cup", cup, 20, 0.2); }
};

TEST_F(NoisyWorld, FollowsTheTargetsThatAreSeenWell) {
    double worst_mm = 0;
    for (std::uint64_t frame = 0; frame < 80; ++frame) {
        const bool is_hidden = frame >= 40;
        const auto found =
            is_hidden ? world.locate("desk", targets({bad(), good()}), frame, 60)
                      : world.locate("desk", targets({noisy("desk", desk, 0.3, 0.001), bad(), good()}), frame, 60);
        ASSERT_TRUE(found);
        if (is_hidden)
            worst_mm =
                std::max(worst_mm, glm::distance(glm::dvec3(glm::make_mat4(found->data())[3]), glm::dvec3(desk[3])));
    }
    EXPECT_LT(worst_mm, 3);
}

TEST_F(NoisyWorld, AveragesRelationsOverTime) {
    double squares[2] = {}; // by the number of frames in which both were seen
    for (int run = 0; run < 100; ++run)
        for (const bool is_long : {false, true}) {
            world = {};
            std::uint64_t frame = 0;
            for (; frame < (is_long ? 20 : 1); ++frame)
                locate({noisy("desk", desk, 1, 0.01), noisy("lid", lid, 1, 0.01)}, frame);
            const auto found = locate({{"lid", lid}}, frame); // without noise
            squares[is_long] += std::pow(glm::distance(glm::dvec3((*found)[3]), glm::dvec3(desk[3])), 2);
        }
    EXPECT_LT(squares[1], squares[0] / 8);
}

TEST_F(NoisyWorld, TheOrderOfTheTargetsDoesNotMatter) {
    World other;
    for (std::uint64_t frame = 0; frame < 40; ++frame) {
        std::vector<Visible> visible = {bad(), good(), noisy("box", moved(90, 40, -600, 50), 2, 0.01)};
        if (frame < 20)
            visible.push_back(noisy("desk", desk, 0.3, 0.001));
        const auto a = world.locate("desk", targets(visible), frame, 60);
        std::ranges::reverse(visible);
        EXPECT_EQ(a, other.locate("desk", targets(visible), frame, 60));
    }
}

TEST_F(WorldTest, LeavesOutAmbiguousTargets) {
    const glm::dmat4 flipped = moved(-80, 5, -450, -70);
    const auto cup_at = [](const glm::dmat4 &mt, double ambiguity) {
        return Visible{"cup", mt, ARHOST_TARGET_DETECTED, 0, 0, ambiguity};
    };
    locate({cup_at(cup, 0), {"desk", desk}, {"lid", lid}}, 0);
    locate({cup_at(flipped, 0.9), {"desk", desk}, {"lid", lid}}, 1);
    expect_near(locate({cup_at(flipped, 0.9), {"lid", lid}}, 2), desk);
    locate({{"desk", desk}}, 3);
    expect_near(locate({cup_at(cup, 0)}, 4), desk);   // the flipped relation was not learned
    expect_near(locate({cup_at(cup, 0.9)}, 5), desk); // there is no other
}

TEST_F(WorldTest, LearnsFromAmbiguousTargetsUntilTheyAreClear) {
    const glm::dmat4 flipped = moved(-80, 5, -450, -70);
    locate({{"desk", desk}, {"cup", flipped, ARHOST_TARGET_DETECTED, 0, 0, 0.9}}, 0);
    expect_near(locate({{"cup", flipped, ARHOST_TARGET_DETECTED, 0, 0, 0.9}}, 1), desk);
    locate({{"desk", desk}, {"cup", cup}}, 2);
    expect_near(locate({{"cup", cup}}, 3), desk);
}

TEST_F(WorldTest, FollowsATargetThatWasMovedWhileBothWereVisible) {
    locate({{"desk", desk}, {"cup", cup}}, 0);
    const glm::dmat4 pushed = moved(100, 0, -450);
    locate({{"desk", desk}, {"cup", pushed}}, 1);
    expect_near(locate({{"cup", pushed}}, 2), desk);
}

TEST_F(WorldTest, StaysFiniteWhateverCovarianceATrackerTells) {
    std::vector<arhost_target> all = targets({{"desk", desk}, {"cup", cup}});
    for (const double value : {-1.0, 1e300, 1e-300}) {
        world = {};
        std::ranges::fill(all[1].covariance, value);
        world.locate("desk", all, 0, grace_frames);
        const auto found = world.locate("desk", std::span(all).subspan(1), 1, grace_frames);
        ASSERT_TRUE(found);
        expect_near(glm::make_mat4(found->data()), desk);
    }
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
