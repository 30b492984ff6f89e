// SPDX-License-Identifier: Apache-2.0
//
// Converts a detector's output to arhost_tracker_result, for all fiducial trackers.
#pragma once

#include "planar_pose.hpp"

#include <span>
#include <string>
#include <vector>

namespace arhost::fiducial {

struct Detection {
    std::size_t listed; // index into the setup's markers
    Corners corners_px;
    double quality = 0; // of two detections of one marker the higher one is kept
};

class MarkerReport {
public:
    // Throws Failure(ARHOST_STATUS_ERROR_CONFIGURATION) if a listed id is not in 0 … id_count − 1. `family` is
    // written to every record.
    MarkerReport(const arhost_tracker_setup &setup, const std::string &family, std::size_t id_count);

    const std::vector<int> &ids() const { return ids_; } // in the setup's order
    const Lens &lens() const { return lens_; }

    // Writes one record for each listed marker that was detected and has a pose, in the setup's order. Of several
    // detections of one marker it keeps the one with the highest quality, then with the lowest reprojection error.
    void write(std::span<const Detection> detections, arhost_tracker_result &result) const;

private:
    Lens lens_;
    std::string family_;
    std::vector<int> ids_;
    std::vector<double> sides_mm_;
};

} // namespace arhost::fiducial
