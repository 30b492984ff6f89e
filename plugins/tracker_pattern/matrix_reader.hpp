// SPDX-License-Identifier: Apache-2.0
//
// Reads the matrix codes of ARToolKit in squares.
#pragma once

#include "pattern.hpp"

#include <fiducial/artoolkit.hpp>

#include <cstdint>
#include <optional>
#include <vector>

namespace tracker_pattern {

// Reads all listed codes with the same number of cells, of any family.
class MatrixReader {
public:
    explicit MatrixReader(int cells) : cells_(cells) {} // in a row

    // `family`: its index in the setup. Throws Failure(ARHOST_STATUS_ERROR_CONFIGURATION) if the code looks like a
    // listed one of another family.
    void add(const arhost::fiducial::MatrixFamily &type, std::int32_t id, std::uint32_t family);

    int cells() const { return cells_; }
    // The samples contain the cells and as much of the border as another cell on each side. `ratio`: of their side to
    // that of the square.
    double ratio() const { return arhost::fiducial::matrix_ratio * (cells_ + 2) / cells_; }
    int side() const { return (cells_ + 2) * samples_per_cell; }

    struct Match {
        std::int32_t id;
        std::uint32_t family;
        int wrong_cells;
        double correlation; // of the samples with the code's picture
        int quarter_turns;  // clockwise, as seen, by which the print is rotated
    };
    std::optional<Match> match(const Samples &samples) const;

    // Returns the codes that the samples show without a wrong cell, one of each family that has it, listed or not.
    struct AnyCode {
        const arhost::fiducial::MatrixFamily *type;
        std::int32_t id;
        double correlation;
    };
    std::vector<AnyCode> codes(const Samples &samples) const;

private:
    static constexpr int samples_per_cell = 3; // odd, so one is at the centre

    struct Code {
        const arhost::fiducial::MatrixFamily *type;
        std::int32_t id;
        std::uint32_t family, word;
        Samples picture; // upright; normalized
    };
    struct Reading {
        std::uint32_t word;
        int quarter_turns;
        Samples upright; // normalized
    };
    std::optional<Reading> read(const Samples &samples) const;
    std::optional<std::vector<bool>> black_cells(const Samples &samples) const;
    Samples picture_of(const arhost::fiducial::MatrixFamily &type, std::int32_t id) const;

    int cells_;
    std::vector<Code> codes_;
};

} // namespace tracker_pattern
