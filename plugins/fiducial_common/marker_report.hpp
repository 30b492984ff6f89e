// SPDX-License-Identifier: Apache-2.0
//
// From a detector's findings to arhost_tracker_result: what all fiducial trackers do alike.
#pragma once

#include "planar_pose.hpp"

#include <span>
#include <string>
#include <vector>

namespace arhost::planar {

// A marker that a detector has found.
struct Sighting {
    std::size_t listed; // index into the setup's list
    Corners corners_px;
    double quality = 0; // where a marker is seen twice the higher one is kept
};

class MarkerReport {
public:
    // Throws Failure(ARHOST_STATUS_ERROR_CONFIGURATION) where a listed id is not one of 0 … id_count − 1.
    // `family` is what the records bear.
    MarkerReport(const arhost_tracker_setup &setup, const std::string &family, std::size_t id_count);

    const std::vector<int> &ids() const { return ids_; } // in the setup's order
    const Lens &lens() const { return lens_; }

    // A record for each listed marker that was seen and has a pose, in the setup's order. Of two sightings
    // of one marker the one with the higher quality counts, then that with the lower reprojection error.
    void write(std::span<const Sighting> sightings, arhost_tracker_result &result) const;

private:
    Lens lens_;
    std::string family_;
    std::vector<int> ids_;
    std::vector<double> sides_mm_;
};

} // namespace arhost::planar
