// SPDX-License-Identifier: Apache-2.0
#include "marker_report.hpp"

#include <arhost-cpp/plugin.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <tuple>

namespace arhost::fiducial {
namespace {

struct Located {
    Detection detection;
    PlanarPose pose;
};

// A total order, so the result depends neither on the order of the detections nor on the detector's threads.
bool is_better(const Located &a, const Located &b) {
    const auto key = [](const Located &l) {
        const cv::Point2d &corner = l.detection.corners_px[0];
        return std::tuple(-l.detection.quality, l.pose.best.reprojection_px, corner.x, corner.y);
    };
    return key(a) < key(b);
}

// Errors of a measurement are smaller; a larger one means that no square has these corners, because something hides
// one.
double max_reprojection_px(const Corners &corners_px) {
    double shortest_px = std::numeric_limits<double>::infinity();
    for (int i = 0; i < 4; ++i)
        shortest_px = std::min(shortest_px, cv::norm(corners_px[(i + 1) % 4] - corners_px[i]));
    return std::max(2.0, 0.05 * shortest_px);
}

arhost_marker record(const Located &located, int id, const std::string &family) {
    arhost_marker marker{};
    marker.struct_size = sizeof marker;
    marker.id = id;
    family.copy(marker.family, ARHOST_MAX_FAMILY - 1);
    marker.state = ARHOST_MARKER_DETECTED;
    for (int i = 0; i < 4; ++i) {
        marker.corners_px[i][0] = located.detection.corners_px[i].x;
        marker.corners_px[i][1] = located.detection.corners_px[i].y;
    }
    std::ranges::copy(located.pose.best.mt, marker.mt);
    if (located.pose.alternative)
        std::ranges::copy(located.pose.alternative->mt, marker.mt_alternative);
    marker.reprojection_px = located.pose.best.reprojection_px;
    marker.ambiguity = located.pose.ambiguity;
    return marker;
}

} // namespace

MarkerReport::MarkerReport(const arhost_tracker_setup &setup, const std::string &family, std::size_t id_count)
    : lens_(*setup.intrinsics), family_(family) {
    if (setup.marker_count < 1 || setup.marker_count > ARHOST_MAX_MARKERS)
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, std::to_string(setup.marker_count) +
                                                             " markers are listed under 'markers'; list 1 to " +
                                                             std::to_string(ARHOST_MAX_MARKERS));
    for (std::uint32_t i = 0; i < setup.marker_count; ++i) {
        const arhost_marker_config &marker = listed_marker(setup, i);
        const std::string name = "marker id " + std::to_string(marker.id);
        if (marker.id < 0 || static_cast<std::size_t>(marker.id) >= id_count)
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          name + " is not in " + family + ", whose ids are 0 to " + std::to_string(id_count - 1));
        if (std::ranges::find(ids_, marker.id) != ids_.end())
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, name + " is listed twice");
        if (!(marker.side_mm > 0) || !std::isfinite(marker.side_mm))
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, name + ": side_mm is invalid; set the side of the black "
                                                                    "square in millimetres");
        ids_.push_back(marker.id);
        sides_mm_.push_back(marker.side_mm);
    }
}

void MarkerReport::write(std::span<const Detection> detections, arhost_tracker_result &result) const {
    std::vector<std::optional<Located>> best(ids_.size());
    for (const Detection &detection : detections) {
        const auto pose = planar_pose(detection.corners_px, lens_, sides_mm_.at(detection.listed));
        if (!pose || pose->best.reprojection_px > max_reprojection_px(detection.corners_px))
            continue;
        std::optional<Located> &kept = best[detection.listed];
        const Located found{detection, *pose};
        if (!kept || is_better(found, *kept))
            kept = found;
    }
    result.marker_count = 0;
    for (std::size_t i = 0; i < best.size(); ++i)
        if (best[i])
            result.markers[result.marker_count++] = record(*best[i], ids_[i], family_);
}

} // namespace arhost::fiducial
