// SPDX-License-Identifier: Apache-2.0
#include "host/frames.hpp"

#include "camera/mapping.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

namespace arhost::host {
namespace {

constexpr std::int64_t max_ahead_ns = 1'000'000'000; // documented in arhost/source.h

template <class Range> bool all_finite(const Range &values) {
    return std::all_of(std::begin(values), std::end(values), [](double value) { return std::isfinite(value); });
}

const char *problem_with(const arhost_marker &marker) {
    if (marker.state < ARHOST_MARKER_DETECTED || marker.state > ARHOST_MARKER_LOST)
        return "a marker's state is out of range";
    if (!std::memchr(marker.family, 0, sizeof marker.family))
        return "a marker's family is not a NUL-terminated string";
    for (const auto &corner : marker.corners_px)
        if (!all_finite(corner))
            return "a coordinate of a marker's corner is not finite";
    if (!all_finite(marker.mt_alternative) || !std::isfinite(marker.reprojection_px) ||
        !std::isfinite(marker.ambiguity))
        return "a marker's alternative pose, reprojection error or ambiguity is not finite";
    return camera::problem_with(marker.mt);
}

} // namespace

const char *accept_tracker_result(std::span<const std::byte> slot, const std::set<std::int32_t> &ids,
                                  arhost_record &record) {
    // Reads each byte of the shared memory only once, because the worker may still write to it.
    const auto &result = *reinterpret_cast<const volatile arhost_tracker_result *>(slot.data());
    const std::uint32_t count = result.marker_count;
    if (count > ARHOST_MAX_MARKERS)
        return "the tracker reports more markers than ARHOST_MAX_MARKERS";
    std::memcpy(record.markers, slot.data() + offsetof(arhost_tracker_result, markers),
                count * sizeof(arhost_marker));
    record.marker_count = 0;
    std::set<std::int32_t> seen;
    for (std::uint32_t i = 0; i < count; ++i) {
        const arhost_marker &marker = record.markers[i];
        if (!ids.contains(marker.id))
            return "the tracker reports a marker that the configuration does not list";
        if (!seen.insert(marker.id).second)
            return "the tracker reports a marker twice";
        if (const char *problem = problem_with(marker))
            return problem;
    }
    record.marker_count = count;
    return nullptr;
}

const char *accept_frame_info(const arhost_frame_info &info, std::int64_t previous_capture_ns, std::int64_t now_ns,
                              arhost_record &record) {
    if (info.clock != ARHOST_CLOCK_MONOTONIC && info.clock != ARHOST_CLOCK_MEDIA)
        return "a frame's clock is not set";
    if (info.capture_ns < previous_capture_ns)
        return "a frame's capture time is before that of the previous frame";
    if (info.clock == ARHOST_CLOCK_MONOTONIC && info.capture_ns > now_ns + max_ahead_ns)
        return "a frame's capture time is more than a second ahead of the clock";
    record.clock = info.clock;
    record.capture_ns = info.capture_ns;
    record.has_truth = info.has_truth && all_finite(info.true_mt);
    record.truth_id = info.truth_id;
    std::copy(std::begin(info.true_mt), std::end(info.true_mt), record.true_mt);
    return nullptr;
}

std::chrono::nanoseconds device_time(const arhost_render_info &info, std::chrono::nanoseconds busy) {
    if (std::cmp_greater(info.device_time_ns, busy.count()))
        return {};
    return std::chrono::nanoseconds(static_cast<std::int64_t>(info.device_time_ns));
}

} // namespace arhost::host
