// SPDX-License-Identifier: Apache-2.0
#include "observations.hpp"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

namespace arhost::fiducial {
namespace {

cv::Point2d corner(const arhost_observation &seen, int i) {
    return {seen.corners_px[i % 4][0], seen.corners_px[i % 4][1]};
}

// Returns whether the corners are clockwise in the image (y down), as they are for the front face of a marker, and no
// angle is near 0° or 180°. Returns false for NaN.
bool is_convex_front(const arhost_observation &seen) {
    constexpr double min_sine = 1e-3;
    for (int i = 0; i < 4; ++i) {
        const cv::Point2d a = corner(seen, i + 1) - corner(seen, i), b = corner(seen, i + 2) - corner(seen, i + 1);
        if (!(a.cross(b) > min_sine * cv::norm(a) * cv::norm(b)))
            return false;
    }
    return true;
}

bool contains(const arhost_observation &seen, cv::Point2d pixel) {
    for (int i = 0; i < 4; ++i)
        if ((corner(seen, i + 1) - corner(seen, i)).cross(pixel - corner(seen, i)) < 0)
            return false;
    return true;
}

std::array<double, 8> place(const arhost_observation &seen) {
    std::array<double, 8> numbers;
    std::copy_n(&seen.corners_px[0][0], numbers.size(), numbers.begin());
    return numbers;
}

} // namespace

cv::Mat grey_of(const arhost_frame &frame) {
    return {static_cast<int>(frame.format->height), static_cast<int>(frame.format->width), CV_8UC1,
            const_cast<std::uint8_t *>(frame.grey), frame.format->grey_stride};
}

cv::Mat_<std::uint8_t> unwarped(const cv::Mat &grey, const Corners &corners_px, int side, double margin) {
    const auto margin_samples = static_cast<float>(margin);
    const float first = -margin_samples - 0.5F, last = static_cast<float>(side) + margin_samples - 0.5F;
    const cv::Point2f square[] = {{first, first}, {last, first}, {last, last}, {first, last}};
    cv::Point2f corners[4];
    std::ranges::copy(corners_px, corners);
    cv::Mat_<std::uint8_t> samples;
    cv::warpPerspective(grey, samples, cv::getPerspectiveTransform(corners, square), {side, side}, cv::INTER_LINEAR,
                        cv::BORDER_REPLICATE);
    return samples;
}

std::string april_tag_name(std::string_view name) {
    for (const char *size : {"16h5", "25h9", "36h10", "36h11"})
        if (name == std::string("DICT_APRILTAG_") + size)
            return std::string("tag") + size;
    return std::string(name);
}

double false_positive_rate(int bits, std::uint32_t hamming) {
    double matching = 0, combinations = 1; // C(bits, k)
    for (std::uint32_t k = 0; k <= hamming; ++k) {
        matching += combinations;
        combinations = combinations * (bits - static_cast<int>(k)) / (k + 1);
    }
    return std::min(4 * std::ldexp(matching, -bits), 1.0);
}

arhost_observation observation_of(std::int32_t id, std::uint32_t family, const MeasuredCorners &corners,
                                  const Decoding &decoding) {
    arhost_observation seen{};
    seen.id = id;
    seen.family = family;
    seen.hamming = decoding.hamming;
    seen.decision_margin = decoding.decision_margin;
    seen.false_positive_rate = decoding.false_positive_rate;
    set_corners(seen, corners);
    return seen;
}

void set_corners(arhost_observation &seen, const MeasuredCorners &corners) {
    seen.corner_sigma_px = corners.sigma_px;
    for (int i = 0; i < 4; ++i) {
        seen.corners_px[i][0] = corners.corners_px[i].x;
        seen.corners_px[i][1] = corners.corners_px[i].y;
    }
}

arhost_observation Family::observation(int id, const MeasuredCorners &corners, const Decoding &decoding) const {
    const auto found = listed.find(id);
    return observation_of(id, found == listed.end() ? index : found->second, corners, decoding);
}

void reject_prints_without_ids(std::string_view family, std::string_view tracker) {
    for (const auto &[known, finder] :
         {std::pair<std::string_view, std::string_view>("pattern", "tracker_pattern"), {"image", "tracker_image"}})
        if (family == known)
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, std::string(tracker) + " finds no targets with '" +
                                                                 std::string(known) + "'; use the plugin " +
                                                                 std::string(finder));
}

std::vector<Family> families_of(const arhost_tracker_setup &setup,
                                const std::function<int(const std::string &)> &id_count) {
    std::vector<Family> families;
    std::vector<std::size_t> positions; // index in `families` of each name
    for (std::uint32_t i = 0; i < setup.family_count; ++i) {
        const std::string name = april_tag_name(setup.families[i]);
        const auto known = std::ranges::find(families, name, &Family::name);
        positions.push_back(static_cast<std::size_t>(known - families.begin()));
        if (known == families.end())
            families.push_back({name, i, id_count(name), {}});
    }
    for (const arhost_marker_config &marker : elements(setup.markers, setup.marker_count)) {
        Family &family = families.at(positions.at(marker.family));
        const auto reject = [&](const std::string &reason) {
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                          std::string("target '") + elements(setup.targets, setup.target_count)[marker.target].name +
                              "': marker id " + std::to_string(marker.id) + reason);
        };
        if (marker.id < 0 || marker.id >= family.id_count)
            reject(std::string(" is not in ") + setup.families[marker.family] + ", whose ids are 0 to " +
                   std::to_string(family.id_count - 1));
        if (const auto [twin, is_new] = family.listed.try_emplace(marker.id, marker.family); !is_new)
            reject(std::string(" of ") + setup.families[marker.family] + " is also listed as a marker of " +
                   setup.families[twin->second] + "; both are names of the same family");
    }
    return families;
}

bool are_of_one_print(const arhost_observation &a, const arhost_observation &b) {
    const auto centre = [](const arhost_observation &seen) {
        return (corner(seen, 0) + corner(seen, 1) + corner(seen, 2) + corner(seen, 3)) / 4;
    };
    return a.family == b.family && a.id == b.id && (contains(a, centre(b)) || contains(b, centre(a)));
}

void report(std::vector<arhost_observation> seen, Observations &observations) {
    std::erase_if(seen, [](const arhost_observation &one) { return !is_convex_front(one); });
    std::ranges::sort(seen, {}, [](const arhost_observation &one) {
        return std::tuple(one.hamming, one.corner_sigma_px == 0, -one.decision_margin, one.family, one.id,
                          place(one));
    });
    std::vector<arhost_observation> kept;
    for (const arhost_observation &one : seen)
        if (std::ranges::none_of(kept, [&](const auto &better) { return are_of_one_print(better, one); }))
            kept.push_back(one);
    std::ranges::sort(kept, {},
                      [](const arhost_observation &one) { return std::tuple(one.family, one.id, place(one)); });
    for (const arhost_observation &one : kept)
        observations.add(one);
}

} // namespace arhost::fiducial
