// SPDX-License-Identifier: Apache-2.0
//
// Converts the output of a detector to arhost_tracker_result. All fiducial trackers use it.
#pragma once

#include "planar_pose.hpp"

#include <span>
#include <string>
#include <vector>

namespace arhost::fiducial {

struct Detection {
    std::size_t listed; // index in the list of markers in arhost_tracker_setup
    Corners corners_px;
    double quality = 0; // if a marker is detected twice, the detection of higher quality is kept
};

class MarkerReport {
public:
    // Throws Failure(ARHOST_STATUS_ERROR_CONFIGURATION) if a listed id is not in 0 … id_count − 1. Every record gets
    // the family name `family`.
    MarkerReport(const arhost_tracker_setup &setup, const std::string &family, std::size_t id_count);

    const std::vector<int> &ids() const { return ids_; } // in the order of the setup
    const Lens &lens() const { return lens_; }

    // Writes one record for each listed marker that was detected and has a pose, in the order of the setup. Omits
    // detections whose corners are far (2 px and 5 % of the shortest side) from those of any square. If a
    // marker was detected several times, keeps the detection of the highest quality; among equals, the one with the
    // lowest reprojection error.
    void write(std::span<const Detection> detections, arhost_tracker_result &result) const;

private:
    Lens lens_;
    std::string family_;
    std::vector<int> ids_;
    std::vector<double> sides_mm_;
};

} // namespace arhost::fiducial
