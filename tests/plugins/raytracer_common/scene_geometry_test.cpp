// SPDX-License-Identifier: Apache-2.0
#include "raytracer_common/scene_geometry.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace arhost::raytracer_common {
namespace {

// Scales each axis differently, rotates about z and translates. If `mirror` is −1, also mirrors.
struct Transform {
    float numbers[12];
    explicit Transform(float mirror) : numbers{0, 2 * mirror, 0, -3, 0, 0, 0, 0, 0.5f, 10, 20, 30} {}
};

TEST(Arena, RecognizesIdentity) {
    float m[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
    EXPECT_TRUE(is_identity(m));
    m[10] = 1e-6f;
    EXPECT_FALSE(is_identity(m));
}

TEST(Arena, ObjectExtentIsThatOfTheFarthestCorner) {
    const double low[3] = {-1, -10, 50}, high[3] = {0.5, 10, 100};
    const float identity[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, m[12] = {0, 3, 0, 0, 0, 1, 3, 0, -4, 10, -20, 3};
    float extent[3];
    object_extent(low, high, identity, extent);
    EXPECT_THAT(extent, testing::ElementsAre(1, 10, 100));
    object_extent(low, high, m, extent);
    EXPECT_THAT(extent, testing::ElementsAre(300, 3, 10 + 400)) << "rotated and scaled, without the translation";
}

TEST(Arena, CofactorsOverTheDeterminantAreTheInverse) {
    const Transform transform(-1);
    const Cofactors cofactors(transform.numbers);
    EXPECT_DOUBLE_EQ(cofactors.determinant, -3);
    for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 3; ++column) {
            double sum = 0;
            for (int i = 0; i < 3; ++i)
                sum += cofactors.values[3 * row + i] / cofactors.determinant * transform.numbers[3 * column + i];
            EXPECT_DOUBLE_EQ(sum, row == column) << row << ' ' << column;
        }
}

// For a transformed plane, the transformed normal is perpendicular to the transformed tangents and points outwards,
// even if the transform mirrors.
TEST(Arena, NormalsStayPerpendicularAndOutward) {
    for (const float mirror : {1.0f, -1.0f}) {
        const Transform transform(mirror);
        const float *m = transform.numbers;
        float normals[9];
        Cofactors(m).write_normal_transform(normals);
        const auto product = [](const float *matrix, const double(&v)[3], int row) {
            return matrix[row] * v[0] + matrix[3 + row] * v[1] + matrix[6 + row] * v[2];
        };
        const double normal[3] = {1, 2, 3}, tangents[2][3] = {{2, -1, 0}, {3, 0, -1}};
        double outward = 0, largest = 0;
        for (int row = 0; row < 3; ++row) {
            outward += product(normals, normal, row) * product(m, normal, row);
            for (int column = 0; column < 3; ++column)
                largest = std::max<double>(largest, std::abs(normals[3 * column + row]));
        }
        for (const auto &tangent : tangents) {
            double dot = 0;
            for (int row = 0; row < 3; ++row)
                dot += product(normals, normal, row) * product(m, tangent, row);
            EXPECT_NEAR(dot, 0, 1e-6);
        }
        EXPECT_GT(outward, 0);
        EXPECT_FLOAT_EQ(static_cast<float>(largest), 1);
    }
}

} // namespace
} // namespace arhost::raytracer_common
