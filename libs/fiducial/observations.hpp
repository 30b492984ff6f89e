// SPDX-License-Identifier: Apache-2.0
//
// The parts of arhost_tracker_setup and arhost_observation that the fiducial trackers have in common.
#pragma once

#include <arhost-cpp/plugin.hpp>

#include <opencv2/core.hpp>

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace arhost::fiducial {

// Corners in px (pixel centres at integers), in the order top-left, top-right, bottom-right, bottom-left of the
// upright print.
using Corners = std::array<cv::Point2d, 4>;

struct MeasuredCorners {
    Corners corners_px;
    double sigma_px = 0;      // standard deviation of each coordinate, RMS over the corners; 0: unknown
    double blur_cells = 0;    // standard deviation of the blur at the most blurred edge, in cells; 0: unknown
    bool is_doubtful = false; // they are imprecise, but not because of noise: something may hide an edge
};

// The cells of a print from the top left: 1 is white, 0 is black. `margin` cells around the square are known.
struct Print {
    cv::Mat_<float> cells;
    int margin = 0;

    int side() const { return cells.rows - 2 * margin; } // of the square
};

// arhost_observation.false_positive_rate of a code with so many bits, in any of four orientations:
// 4 · Σ C(bits, k) / 2^bits, summed over k = 0 to `hamming`.
double false_positive_rate(int bits, std::uint32_t hamming);

// How well a marker was read. The members have the same meaning as in arhost_observation.
struct Decoding {
    std::uint32_t hamming = 0;
    double decision_margin = 0, false_positive_rate = 0;
};

arhost_observation observation_of(std::int32_t id, std::uint32_t family, const MeasuredCorners &corners,
                                  const Decoding &decoding);

// Returns the grey plane of a frame, without copying it.
cv::Mat grey_of(const arhost_frame &frame);

// Returns `side`² samples of a square, at the centres of equal parts. The square of the corners is larger: it reaches
// `margin` samples further to each side.
cv::Mat_<std::uint8_t> unwarped(const cv::Mat &grey, const Corners &corners_px, int side, double margin = 0);

// AprilTag's name of a family: "tag36h11" for "DICT_APRILTAG_36h11". Other names remain as they are.
std::string april_tag_name(std::string_view name);

// A family in use. If a setup lists it under several names, there is still only one Family.
struct Family {
    std::string name;                    // as april_tag_name() returns it
    std::uint32_t index;                 // of its first name in arhost_tracker_setup.families
    int id_count;                        // its ids are 0 … id_count − 1
    std::map<int, std::uint32_t> listed; // listed ids and the names they are listed under, as indices in
                                         // arhost_tracker_setup.families

    bool lists(int id) const { return listed.contains(id); }
    bool lists(int id, std::uint32_t name) const { // under this name
        const auto found = listed.find(id);
        return found != listed.end() && found->second == name;
    }
    arhost_observation observation(int id, const MeasuredCorners &corners, const Decoding &decoding = {}) const;
};

// Throws Failure(ARHOST_STATUS_ERROR_CONFIGURATION), which names the tracker to use, if the family is that of
// patterns or of pictures. `tracker`: the one that has no such family.
void reject_prints_without_ids(std::string_view family, std::string_view tracker);

// Returns the families of the setup. `id_count` returns the number of markers of a family, and throws if it is
// unknown. Throws Failure(ARHOST_STATUS_ERROR_CONFIGURATION) if a listed id is not in its family or is listed twice.
std::vector<Family> families_of(const arhost_tracker_setup &setup,
                                const std::function<int(const std::string &name)> &id_count);

// Returns whether two observations are of the same marker and overlap.
bool are_of_one_print(const arhost_observation &a, const arhost_observation &b);

// Reports what was seen, by family, id and place, so the order does not depend on the detector's threads. Leaves out
// corners that are not those of a convex quadrilateral seen from the front. Of detections that are of one print,
// reports only the one with the fewest wrong bits, then one with refined corners (a detector may also find the inside
// of the border), then the one with the highest decision margin.
void report(std::vector<arhost_observation> seen, Observations &observations);

} // namespace arhost::fiducial
