// SPDX-License-Identifier: Apache-2.0
#include "search_regions.hpp"

#include <algorithm>
#include <cmath>

namespace arhost::fiducial {
namespace {

// Beyond this part of the frame, its regions take about as long to search as the whole frame.
constexpr double max_share = 0.6;

struct Interval {
    int begin, end;
};

// Returns the multiples of the grid around an interval, within 0 … `size`.
Interval on_grid(double first, double last, int size, const RegionLimits &limits) {
    const auto within = [&](double value) { return static_cast<int>(std::clamp<double>(value, 0, size)); };
    const double shortage = std::max(0.0, limits.min_side_px - (last - first));
    Interval interval{within(std::floor((first - shortage / 2) / limits.grid_px) * limits.grid_px),
                      within(std::ceil((last + shortage / 2) / limits.grid_px) * limits.grid_px)};
    if (interval.end - interval.begin < limits.min_side_px) { // cut off by the border of the frame
        if (interval.begin > 0)
            interval.begin = std::max(0, interval.end - limits.min_side_px) / limits.grid_px * limits.grid_px;
        else
            interval.end = std::min(size, limits.min_side_px);
    }
    return interval;
}

cv::Rect whole_of(const arhost_track_request &request) {
    return {0, 0, static_cast<int>(request.frame->format->width), static_cast<int>(request.frame->format->height)};
}

// Returns the region in which the marker is detected if it is where it is expected; empty if that is outside of the
// frame.
cv::Rect region_of(const arhost_expected_marker &expected, double margin, cv::Size frame,
                   const RegionLimits &limits) {
    cv::Point2d first(expected.corners_px[0][0], expected.corners_px[0][1]), last = first;
    double longest_px = 0;
    for (int i = 0; i < 4; ++i) {
        const auto &corner = expected.corners_px[i], &next = expected.corners_px[(i + 1) % 4];
        first = {std::min(first.x, corner[0]), std::min(first.y, corner[1])};
        last = {std::max(last.x, corner[0]), std::max(last.y, corner[1])};
        longest_px = std::max(longest_px, std::hypot(next[0] - corner[0], next[1] - corner[1]));
    }
    const double margin_px = expected.margin_px + margin * longest_px;
    first -= cv::Point2d(margin_px, margin_px);
    last += cv::Point2d(margin_px + 1, margin_px + 1);
    // Also false for NaN.
    if (!(last.x > 0 && last.y > 0 && first.x < frame.width && first.y < frame.height))
        return {};
    const Interval x = on_grid(first.x, last.x, frame.width, limits),
                   y = on_grid(first.y, last.y, frame.height, limits);
    return {x.begin, y.begin, x.end - x.begin, y.end - y.begin};
}

// Adds a region. Regions that overlap become the smallest one that contains both.
void add(std::vector<cv::Rect> &regions, cv::Rect region) {
    const auto overlaps = [&](const cv::Rect &other) { return !(other & region).empty(); };
    for (auto other = std::ranges::find_if(regions, overlaps); other != regions.end();
         other = std::ranges::find_if(regions, overlaps)) {
        region |= *other;
        regions.erase(other);
    }
    regions.push_back(region);
}

} // namespace

SearchRegions::SearchRegions(const arhost_tracker_setup &setup,
                             const std::function<double(const std::string &)> &margin) {
    std::vector<double> margins;
    for (std::uint32_t i = 0; i < setup.family_count; ++i)
        margins.push_back(margin(april_tag_name(setup.families[i])));
    for (const arhost_marker_config &marker : elements(setup.markers, setup.marker_count))
        markers_.push_back({marker.id, marker.family, marker.target, margins.at(marker.family)});
}

Seen SearchRegions::search(const arhost_track_request &request, const RegionLimits &limits,
                           std::span<const Pass> passes, const Verify &verify) const {
    std::vector<arhost_observation> verified;
    if (verify && !request.search_everywhere)
        for (const arhost_expected_marker &expected : elements(request.expected, request.expected_count)) {
            const Marker &marker = markers_.at(expected.marker);
            if (const auto one = verify(expected, marker.id, marker.family))
                verified.push_back(*one);
        }
    const auto detected = [&](Seen seen, const auto &regions_of) {
        const std::size_t before = seen.candidates;
        std::size_t most = 0;
        for (const Pass &pass : passes) {
            seen.candidates = 0;
            for (const cv::Rect &region : regions_of(pass))
                pass.detect(region, seen);
            most = std::max(most, seen.candidates);
        }
        seen.candidates = before + most;
        return seen;
    };
    Seen seen = detected({verified, verified.size()},
                         [&](const Pass &pass) { return of(request, limits, pass.family, verified); });
    if (miss_a_target(request, seen.markers))
        seen = detected({}, [&](const Pass &) { return std::vector{whole_of(request)}; });
    seen.candidates = std::max(seen.candidates, seen.markers.size()); // one may be a marker of several families
    return seen;
}

std::vector<cv::Rect> SearchRegions::of(const arhost_track_request &request, const RegionLimits &limits,
                                        const Family *family, std::span<const arhost_observation> seen) const {
    const cv::Rect whole = whole_of(request);
    if (request.search_everywhere)
        return {whole};
    std::vector<cv::Rect> regions;
    for (const arhost_expected_marker &expected : elements(request.expected, request.expected_count)) {
        const Marker &marker = markers_.at(expected.marker);
        if ((family && !family->lists(marker.id, marker.family)) || marker.is_in(seen))
            continue;
        if (const cv::Rect region = region_of(expected, marker.margin, whole.size(), limits); !region.empty())
            add(regions, region);
    }
    double area = 0;
    for (const cv::Rect &region : regions)
        area += region.area();
    return area > max_share * whole.area() ? std::vector{whole} : regions;
}

bool SearchRegions::miss_a_target(const arhost_track_request &request,
                                  std::span<const arhost_observation> seen) const {
    if (request.search_everywhere)
        return false;
    std::map<std::uint32_t, bool> is_seen; // targets
    for (const arhost_expected_marker &expected : elements(request.expected, request.expected_count)) {
        const Marker &marker = markers_.at(expected.marker);
        is_seen[marker.target] |= marker.is_in(seen);
    }
    return std::ranges::any_of(is_seen, [](const auto &target) { return !target.second; });
}

} // namespace arhost::fiducial
