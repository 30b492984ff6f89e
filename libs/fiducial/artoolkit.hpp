// SPDX-License-Identifier: Apache-2.0
//
// The markers of ARToolKit: a picture (a pattern) or a matrix code inside a black border. The border is half as wide
// as a matrix code.
#pragma once

#include <opencv2/core.hpp>

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace arhost::fiducial {

inline constexpr double matrix_ratio = 0.5; // side of the matrix code divided by the side of the black square

struct MatrixFamily {
    const char *name; // "artoolkit-3x3-parity65" for ARToolKit's AR_MATRIX_CODE_3x3_PARITY65
    int side;         // cells
    int id_count;     // ids are 0 to id_count − 1
    int corrects;     // number of wrong cells that the code can correct
    std::uint32_t (*word)(std::uint32_t id);
};

// Returns the id that a word encodes, or nullopt if no id of the family has this word.
std::optional<std::int32_t> matrix_id(const MatrixFamily &family, std::uint32_t word);

std::span<const MatrixFamily> matrix_families();
const MatrixFamily *find_matrix_family(std::string_view name); // nullptr if there is none

// Returns whether each cell is black, row by row from the top left of the upright marker. Three corner cells show the
// orientation: both left ones are black, and the bottom right one is white. The other cells are the bits of the word,
// most significant bit first.
std::vector<bool> matrix_cells(const MatrixFamily &family, int id);

// Returns the probability that random cells match one given code (arhost_observation.false_positive_rate) with at
// most `wrong_cells` errors. Errors are allowed only in the cells of the word.
double matrix_false_positive_rate(int side, std::uint32_t wrong_cells);

// Returns the word that the cells contain, or nullopt if the corner cells are not those of an upright marker.
std::optional<std::uint32_t> matrix_word(const std::vector<bool> &cells, int side);

// Reads a pattern file (.patt). Returns the luma of the upright picture, which is square. The file contains the
// picture in four orientations. Each orientation has a blue, a green and a red plane, stored as rows of numbers from
// 0 to 255. Throws Failure(ARHOST_STATUS_ERROR_CONFIGURATION), which names the position of the error.
cv::Mat_<float> read_pattern(const std::string &file);

} // namespace arhost::fiducial
