// SPDX-License-Identifier: Apache-2.0
//
// The markers of ARToolKit: a picture (a pattern) or a matrix code inside a black border. The border is as wide as
// half of a matrix code.
#pragma once

#include <opencv2/core.hpp>

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace arhost::fiducial {

inline constexpr double matrix_ratio = 0.5; // of the side of all cells to that of the black square

struct MatrixFamily {
    const char *name; // "artoolkit-3x3-parity65" for ARToolKit's AR_MATRIX_CODE_3x3_PARITY65
    int side;         // cells
    int id_count;     // ids are 0 to id_count − 1
    int corrects;     // number of wrong cells from which the code recovers the id
    std::uint32_t (*word)(std::uint32_t id);
};

// Returns the id of a word; nullopt if it is none of the family's.
std::optional<std::int32_t> matrix_id(const MatrixFamily &family, std::uint32_t word);

std::span<const MatrixFamily> matrix_families();
const MatrixFamily *find_matrix_family(std::string_view name); // nullptr if there is none

// Whether each cell is black, in rows from the top left of the upright print. Three corners show which side is up:
// the left ones are black, the bottom right one is white. The other cells are the bits of the word, the highest one
// first.
std::vector<bool> matrix_cells(const MatrixFamily &family, int id);

// The probability that random cells read as a certain code, as arhost_observation.false_positive_rate has it. Only
// cells of the word may be wrong.
double matrix_false_positive_rate(int side, std::uint32_t wrong_cells);

// Returns the word in the cells of a print; nullopt if it is not upright.
std::optional<std::uint32_t> matrix_word(const std::vector<bool> &cells, int side);

// Reads a pattern file (.patt). Returns the luma of the upright picture, as many rows as columns. The file has the
// picture in four orientations, each with the planes blue, green and red, as rows of numbers from 0 to 255. Throws
// Failure(ARHOST_STATUS_ERROR_CONFIGURATION), with the place of the error.
cv::Mat_<float> read_pattern(const std::string &file);

} // namespace arhost::fiducial
