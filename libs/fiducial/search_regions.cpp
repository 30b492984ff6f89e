// SPDX-License-Identifier: Apache-2.0
#include "search_regions.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>

namespace arhost::fiducial {
namespace {

// If the regions cover a larger part of the frame than this, searching them takes about as long as searching the
// whole frame.
constexpr double max_share = 0.6;

struct Interval {
    int begin, end;
};

// Returns the smallest interval around the given one whose ends are multiples of the grid, within 0 … `size`.
Interval on_grid(double first, double last, int size, const RegionLimits &limits) {
    const auto within = [&](double value) { return static_cast<int>(std::clamp<double>(value, 0, size)); };
    const double shortage = std::max(0.0, limits.min_side_px - (last - first));
    Interval interval{within(std::floor((first - shortage / 2) / limits.grid_px) * limits.grid_px),
                      within(std::ceil((last + shortage / 2) / limits.grid_px) * limits.grid_px)};
    if (interval.end - interval.begin < limits.min_side_px) { // the border of the frame has cut off a part
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

// Returns the region in which the detector finds the marker if the marker is at its expected place. The region is
// empty if that place is outside the frame.
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

double area_px2(const arhost_expected_marker *expected) {
    const auto &c = expected->corners_px;
    return ((c[2][0] - c[0][0]) * (c[3][1] - c[1][1]) - (c[2][1] - c[0][1]) * (c[3][0] - c[1][0])) / 2;
}

// Adds a region. Replaces regions that overlap by the smallest region that contains them.
void add(std::vector<cv::Rect> &regions, cv::Rect region) {
    const auto overlaps = [&](const cv::Rect &other) { return !(other & region).empty(); };
    for (auto other = std::ranges::find_if(regions, overlaps); other != regions.end();
         other = std::ranges::find_if(regions, overlaps)) {
        region |= *other;
        regions.erase(other);
    }
    regions.push_back(region);
}

Seen detected(const Detect &detect, const std::vector<cv::Rect> &regions, const decltype(Seen::wants) &wants = {}) {
    Seen seen{wants};
    for (const cv::Rect &region : regions)
        detect(region, seen);
    return seen;
}

} // namespace

SearchRegions::SearchRegions(const arhost_tracker_setup &setup,
                             const std::function<FamilyTraits(const std::string &)> &traits_of) {
    std::vector<FamilyTraits> traits;
    for (std::uint32_t i = 0; i < setup.family_count; ++i)
        traits.push_back(traits_of(april_tag_name(setup.families[i])));
    for (const arhost_marker_config &marker : elements(setup.markers, setup.marker_count))
        markers_.push_back({marker.id, marker.family, marker.target, traits.at(marker.family)});
}

Verified SearchRegions::verified(const arhost_track_request &request, const Verify &verify) const {
    const auto verify_all = [this, &request, &verify] {
        std::vector<arhost_observation> verified;
        const auto all = elements(request.expected, request.expected_count);
        std::vector<const arhost_expected_marker *> order;
        for (const arhost_expected_marker &expected : all)
            order.push_back(&expected);
        std::ranges::stable_sort(order, std::ranges::greater(), area_px2); // the largest first
        for (const arhost_expected_marker *expected : order) {
            const Marker &marker = markers_.at(expected->marker);
            if (const auto one = verify(*expected, marker.id, marker.family))
                verified.push_back(*one);
        }
        return verified;
    };
    if (request.expected_count == 0)
        return {};
    // If no thread can be started, the caller of get() verifies the markers.
    const std::launch by_any_thread = std::launch::async | std::launch::deferred;
    return std::async(request.search_everywhere ? by_any_thread : std::launch::deferred, verify_all).share();
}

Seen SearchRegions::search(const arhost_track_request &request, const RegionLimits &limits,
                           std::span<const Pass> passes, const Verified &verified) const {
    const cv::Rect whole = whole_of(request);
    Seen seen;
    for (const Pass &pass : passes)
        seen.add(detected(pass.detect, request.search_everywhere
                                           ? std::vector{whole}
                                           : rectangles(request, limits, pass.family, markers_of(verified))));
    const std::span<const arhost_observation> known = markers_of(verified);
    if (!request.search_everywhere)
        seen.candidates += known.size();
    seen.markers.insert(seen.markers.end(), known.begin(), known.end());

    seen.add(look_closer(passes, missed_markers(seen.markers), [&](const CloserLook &look, const Indices &wanted) {
        std::vector<cv::Rect> regions = around_expected(
            request, limits, [&](const arhost_expected_marker &one) { return wanted.contains(one.marker); });
        int area = tile_width_px * tile_height_px; // remaining area for a slow look
        if (look.is_slow)
            std::erase_if(regions, [&](const cv::Rect &region) {
                const bool fits = region.area() <= area;
                area -= fits ? region.area() : 0;
                return !fits;
            });
        return regions;
    }));
    if (miss_a_target(request, seen.markers)) {
        const auto is_new = [&](std::int32_t id, std::uint32_t family) {
            return std::ranges::none_of(seen.markers, [&](const arhost_observation &known) {
                return known.id == id && known.family == family;
            });
        };
        Seen everywhere;
        for (const Pass &pass : passes)
            everywhere.add(detected(pass.detect, {whole}, is_new));
        std::erase_if(everywhere.markers, [&](const arhost_observation &one) { return !is_new(one.id, one.family); });
        seen.add(everywhere);
    }
    if (request.search_everywhere)
        seen.add(look_closer(passes, missed_markers(seen.markers), [&](const CloserLook &look, const Indices &) {
            return std::vector{look.is_slow ? tile_of(whole.size(), request.frame->sequence) : whole};
        }));
    // One candidate may be a marker of several families.
    seen.candidates = std::max(seen.candidates, seen.markers.size());
    return seen;
}

template <class RegionsOf>
Seen SearchRegions::look_closer(std::span<const Pass> passes, const Indices &missed,
                                const RegionsOf &regions_of) const {
    const auto is_missed = [&](std::int32_t id, std::uint32_t family) {
        return std::ranges::any_of(
            missed, [&](std::uint32_t i) { return markers_[i].id == id && markers_[i].family == family; });
    };
    Seen closer;
    for (const Pass &pass : passes) {
        Indices wanted;
        std::ranges::copy_if(missed, std::inserter(wanted, wanted.end()), [&](std::uint32_t marker) {
            return !pass.family || pass.family->lists(markers_[marker].id, markers_[marker].family);
        });
        if (!wanted.empty())
            for (const CloserLook &look : pass.closer_looks)
                closer.add(detected(look.detect, regions_of(look, wanted), is_missed));
    }
    std::erase_if(closer.markers, [&](const arhost_observation &one) {
        return one.false_positive_rate > max_rate_of_closer_look || !is_missed(one.id, one.family);
    });
    return closer;
}

SearchRegions::Indices SearchRegions::missed_markers(std::span<const arhost_observation> seen) const {
    std::set<std::uint32_t> seen_targets;
    for (const Marker &marker : markers_)
        if (marker.is_in(seen))
            seen_targets.insert(marker.target);
    Indices missed;
    for (std::uint32_t i = 0; i < markers_.size(); ++i)
        if (!seen_targets.contains(markers_[i].target) &&
            false_positive_rate(markers_[i].traits.bits, 0) <= max_rate_of_closer_look)
            missed.insert(missed.end(), i);
    return missed;
}

cv::Rect SearchRegions::tile_of(cv::Size frame, std::uint64_t sequence) {
    constexpr int overlap_px = 96; // a marker of up to this size is completely in at least one tile
    const cv::Size tile(std::min(frame.width, tile_width_px), std::min(frame.height, tile_height_px));
    const auto count = [](int length, int tile_length) {
        return length == tile_length
                   ? 1U
                   : 1U + static_cast<unsigned>((length - overlap_px - 1) / (tile_length - overlap_px));
    };
    const auto begin = [](unsigned index, unsigned tiles, int length, int tile_length) {
        return tiles == 1 ? 0 : static_cast<int>(index * static_cast<unsigned>(length - tile_length) / (tiles - 1));
    };
    const unsigned columns = count(frame.width, tile.width), rows = count(frame.height, tile.height);
    // SplitMix64. With a fixed order, some tiles might never be searched if only every nth frame is searched.
    std::uint64_t hash = (sequence + 1) * 0x9E3779B97F4A7C15;
    hash = (hash ^ (hash >> 30)) * 0xBF58476D1CE4E5B9;
    hash = (hash ^ (hash >> 27)) * 0x94D049BB133111EB;
    const auto index = static_cast<unsigned>((hash ^ (hash >> 31)) % (columns * rows));
    return {{begin(index % columns, columns, frame.width, tile.width),
             begin(index / columns, rows, frame.height, tile.height)},
            tile};
}

std::vector<cv::Rect> SearchRegions::rectangles(const arhost_track_request &request, const RegionLimits &limits,
                                                const Family *family,
                                                std::span<const arhost_observation> seen) const {
    if (request.search_everywhere)
        return {whole_of(request)};
    return around_expected(request, limits, [&](const arhost_expected_marker &expected) {
        const Marker &marker = markers_.at(expected.marker);
        return (!family || family->lists(marker.id, marker.family)) && !marker.is_in(seen);
    });
}

std::vector<cv::Rect>
SearchRegions::around_expected(const arhost_track_request &request, const RegionLimits &limits,
                               const std::function<bool(const arhost_expected_marker &)> &accepts) const {
    const cv::Rect whole = whole_of(request);
    std::vector<cv::Rect> regions;
    for (const arhost_expected_marker &expected : elements(request.expected, request.expected_count))
        if (accepts(expected))
            if (const cv::Rect region =
                    region_of(expected, markers_.at(expected.marker).traits.margin, whole.size(), limits);
                !region.empty())
                add(regions, region);
    double area = 0;
    for (const cv::Rect &region : regions)
        area += region.area();
    return area > max_share * whole.area() ? std::vector{whole} : regions;
}

bool SearchRegions::miss_a_target(const arhost_track_request &request,
                                  std::span<const arhost_observation> seen) const {
    if (request.search_everywhere)
        return false;
    std::map<std::uint32_t, bool> is_seen; // keys: target indices
    for (const arhost_expected_marker &expected : elements(request.expected, request.expected_count)) {
        const Marker &marker = markers_.at(expected.marker);
        is_seen[marker.target] |= marker.is_in(seen);
    }
    return std::ranges::any_of(is_seen, [](const auto &target) { return !target.second; });
}

} // namespace arhost::fiducial
