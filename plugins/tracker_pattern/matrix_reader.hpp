// SPDX-License-Identifier: Apache-2.0
//
// Reads ARToolKit's matrix codes in squares.
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
    explicit MatrixReader(int cells) : cells_(cells) {} // `cells`: cells per row

    // Adds a code. `family`: the index of its family in the setup. Throws Failure(ARHOST_STATUS_ERROR_CONFIGURATION)
    // if the code looks like a listed code of another family.
    void add(const arhost::fiducial::MatrixFamily &type, std::int32_t id, std::uint32_t family);

    int cells() const { return cells_; }
    // Returns the side of the sampled area relative to the side of the square. The sampled area contains the cells,
    // and on each side a part of the border that is as wide as a cell.
    double ratio() const { return arhost::fiducial::matrix_ratio * (cells_ + 2) / cells_; }
    int side() const { return (cells_ + 2) * samples_per_cell; }

    struct Match {
        std::int32_t id;
        std::uint32_t family;
        int wrong_cells;
        double correlation; // correlation of the samples with the code's picture
        int quarter_turns;  // clockwise rotation of the marker in the image
    };
    std::optional<Match> match(const Samples &samples) const;

    // Returns the codes that the samples show without a wrong cell, listed or not: one for each family with such a
    // code.
    struct AnyCode {
        const arhost::fiducial::MatrixFamily *type;
        std::int32_t id;
        double correlation;
    };
    std::vector<AnyCode> codes(const Samples &samples) const;

private:
    static constexpr int samples_per_cell = 3; // odd, so that one sample is at the centre of the cell

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
