// SPDX-License-Identifier: Apache-2.0
#include <fiducial/artoolkit.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>

namespace {

using namespace arhost::fiducial;

std::vector<bool> turned_clockwise(const std::vector<bool> &cells, int side) {
    std::vector<bool> turned;
    for (int row = 0; row < side; ++row)
        for (int column = 0; column < side; ++column)
            turned.push_back(cells[static_cast<std::size_t>((side - 1 - column) * side + row)]);
    return turned;
}

// Read from prints that ARToolKit and its users publish.
TEST(MatrixCodes, AreThoseOfArToolKit) {
    struct {
        const char *family;
        std::uint32_t id, word;
    } const prints[] = {
        {"artoolkit-3x3", 37, 37},          {"artoolkit-3x3-parity65", 1, 33}, {"artoolkit-3x3-parity65", 3, 3},
        {"artoolkit-3x3-parity65", 30, 30}, {"artoolkit-3x3-hamming63", 1, 7}, {"artoolkit-3x3-hamming63", 6, 51},
        {"artoolkit-3x3-hamming63", 7, 52},
    };
    for (const auto &[family, id, word] : prints)
        EXPECT_EQ(find_matrix_family(family)->word(id), word) << family << " " << id;
    // The cells of the 3 × 3 marker 37, whose word is 100101.
    EXPECT_EQ(matrix_cells(*find_matrix_family("artoolkit-3x3"), 37),
              (std::vector<bool>{true, true, false, false, true, false, true, true, false}));
    EXPECT_EQ(find_matrix_family("artoolkit-6x6"), nullptr);
    EXPECT_EQ(matrix_id(*find_matrix_family("artoolkit-3x3-parity65"), 32), std::nullopt);
}

TEST(MatrixCodes, CanBeReadAndCorrected) {
    for (const MatrixFamily &family : matrix_families()) {
        SCOPED_TRACE(family.name);
        const int bits = family.side * family.side - 3;
        // The codes are linear: the smallest distance is the smallest number of ones of a word other than 0.
        int distance = bits;
        for (int id = 0; id < family.id_count; ++id) {
            const std::uint32_t word = family.word(static_cast<std::uint32_t>(id));
            ASSERT_LT(word, 1U << bits) << id;
            ASSERT_EQ(matrix_id(family, word), id);
            if (id > 0)
                distance = std::min(distance, std::popcount(word));
            if (id % std::max(1, family.id_count / 500) != 0)
                continue;
            std::vector<bool> cells = matrix_cells(family, id);
            ASSERT_EQ(matrix_word(cells, family.side), word) << id;
            for (int turns = 1; turns < 4; ++turns) {
                cells = turned_clockwise(cells, family.side);
                ASSERT_FALSE(matrix_word(cells, family.side)) << id << ", " << turns << " quarter turns";
            }
        }
        EXPECT_GE(distance, 2 * family.corrects + 1);
    }
}

TEST(MatrixCodes, AreReadInRandomCellsByChance) {
    EXPECT_DOUBLE_EQ(matrix_false_positive_rate(3, 0), 4.0 / 512);
    EXPECT_DOUBLE_EQ(matrix_false_positive_rate(3, 1), 4 * (1 + 6) / 512.0) << "three corners are never wrong";
    EXPECT_DOUBLE_EQ(matrix_false_positive_rate(5, 3), 4 * (1 + 22 + 231 + 1540) / 33554432.0);
}

} // namespace
