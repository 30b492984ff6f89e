// SPDX-License-Identifier: Apache-2.0
#include "artoolkit.hpp"

#include "observations.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <fstream>

namespace arhost::fiducial {
namespace {

std::uint32_t plain(std::uint32_t id) {
    return id;
}

// Prepends a parity bit, which makes the number of ones even.
std::uint32_t parity65(std::uint32_t id) {
    return id | (static_cast<std::uint32_t>(std::popcount(id)) & 1) << 5;
}

std::uint32_t hamming63(std::uint32_t id) {
    return (id & 1 ? 0b000111U : 0) ^ (id & 2 ? 0b011001U : 0) ^ (id & 4 ? 0b101010U : 0);
}

// Shortened BCH codes: the word is the id, followed by the remainder of the id's division by the generator
// polynomial.
template <std::uint32_t generator> std::uint32_t bch(std::uint32_t id) {
    constexpr int degree = std::bit_width(generator) - 1;
    const std::uint32_t dividend = id << degree;
    std::uint32_t remainder = dividend;
    while (std::bit_width(remainder) > degree)
        remainder ^= generator << (std::bit_width(remainder) - 1 - degree);
    return dividend | remainder;
}

// The generators are products of the minimal polynomials of α, α³ and α⁵, where α⁴ = α + 1 or α⁵ = α² + 1.
constexpr std::array families{
    MatrixFamily{"artoolkit-3x3", 3, 64, 0, plain},
    MatrixFamily{"artoolkit-3x3-parity65", 3, 32, 0, parity65},
    MatrixFamily{"artoolkit-3x3-hamming63", 3, 8, 1, hamming63},
    MatrixFamily{"artoolkit-4x4", 4, 8192, 0, plain},
    MatrixFamily{"artoolkit-4x4-bch-13-9-3", 4, 512, 1, bch<0b10011>},
    MatrixFamily{"artoolkit-4x4-bch-13-5-5", 4, 32, 2, bch<0b111010001>},
    MatrixFamily{"artoolkit-5x5", 5, 1 << 22, 0, plain},
    MatrixFamily{"artoolkit-5x5-bch-22-12-5", 5, 4096, 2, bch<0b11101101001>},
    MatrixFamily{"artoolkit-5x5-bch-22-7-7", 5, 128, 3, bch<0b1000111110101111>},
};

enum class Cell { black, white, bit };
constexpr int fixed_cells = 3; // the three cells in the corners that show the orientation

Cell cell_at(int row, int column, int side) {
    if (column == 0 && (row == 0 || row == side - 1))
        return Cell::black;
    return row == side - 1 && column == side - 1 ? Cell::white : Cell::bit;
}

constexpr int orientations = 4, planes = 3;
constexpr int min_side = 4, max_side = 64;
constexpr std::size_t max_file_size = std::size_t{1} << 20;

[[noreturn]] void reject(const std::string &file, const std::string &reason) {
    throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "'" + file + "' " + reason);
}

std::vector<int> numbers_in(const std::string &file) {
    std::ifstream stream(file, std::ios::binary);
    if (!stream)
        reject(file, "cannot be read");
    std::string text(max_file_size + 1, '\0');
    stream.read(text.data(), static_cast<std::streamsize>(text.size()));
    text.resize(static_cast<std::size_t>(stream.gcount()));
    if (text.size() > max_file_size)
        reject(file, "is too large for a pattern of ARToolKit");
    std::vector<int> numbers;
    int line = 1;
    for (const char *at = text.data(), *end = at + text.size(); at != end;) {
        if (*at == ' ' || *at == '\t' || *at == '\r' || *at == '\n') {
            line += *at == '\n';
            ++at;
            continue;
        }
        int number = 0;
        const auto [after, error] = std::from_chars(at, end, number);
        if (error != std::errc() || number < 0 || number > 255)
            reject(file,
                   "is not a pattern of ARToolKit: line " + std::to_string(line) +
                       " has something other than numbers from 0 to 255; name a file that ARToolKit's mk_patt wrote");
        numbers.push_back(number);
        at = after;
    }
    return numbers;
}

} // namespace

std::optional<std::int32_t> matrix_id(const MatrixFamily &family, std::uint32_t word) {
    const auto is_of = [&](std::uint32_t id) { return family.word(id) == word; };
    const auto count = static_cast<std::uint32_t>(family.id_count);
    // Handles all words of families without check bits, which may have millions of words.
    if (word < count && is_of(word))
        return static_cast<std::int32_t>(word);
    for (std::uint32_t id = 0; id < count; ++id)
        if (is_of(id))
            return static_cast<std::int32_t>(id);
    return std::nullopt;
}

std::span<const MatrixFamily> matrix_families() {
    return families;
}

const MatrixFamily *find_matrix_family(std::string_view name) {
    const auto found = std::ranges::find(families, name, &MatrixFamily::name);
    return found == families.end() ? nullptr : &*found;
}

std::vector<bool> matrix_cells(const MatrixFamily &family, int id) {
    const std::uint32_t word = family.word(static_cast<std::uint32_t>(id));
    int bits = family.side * family.side - fixed_cells;
    std::vector<bool> black;
    for (int row = 0; row < family.side; ++row)
        for (int column = 0; column < family.side; ++column) {
            const Cell cell = cell_at(row, column, family.side);
            black.push_back(cell == Cell::bit ? (word >> --bits & 1) != 0 : cell == Cell::black);
        }
    return black;
}

double matrix_false_positive_rate(int side, std::uint32_t wrong_cells) {
    return std::ldexp(false_positive_rate(side * side - fixed_cells, wrong_cells), -fixed_cells);
}

std::optional<std::uint32_t> matrix_word(const std::vector<bool> &cells, int side) {
    std::uint32_t word = 0;
    for (int row = 0; row < side; ++row)
        for (int column = 0; column < side; ++column) {
            const int index = row * side + column;
            const bool black = cells[static_cast<std::size_t>(index)];
            if (const Cell cell = cell_at(row, column, side); cell == Cell::bit)
                word = word << 1 | black;
            else if (black != (cell == Cell::black))
                return std::nullopt;
        }
    return word;
}

cv::Mat_<float> read_pattern(const std::string &file) {
    const std::vector<int> numbers = numbers_in(file);
    const int side =
        static_cast<int>(std::lround(std::sqrt(static_cast<double>(numbers.size()) / (orientations * planes))));
    if (side < min_side || side > max_side ||
        numbers.size() !=
            std::size_t{orientations * planes} * static_cast<std::size_t>(side) * static_cast<std::size_t>(side))
        reject(file,
               "is not a pattern of ARToolKit: it has " + std::to_string(numbers.size()) +
                   " numbers; a pattern of 16 x 16 has 3072: four orientations of three colours; if the file is cut "
                   "short, copy it again");
    // The file has the upright picture first. The other three orientations are rotated copies of it.
    cv::Mat_<float> upright(side, side, 0.0F);
    constexpr float weights[planes] = {0.114F, 0.587F, 0.299F}; // luma of BT.601, as in frames
    const int size = side * side;
    for (int plane = 0; plane < planes; ++plane)
        for (int i = 0; i < size; ++i)
            upright(i / side, i % side) += weights[plane] * static_cast<float>(numbers[plane * size + i]);
    return upright;
}

} // namespace arhost::fiducial
