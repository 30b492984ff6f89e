// SPDX-License-Identifier: Apache-2.0
#include "host/frame_validation.hpp"

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

const char *problem_with(const arhost_target &target, std::uint32_t observation_count) {
    if (target.state < ARHOST_TARGET_DETECTED || target.state > ARHOST_TARGET_LOST)
        return "a target's state is out of range";
    if (target.first_observation > observation_count ||
        target.observation_count > observation_count - target.first_observation)
        return "a target's observations are out of range";
    if (!all_finite(target.mt_alternative) || !all_finite(target.covariance) ||
        !std::isfinite(target.reprojection_px) || !std::isfinite(target.ambiguity))
        return "a target's alternative pose, covariance, reprojection error or ambiguity is not finite";
    return camera::problem_with(target.mt);
}

const char *problem_with(const arhost_observation &observation, std::size_t family_count) {
    if (observation.family >= family_count)
        return "an observation's family is out of range";
    for (const auto &corners : {observation.corners_px, observation.projected_px})
        for (int i = 0; i < 4; ++i)
            if (!all_finite(corners[i]))
                return "a coordinate of an observation's corner is not finite";
    if (!(observation.decision_margin >= 0 && std::isfinite(observation.decision_margin)) ||
        !(observation.corner_sigma_px >= 0 && std::isfinite(observation.corner_sigma_px)) ||
        !(observation.false_positive_rate >= 0 && observation.false_positive_rate <= 1))
        return "an observation's decision margin, corner noise or false positive rate is out of range";
    return nullptr;
}

const char *problem_with(const arhost_expected_marker &expected, std::size_t marker_count) {
    if (expected.marker >= marker_count)
        return "an expected marker's index is out of range";
    for (const auto &corner : expected.corners_px)
        if (!all_finite(corner))
            return "a coordinate of an expected marker's corner is not finite";
    if (!(expected.margin_px >= 0 && std::isfinite(expected.margin_px)))
        return "an expected marker's margin is negative or not finite";
    return nullptr;
}

// Copies an array from a slot to which the worker may still write, so that later checks and uses see the same bytes.
template <class T> void copy_array(std::span<const std::byte> slot, std::uint64_t offset, std::vector<T> &copy) {
    const auto to = std::as_writable_bytes(std::span(copy));
    std::ranges::copy(slot.subspan(offset, to.size()), to.begin());
}

} // namespace

const char *accept_tracker_result(std::span<const std::byte> slot, const std::vector<model::Target> &configured,
                                  std::size_t family_count, Frame &frame) {
    const ipc::TrackerSlot layout(configured.size());
    std::vector<ipc::TrackerSlot::Header> header(1);
    copy_array(slot, 0, header);
    const auto [count, expected_count, missed_count, searched_everywhere, candidate_count] = header.front();
    if (count > ARHOST_MAX_OBSERVATIONS)
        return "the tracker reports more observations than ARHOST_MAX_OBSERVATIONS";
    if (expected_count > ARHOST_MAX_MARKERS || missed_count > expected_count)
        return "the number of expected or missed markers is out of range";
    if (candidate_count < -1)
        return "the number of candidates is less than -1";
    std::vector<arhost_observation> observations(count);
    copy_array(slot, layout.observations_offset, observations);
    std::vector<arhost_target> targets(configured.size());
    copy_array(slot, ipc::TrackerSlot::targets_offset, targets);
    for (arhost_observation &observation : observations) {
        observation.struct_size = sizeof observation;
        if (const char *problem = problem_with(observation, family_count))
            return problem;
    }
    std::size_t marker_count = 0;
    for (const model::Target &target : configured)
        marker_count += target.markers.size();
    std::vector<arhost_expected_marker> expected(expected_count);
    copy_array(slot, layout.expected_offset, expected);
    for (arhost_expected_marker &marker : expected) {
        marker.struct_size = sizeof marker;
        if (const char *problem = problem_with(marker, marker_count))
            return problem;
    }
    for (std::size_t i = 0; i < targets.size(); ++i) {
        arhost_target &target = targets[i];
        if (target.state == 0) // never seen
            continue;
        if (const char *problem = problem_with(target, count))
            return problem;
        target.struct_size = sizeof target;
        target.reserved = 0;
        std::memset(target.name, 0, sizeof target.name);
        configured[i].name.copy(target.name, sizeof target.name - 1);
    }
    std::erase_if(targets, [](const arhost_target &target) { return target.state == 0; });
    frame.targets = std::move(targets);
    frame.observations = std::move(observations);
    frame.expected = std::move(expected);
    frame.record.search = {.everywhere = searched_everywhere != 0,
                           .observation_count = count,
                           .unlisted_count = 0,
                           .expected_count = expected_count,
                           .missed_count = missed_count,
                           .candidate_count = candidate_count,
                           .reserved_for_growth = {}};
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
    std::ranges::copy(info.truth_target, record.truth_target);
    record.truth_target[ARHOST_MAX_NAME - 1] = 0;
    std::copy(std::begin(info.true_mt), std::end(info.true_mt), record.true_mt);
    return nullptr;
}

std::chrono::nanoseconds device_time(const arhost_render_info &info, std::chrono::nanoseconds busy) {
    if (std::cmp_greater(info.device_time_ns, busy.count()))
        return {};
    return std::chrono::nanoseconds(static_cast<std::int64_t>(info.device_time_ns));
}

} // namespace arhost::host
