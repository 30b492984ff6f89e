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
// upright marker.
using Corners = std::array<cv::Point2d, 4>;

struct MeasuredCorners {
    Corners corners_px;
    double sigma_px = 0;      // standard deviation of each coordinate, RMS over the corners; 0: unknown
    double blur_cells = 0;    // standard deviation of the blur at the most blurred edge, in cells; 0: unknown
    bool is_doubtful = false; // imprecise for another reason than noise, for example because an object hides an edge
};

// The cells of a printed marker, called "print" below, from the top left: 1 is white, 0 is black. It includes
// `margin` known cells around the square.
struct Print {
    cv::Mat_<float> cells;
    int margin = 0;

    int side() const { return cells.rows - 2 * margin; } // side of the square in cells
};

// Returns arhost_observation.false_positive_rate of a code with `bits` bits that is read in any of four orientations:
// 4 · Σ C(bits, k) / 2^bits, summed over k = 0 to `hamming`.
double false_positive_rate(int bits, std::uint32_t hamming);

// The result of decoding a marker. The members have the same meaning as in arhost_observation.
struct Decoding {
    std::uint32_t hamming = 0;
    double decision_margin = 0, false_positive_rate = 0;
};

arhost_observation observation_of(std::int32_t id, std::uint32_t family, const MeasuredCorners &corners,
                                  const Decoding &decoding);

// Replaces the corners of an observation.
void set_corners(arhost_observation &seen, const MeasuredCorners &corners);

// Returns the grey plane of a frame, without copying it.
cv::Mat grey_of(const arhost_frame &frame);

// Divides a square into `side` × `side` equal parts and returns a sample at the centre of each part. `corners_px` are
// the corners of a larger square, which extends beyond the sampled square by `margin` samples on each side.
cv::Mat_<std::uint8_t> unwarped(const cv::Mat &grey, const Corners &corners_px, int side, double margin = 0);

// Returns AprilTag's name of a family: "tag36h11" for "DICT_APRILTAG_36h11". Returns other names unchanged.
std::string april_tag_name(std::string_view name);

// A family in use. If a setup lists it under several names, there is still only one Family.
struct Family {
    std::string name;                    // the name that april_tag_name() returns
    std::uint32_t index;                 // index of the family's first name in arhost_tracker_setup.families
    int id_count;                        // its ids are 0 … id_count − 1
    std::map<int, std::uint32_t> listed; // listed ids and the names they are listed under, as indices in
                                         // arhost_tracker_setup.families

    bool lists(int id) const { return listed.contains(id); }
    bool lists(int id, std::uint32_t name) const { // whether the setup lists `id` under this name
        const auto found = listed.find(id);
        return found != listed.end() && found->second == name;
    }
    arhost_observation observation(int id, const MeasuredCorners &corners, const Decoding &decoding = {}) const;
};

// Throws Failure(ARHOST_STATUS_ERROR_CONFIGURATION), which names the right tracker, if `family` is the family of
// patterns or of pictures. `tracker`: the tracker that does not support these families.
void reject_prints_without_ids(std::string_view family, std::string_view tracker);

// Returns the families of the setup. `id_count` returns the number of markers of a family, and throws if it is
// unknown. Throws Failure(ARHOST_STATUS_ERROR_CONFIGURATION) if a listed id is not in its family or is listed twice.
std::vector<Family> families_of(const arhost_tracker_setup &setup,
                                const std::function<int(const std::string &name)> &id_count);

// Returns whether two observations are of the same marker and overlap.
bool are_of_one_print(const arhost_observation &a, const arhost_observation &b);

// Reports the observations, sorted by family, id and place, so that the order does not depend on the detector's
// threads. Omits observations whose corners do not form a convex quadrilateral seen from the front. If several
// observations are of one printed marker, reports only one. Prefers the fewest wrong bits, then refined corners (a
// detector may also find the inside of the border), then the highest decision margin.
void report(std::vector<arhost_observation> seen, Observations &observations);

} // namespace arhost::fiducial
