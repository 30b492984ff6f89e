// SPDX-License-Identifier: Apache-2.0
//
// ARToolKit's patterns: small pictures inside the black border of a square.
#pragma once

#include <opencv2/core.hpp>

#include <array>
#include <string>

namespace tracker_pattern {

// The samples of a square's interior: side × side mean grey levels, top row first.
using Samples = cv::Mat_<float>;

class Pattern {
public:
    // Reads a .patt file. Throws Failure(ARHOST_STATUS_ERROR_CONFIGURATION), which names the position of the error.
    explicit Pattern(const std::string &file);

    int side() const { return rotated_[0].rows; } // samples

    // Returns the correlation of samples of this size with the picture, −1 to 1, and the clockwise rotation of the
    // marker in the image, in quarter turns. `normalized`: a result of `normalized()`.
    struct Match {
        double correlation;
        int quarter_turns;
    };
    Match match(const Samples &normalized) const;

private:
    std::array<Samples, 4> rotated_; // normalized; rotated clockwise by 0 to 3 quarter turns
};

// Returns samples with the mean 0 and the length 1; empty if they are almost uniform.
Samples normalized(const Samples &samples);

} // namespace tracker_pattern
