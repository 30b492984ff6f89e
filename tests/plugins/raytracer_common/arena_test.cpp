// SPDX-License-Identifier: Apache-2.0
#include "raytracer_common/arena.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace arhost::raytracer_common {
namespace {

// By columns: a turn about z with other scales along the axes, which are mirrored where `mirror` is −1; then a move.
struct Transform {
    float numbers[12];
    explicit Transform(float mirror) : numbers{0, 2 * mirror, 0, -3, 0, 0, 0, 0, 0.5f, 10, 20, 30} {}
};

TEST(Arena, TellsAnIdentity) {
    float m[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
    EXPECT_TRUE(is_identity(m));
    m[10] = 1e-6f;
    EXPECT_FALSE(is_identity(m));
}

TEST(Arena, AnObjectReachesAsFarAsItsCornerThatIsFarthestOff) {
    const double low[3] = {-1, -10, 50}, high[3] = {0.5, 10, 100};
    const float still[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, m[12] = {0, 3, 0, 0, 0, 1, 3, 0, -4, 10, -20, 3};
    float reach[3];
    object_extent(low, high, still, reach);
    EXPECT_THAT(reach, testing::ElementsAre(1, 10, 100));
    object_extent(low, high, m, reach);
    EXPECT_THAT(reach, testing::ElementsAre(300, 3, 10 + 400)) << "turned and scaled; moved does not count";
}

TEST(Arena, CofactorsByTheDeterminantAreTheInverse) {
    const Transform transform(-1);
    const Cofactors cofactors(transform.numbers);
    EXPECT_DOUBLE_EQ(cofactors.determinant, -3);
    for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 3; ++column) {
            double sum = 0;
            for (int i = 0; i < 3; ++i)
                sum += cofactors.of[3 * row + i] / cofactors.determinant * transform.numbers[3 * column + i];
            EXPECT_DOUBLE_EQ(sum, row == column) << row << ' ' << column;
        }
}

// A plane's tangents go by the transform, its normal by the normal transform: they stay at a right angle, and the
// outside stays outside though the object is mirrored.
TEST(Arena, NormalsStayNormalAndOutside) {
    for (const float mirror : {1.0f, -1.0f}) {
        const Transform transform(mirror);
        const float *m = transform.numbers;
        float normals[9];
        Cofactors(m).put_normal_transform(normals);
        const auto by = [](const float *matrix, const double(&v)[3], int row) {
            return matrix[row] * v[0] + matrix[3 + row] * v[1] + matrix[6 + row] * v[2];
        };
        const double normal[3] = {1, 2, 3}, tangents[2][3] = {{2, -1, 0}, {3, 0, -1}};
        double outwards = 0, largest = 0;
        for (int row = 0; row < 3; ++row) {
            outwards += by(normals, normal, row) * by(m, normal, row);
            for (int column = 0; column < 3; ++column)
                largest = std::max<double>(largest, std::abs(normals[3 * column + row]));
        }
        for (const auto &tangent : tangents) {
            double across = 0;
            for (int row = 0; row < 3; ++row)
                across += by(normals, normal, row) * by(m, tangent, row);
            EXPECT_NEAR(across, 0, 1e-6);
        }
        EXPECT_GT(outwards, 0);
        EXPECT_FLOAT_EQ(static_cast<float>(largest), 1);
    }
}

} // namespace
} // namespace arhost::raytracer_common
