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

std::vector<arhost_observation> SearchRegions::verified_markers(const arhost_track_request &request,
                                                                const Verify &verify) const {
    std::vector<arhost_observation> verified;
    std::vector<const arhost_expected_marker *> order;
    for (const arhost_expected_marker &expected : elements(request.expected, request.expected_count))
        order.push_back(&expected);
    std::ranges::stable_sort(order, std::ranges::greater(), area_px2); // the largest first
    for (const arhost_expected_marker *expected : order) {
        const Marker &marker = markers_.at(expected->marker);
        if (const auto one = verify(*expected, marker.id, marker.family))
            verified.push_back(*one);
    }
    return verified;
}

Verified SearchRegions::verified(const arhost_track_request &request, const Verify &verify) const {
    if (request.expected_count == 0)
        return {};
    // If no thread can be started, the caller of get() verifies the markers.
    const std::launch by_any_thread = std::launch::async | std::launch::deferred;
    return std::async(request.search_everywhere ? by_any_thread : std::launch::deferred,
                      [this, &request, &verify] { return verified_markers(request, verify); })
        .share();
}

Seen SearchRegions::search(const arhost_track_request &request, const RegionLimits &limits,
                           std::span<const Pass> passes, const Verified &verified) const {
    const cv::Rect whole = whole_of(request);
    Seen seen;
    std::vector<const Pass *> partial; // passes that have not searched the whole frame
    for (const Pass &pass : passes) {
        const std::vector<cv::Rect> regions = request.search_everywhere
                                                  ? std::vector{whole}
                                                  : rectangles(request, limits, pass.family, markers_of(verified));
        seen.add(detected(pass.detect, regions));
        if (regions != std::vector{whole})
            partial.push_back(&pass);
    }
    const std::span<const arhost_observation> known = markers_of(verified);
    if (!request.search_everywhere)
        seen.candidates += known.size();
    seen.markers.insert(seen.markers.end(), known.begin(), known.end());

    const Indices missed = missed_markers(seen.markers);
    std::vector<LookAt> looks = looks_at_expected(request, limits, passes, missed);
    if (looks.empty() && request.search_everywhere)
        looks = look_in_turn(request, limits, passes, missed);
    for (const LookAt &look : looks)
        seen.add(look_closer(look, missed));

    if (miss_a_target(request, seen.markers)) {
        const auto is_new = [&](std::int32_t id, std::uint32_t family) {
            return std::ranges::none_of(seen.markers, [&](const arhost_observation &known) {
                return known.id == id && known.family == family;
            });
        };
        Seen everywhere;
        for (const Pass *pass : partial)
            everywhere.add(detected(pass->detect, {whole}, is_new));
        std::erase_if(everywhere.markers, [&](const arhost_observation &one) { return !is_new(one.id, one.family); });
        seen.add(everywhere);
    }
    // One candidate may be a marker of several families.
    seen.candidates = std::max(seen.candidates, seen.markers.size());
    return seen;
}

bool SearchRegions::needs_closer_look(const arhost_track_request &request, std::span<const arhost_observation> seen,
                                      const Family *family) const {
    const Indices wanted = wanted_of(family, missed_markers(seen));
    return request.search_everywhere
               ? !wanted.empty()
               : std::ranges::any_of(
                     elements(request.expected, request.expected_count),
                     [&](std::uint32_t marker) { return wanted.contains(marker); }, &arhost_expected_marker::marker);
}

SearchRegions::Indices SearchRegions::wanted_of(const Family *family, const Indices &missed) const {
    Indices wanted;
    std::ranges::copy_if(missed, std::inserter(wanted, wanted.end()), [&](std::uint32_t marker) {
        return !family || family->lists(markers_[marker].id, markers_[marker].family);
    });
    return wanted;
}

std::vector<SearchRegions::LookAt> SearchRegions::looks_at_expected(const arhost_track_request &request,
                                                                    const RegionLimits &limits,
                                                                    std::span<const Pass> passes,
                                                                    const Indices &missed) const {
    std::vector<LookAt> looks;
    for (const Pass &pass : passes) {
        const Indices wanted = wanted_of(pass.family, missed);
        const std::vector<cv::Rect> regions = around_expected(
            request, limits, [&](const arhost_expected_marker &one) { return wanted.contains(one.marker); });
        for (const CloserLook &look : pass.closer_looks) {
            LookAt &added = looks.emplace_back(LookAt{&look, regions});
            double left = look.max_part * whole_of(request).area();
            std::erase_if(added.regions, [&](const cv::Rect &region) {
                const bool fits = region.area() <= left;
                left -= fits ? region.area() : 0;
                return !fits;
            });
        }
    }
    std::erase_if(looks, [](const LookAt &look) { return look.regions.empty(); });
    return looks;
}

std::vector<SearchRegions::LookAt> SearchRegions::look_in_turn(const arhost_track_request &request,
                                                               const RegionLimits &limits,
                                                               std::span<const Pass> passes,
                                                               const Indices &missed) const {
    std::vector<const CloserLook *> looks;
    for (const Pass &pass : passes)
        if (!wanted_of(pass.family, missed).empty())
            for (const CloserLook &look : pass.closer_looks)
                looks.push_back(&look);
    if (looks.empty())
        return {};
    const auto count = static_cast<unsigned>(looks.size());
    const unsigned turn = turn_of(request.frame->sequence, count * tile_count);
    const CloserLook *look = looks[turn % count];
    const cv::Rect whole = whole_of(request);
    return {{look, {look->is_slow() ? tile_of(whole.size(), limits, turn / count) : whole}}};
}

Seen SearchRegions::look_closer(const LookAt &look, const Indices &missed) const {
    const auto is_missed = [&](std::int32_t id, std::uint32_t family) {
        return std::ranges::any_of(
            missed, [&](std::uint32_t i) { return markers_[i].id == id && markers_[i].family == family; });
    };
    Seen closer = detected(look.look->detect, look.regions, is_missed);
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

cv::Rect SearchRegions::tile_of(cv::Size frame, const RegionLimits &limits, unsigned index) {
    const auto along = [&](int length, unsigned position, unsigned count) {
        const int part = std::max((3 * length + 6) / 7, std::min(length, limits.min_side_px));
        const int last = static_cast<int>(count) - 1, begin = static_cast<int>(position) * (length - part) / last;
        return Interval{begin / limits.grid_px * limits.grid_px, begin + part};
    };
    const Interval x = along(frame.width, index % tile_columns, tile_columns),
                   y = along(frame.height, index / tile_columns, tile_rows);
    return {x.begin, y.begin, x.end - x.begin, y.end - y.begin};
}

unsigned SearchRegions::turn_of(std::uint64_t sequence, unsigned count) {
    std::uint64_t hash = (sequence / count + 1) * 0x9E3779B97F4A7C15; // SplitMix64
    hash = (hash ^ (hash >> 30)) * 0xBF58476D1CE4E5B9;
    hash = (hash ^ (hash >> 27)) * 0x94D049BB133111EB;
    return static_cast<unsigned>((sequence % count + (hash ^ (hash >> 31)) % count) % count);
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
