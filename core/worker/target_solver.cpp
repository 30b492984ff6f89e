// SPDX-License-Identifier: Apache-2.0
#include "worker/target_solver.hpp"

#include "pose/smoothing.hpp"
#include "pose/track.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <set>
#include <stdexcept>

namespace arhost::worker {

struct TargetSolver::Header {
    std::uint32_t frames_since_full_search, reserved;
};

// The state of a target after the last frame. Plain data without pointers; all zero if it was never sighted.
struct TargetSolver::Memory {
    pose::Track track;                      // not used for bodies
    pose::Smoothing smoothing;              // only if the poses are filtered
    double mt[16];                          // the last reported pose
    std::uint32_t was_reported, age_frames; // whether the target was ever reported; frames since the last report
    double log_chance;                      // logarithm of the probability that all recent sightings are false
    // is_sighted: whether the target was seen in the last frame, even if it was not reported.
    std::uint32_t is_sighted, reserved;
};

namespace {

using pose::Estimate;
using pose::ObservedMarker;
using pose::Rigid;

// Standard deviations of corner errors, for the choice among poses. They exceed the noise, because calibrations are
// not exact. That of a map includes the errors of its printed layout.
constexpr double marker_sigma_px = 0.1, map_sigma_px = 0.5;

// A target is reported if the probability that all its sightings are false is below exp(confirmed_log_chance). A
// cluttered frame has dozens of squares that look random. With this limit, one of several hundred thousand frames has
// a false marker.
const double confirmed_log_chance = std::log(1e-7), certain_log_chance = std::log(1e-30),
             max_log_chance = std::log(double{ARHOST_MAX_MARKERS});

// Noise of the corners, if the tracker does not know it.
constexpr double unknown_sigma_px = 0.3;

[[noreturn]] void violation(const std::string &what) {
    throw std::runtime_error("contract violation: the tracker " + what);
}

bool is_rotation(const Rigid &pose, double tolerance = 1e-6) {
    return (pose.rotation * pose.rotation.transpose()).isIdentity(tolerance) && pose.rotation.determinant() > 0;
}

// Converts a covariance from OpenCV's camera axes to those of arhost_target.mt. Both flip y and z.
void write_covariance(const pose::Matrix6d &covariance, double (&out)[36]) {
    const Eigen::Matrix<double, 6, 1> flip(1, -1, -1, 1, -1, -1);
    Eigen::Map<pose::Matrix6d>{out} = flip.asDiagonal() * covariance * flip.asDiagonal();
}

double shortest_side_px(const ObservedMarker &marker) {
    double shortest = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < 4; ++i)
        shortest = std::min(shortest, (marker.corners_px[(i + 1) % 4] - marker.corners_px[i]).norm());
    return shortest;
}

Eigen::Vector2d centre_px(const arhost_observation &observation) {
    Eigen::Vector2d sum(0, 0);
    for (const auto &corner : observation.corners_px)
        sum += Eigen::Vector2d(corner);
    return sum / 4;
}

} // namespace

TargetSolver::TargetSolver(const arhost_intrinsics &intrinsics, const std::vector<model::Target> &targets,
                           const Settings &settings)
    : projection_(intrinsics), settings_(settings) {
    std::uint32_t next_index = 0;
    const std::vector<std::string> families = families_of(targets);
    marker_counts_.resize(families.size());
    for (const model::Target &target : targets) {
        for (const model::TargetMarker &marker : target.markers) {
            const auto family =
                static_cast<std::uint32_t>(std::ranges::find(families, marker.family) - families.begin());
            Marker &added = markers_[{family, marker.id}];
            added.index = next_index++;
            ++marker_counts_[family];
            added.target = targets_.size();
            std::ranges::transform(marker.corners_mm, added.corners_mm.begin(),
                                   [](const auto &corner) { return Eigen::Vector3d(corner.data()); });
        }
        targets_.push_back({!target.body.empty(), target.markers.size() > 1});
    }
}

double TargetSolver::Target::corner_sigma_px() const {
    return has_map ? map_sigma_px : marker_sigma_px;
}

std::uint64_t TargetSolver::state_size() const {
    return sizeof(Header) + targets_.size() * sizeof(Memory);
}

TargetSolver::Header TargetSolver::header_of(const void *state) const {
    Header header{};
    if (state)
        std::memcpy(&header, state, sizeof header);
    return header;
}

TargetSolver::Memory TargetSolver::memory_of(const void *state, std::size_t target) const {
    Memory memory{};
    if (state)
        std::memcpy(&memory, static_cast<const std::byte *>(state) + sizeof(Header) + target * sizeof memory,
                    sizeof memory);
    const bool has_pose = !memory.was_reported || is_rotation(pose::rigid_of(memory.mt));
    if (!has_pose || !(memory.log_chance >= certain_log_chance && memory.log_chance <= max_log_chance))
        memory = {}; // the state is not one that this class has written
    return memory;
}

TargetSolver::Expectation TargetSolver::expect(std::int64_t capture_ns, const void *before) const {
    Expectation expectation{{},
                            !before || header_of(before).frames_since_full_search + 1 >= settings_.full_search_every};
    std::vector<std::optional<pose::Motion>> motions;
    for (std::size_t target = 0; target < targets_.size(); ++target) {
        const Memory memory = memory_of(before, target);
        motions.push_back(memory.is_sighted ? predicted_motion(memory.track, capture_ns) : std::nullopt);
        // A target that was lost in the last frame may be anywhere now.
        expectation.search_everywhere |= memory.was_reported && memory.age_frames == 1;
    }
    for (const auto &[key, marker] : markers_)
        if (const auto &motion = motions[marker.target])
            if (const auto place = expected(marker, *motion))
                expectation.markers.push_back(*place);
    expectation.search_everywhere |= expectation.markers.empty();
    return expectation;
}

// Returns where a marker is expected; std::nullopt if it is outside of the frame.
std::optional<arhost_expected_marker> TargetSolver::expected(const Marker &marker, const pose::Motion &motion) const {
    constexpr double sigmas = 4, min_margin_px = 4;
    arhost_expected_marker expected{sizeof expected, marker.index, {}, min_margin_px};
    Eigen::AlignedBox2d bounds;
    for (int i = 0; i < 4; ++i) {
        pose::Jacobian23 derivative;
        const auto pixel = projection_.pixel(pose_of(motion) * marker.corners_mm[i], &derivative);
        if (!pixel)
            return std::nullopt;
        const Eigen::Matrix2d covariance =
            derivative * covariance_of(motion, marker.corners_mm[i]) * derivative.transpose();
        expected.margin_px = std::max(expected.margin_px, sigmas * std::sqrt(covariance.trace()));
        expected.corners_px[i][0] = pixel->x();
        expected.corners_px[i][1] = pixel->y();
        bounds.extend(*pixel);
    }
    const arhost_intrinsics &frame = projection_.intrinsics();
    const Eigen::Vector2d margin(expected.margin_px, expected.margin_px);
    const Eigen::AlignedBox2d whole(Eigen::Vector2d(0, 0), Eigen::Vector2d(frame.width - 1, frame.height - 1)),
        region(bounds.min() - margin, bounds.max() + margin);
    return whole.intersects(region) ? std::optional(expected) : std::nullopt;
}

// Returns whether a marker is at the place that a motion gives, within the marker's shortest side. `is_predicted`:
// the tolerance is also at most the uncertainty of the motion.
bool TargetSolver::is_near(const arhost_observation &observation, const pose::Motion &motion,
                           bool is_predicted) const {
    const auto place = expected(*marker_of(observation), motion);
    if (!place)
        return false;
    const ObservedMarker seen = observed(observation, marker_sigma_px);
    const double side_px = shortest_side_px(seen),
                 tolerance_px = is_predicted ? std::min(place->margin_px, side_px) : side_px;
    for (std::size_t i = 0; i < 4; ++i)
        if (!((seen.corners_px[i] - Eigen::Vector2d(place->corners_px[i])).norm() <= tolerance_px))
            return false;
    return true;
}

std::uint32_t TargetSolver::move_missed_to_end(Expectation &expectation,
                                               const arhost_tracker_result &reported) const {
    std::set<std::uint32_t> seen;
    for (const arhost_observation &observation : std::span(reported.observations, reported.observation_count))
        if (const Marker *marker = marker_of(observation))
            seen.insert(marker->index);
    const auto is_seen = [&](const arhost_expected_marker &expected) { return seen.contains(expected.marker); };
    auto &markers = expectation.markers;
    return static_cast<std::uint32_t>(markers.end() - std::stable_partition(markers.begin(), markers.end(), is_seen));
}

const TargetSolver::Marker *TargetSolver::marker_of(const arhost_observation &observation) const {
    const auto found = markers_.find({observation.family, observation.id});
    return found == markers_.end() ? nullptr : &found->second;
}

void TargetSolver::check(const arhost_tracker_result &reported) const {
    if (reported.observation_count > ARHOST_MAX_OBSERVATIONS)
        violation("reports " + std::to_string(reported.observation_count) + " observations; the limit is " +
                  std::to_string(ARHOST_MAX_OBSERVATIONS));
    for (const arhost_observation &observation : std::span(reported.observations, reported.observation_count)) {
        const std::string name = "marker " + std::to_string(observation.id);
        if (observation.family >= marker_counts_.size())
            violation("reports " + name + " with the family index " + std::to_string(observation.family) +
                      ", but the setup has " + std::to_string(marker_counts_.size()) + " families");
        for (const auto &corner : observation.corners_px)
            if (!std::isfinite(corner[0]) || !std::isfinite(corner[1]))
                violation("reports " + name + " with a corner that is not finite");
        if (!(observation.decision_margin >= 0 && std::isfinite(observation.decision_margin)))
            violation("reports " + name + " with an invalid decision margin");
        if (!(observation.corner_sigma_px >= 0 && std::isfinite(observation.corner_sigma_px)))
            violation("reports " + name + " with an invalid corner noise");
        if (!(observation.false_positive_rate >= 0 && observation.false_positive_rate <= 1))
            violation("reports " + name + " with a false positive rate outside of 0 to 1");
    }
    if (reported.pose_count > targets_.size())
        violation("reports more poses than there are targets");
    std::vector<bool> has_pose(targets_.size());
    for (const arhost_body_pose &body : std::span(reported.poses, reported.pose_count)) {
        if (body.target >= targets_.size() || !targets_[body.target].is_body)
            violation("reports a pose of the target " + std::to_string(body.target) + ", which is not a body");
        if (has_pose[body.target])
            violation("reports two poses of the target " + std::to_string(body.target));
        has_pose[body.target] = true;
        if (body.state < ARHOST_TARGET_DETECTED || body.state > ARHOST_TARGET_LOST)
            violation("reports a pose with an invalid state");
        if (body.state == ARHOST_TARGET_DETECTED && body.age_frames != 0)
            violation("reports a detected body with an age of " + std::to_string(body.age_frames) + " frames");
        const auto is_finite = [](double number) { return std::isfinite(number); };
        if (!std::ranges::all_of(body.mt, is_finite) || !std::ranges::all_of(body.covariance, is_finite) ||
            !is_rotation(pose::rigid_of(body.mt)))
            violation("reports a pose or covariance that is not finite, or a pose that is no rotation");
    }
}

ObservedMarker TargetSolver::observed(const arhost_observation &observation, double corner_sigma_px) const {
    ObservedMarker marker{marker_of(observation)->corners_mm, {}, corner_sigma_px};
    std::ranges::transform(observation.corners_px, marker.corners_px.begin(),
                           [](const auto &corner) { return Eigen::Vector2d(corner); });
    return marker;
}

// If the same marker is seen several times, keeps one copy: the one nearest to where the target is expected,
// according to its motion or, if that is unknown, to the target's other markers. If there is no expectation, keeps
// the copy with the fewest corrected bits and, among equals, the one that was read most clearly.
std::vector<const arhost_observation *> TargetSolver::without_copies(std::span<const arhost_observation> observations,
                                                                     const std::optional<pose::Motion> &predicted,
                                                                     double corner_sigma_px) const {
    std::map<std::pair<std::uint32_t, std::int32_t>, std::vector<const arhost_observation *>> by_marker;
    for (const arhost_observation &observation : observations)
        by_marker[{observation.family, observation.id}].push_back(&observation);
    std::vector<const arhost_observation *> kept;
    std::vector<ObservedMarker> markers;
    for (const auto &[marker, copies] : by_marker)
        if (copies.size() == 1) {
            kept.push_back(copies.front());
            markers.push_back(observed(*kept.back(), corner_sigma_px));
        }
    std::vector<Estimate> poses;
    if (!predicted && kept.size() < by_marker.size())
        poses = estimate_poses(markers, projection_);
    const bool is_known = predicted || !poses.empty();
    const Rigid expected = predicted ? pose_of(*predicted) : is_known ? poses.front().camera_from_target : Rigid();
    for (const auto &[key, copies] : by_marker) {
        if (copies.size() == 1)
            continue;
        const std::array<Eigen::Vector3d, 4> &corners = markers_.at(key).corners_mm;
        const auto centre = is_known ? projection_.pixel(expected * ((corners[0] + corners[2]) / 2)) : std::nullopt;
        const auto cost = [&](const arhost_observation *copy) {
            return centre ? std::pair((centre_px(*copy) - *centre).norm(), 0.0)
                          : std::pair(static_cast<double>(copy->hamming), -copy->decision_margin);
        };
        kept.push_back(*std::ranges::min_element(copies, {}, cost));
    }
    return kept;
}

// Returns the covariance of a target with a single marker, from the noise of its corners.
pose::Matrix6d TargetSolver::single_covariance(const Rigid &pose, const arhost_observation &seen) const {
    const ObservedMarker marker = observed(seen, seen.corner_sigma_px > 0 ? seen.corner_sigma_px : unknown_sigma_px);
    std::array<pose::Correspondence, 4> corners;
    for (std::size_t i = 0; i < 4; ++i)
        corners[i] = {marker.corners_on_target_mm[i], marker.corners_px[i], marker.corner_sigma_px};
    const auto estimate = assess(pose, corners, projection_);
    return estimate ? estimate->covariance : pose::Matrix6d::Zero();
}

// Returns whether the observed corners are near their projections with this pose of the target.
bool TargetSolver::fits(const ObservedMarker &marker, const Rigid &pose) const {
    double squares = 0;
    for (std::size_t i = 0; i < 4; ++i) {
        const auto pixel = projection_.pixel(pose * marker.corners_on_target_mm[i]);
        if (!pixel)
            return false;
        squares += (*pixel - marker.corners_px[i]).squaredNorm();
    }
    return std::sqrt(squares / 4) <= std::max(2.0, 0.05 * shortest_side_px(marker));
}

// Sets `projected_px`.
void TargetSolver::project(const Rigid &pose, arhost_observation &observation) const {
    std::array<Eigen::Vector2d, 4> corners_px;
    for (std::size_t i = 0; i < 4; ++i) {
        const auto pixel = projection_.pixel(pose * marker_of(observation)->corners_mm[i]);
        if (!pixel)
            return;
        corners_px[i] = *pixel;
    }
    for (std::size_t i = 0; i < 4; ++i)
        std::ranges::copy(corners_px[i], observation.projected_px[i]);
}

// `predicted`: the motion predicted from memory.track.
void TargetSolver::add_sighting(Memory &memory, const arhost_observation &seen,
                                const std::optional<pose::Motion> &predicted) const {
    double &chance = memory.log_chance;
    if (seen.false_positive_rate > 0 && !(predicted && is_near(seen, *predicted, true))) {
        const double first = std::log(marker_counts_[seen.family]); // without evidence
        // A step that the motion does not predict halves the evidence, but a confirmed target remains confirmed.
        const bool is_step =
            predicted && (is_near(seen, *predicted, false) || is_near(seen, memory.track.branch[0], false));
        const double left = is_step ? (first + chance) / 2 : first;
        if (is_step && chance <= confirmed_log_chance) {
            chance = std::min(left, confirmed_log_chance);
        } else {
            memory.track = {};
            chance = left;
        }
    }
    chance = std::max(chance + std::log(seen.false_positive_rate), certain_log_chance);
}

void TargetSolver::solve(const Target &target, std::span<arhost_observation> observations, std::int64_t capture_ns,
                         Memory &memory, arhost_target &out) const {
    const auto predicted = predicted_motion(memory.track, capture_ns);
    const auto kept = without_copies(observations, predicted, target.corner_sigma_px());
    std::vector<ObservedMarker> markers;
    markers.reserve(kept.size());
    for (const arhost_observation *observation : kept)
        markers.push_back(observed(*observation, target.corner_sigma_px()));
    std::vector<Estimate> poses = estimate_poses(markers, projection_);
    // A single marker that does not fit has a hidden corner. With several markers, such corners are outliers.
    if (markers.size() == 1)
        std::erase_if(poses, [&](const Estimate &pose) { return !fits(markers.front(), pose.camera_from_target); });
    if (poses.empty())
        return;
    std::vector<const arhost_observation *> fitting;
    for (std::size_t i = 0; i < kept.size(); ++i)
        if (fits(markers[i], poses.front().camera_from_target))
            fitting.push_back(kept[i]);
    memory.is_sighted = 1;
    if (!settings_.confirm || fitting.size() > 1) // several markers agree
        memory.log_chance = certain_log_chance;
    else
        add_sighting(memory, fitting.empty() ? *kept.front() : *fitting.front(), predicted);
    const pose::Step step = next_step(memory.track, poses, capture_ns);
    memory.track = step.track;
    if (memory.log_chance > confirmed_log_chance)
        return;
    memory.was_reported = 1;
    memory.age_frames = 0;
    const Estimate &chosen = poses[step.chosen];
    const Rigid pose = settings_.smooth ? smoothed(memory.smoothing, chosen, capture_ns) : chosen.camera_from_target;
    std::ranges::copy(matrix_of(pose), memory.mt);
    for (arhost_observation &observation : observations)
        project(pose, observation);
    out.state = ARHOST_TARGET_DETECTED;
    write_covariance(target.has_map ? chosen.covariance : single_covariance(chosen.camera_from_target, *kept.front()),
                     out.covariance);
    out.reprojection_px = chosen.reprojection_px;
    if (poses.size() == 1)
        return;
    const Estimate &other = poses[1 - step.chosen];
    std::ranges::copy(matrix_of(other.camera_from_target), out.mt_alternative);
    out.ambiguity =
        chosen.reprojection_px < other.reprojection_px ? chosen.reprojection_px / other.reprojection_px : 1;
}

void TargetSolver::solve(const arhost_tracker_result &reported, bool searched_everywhere, std::int64_t capture_ns,
                         const void *before, void *after, const Output &output) const {
    check(reported);
    const Header header{searched_everywhere ? 0 : header_of(before).frames_since_full_search + 1, 0};
    std::memcpy(after, &header, sizeof header);
    const std::span all(reported.observations, reported.observation_count);
    // Indices of the observations: those of the first target, …, then those of no target.
    std::vector<std::size_t> order;
    std::vector<std::size_t> target_of;
    for (std::size_t i = 0; i < all.size(); ++i) {
        const Marker *marker = marker_of(all[i]);
        target_of.push_back(marker ? marker->target : targets_.size());
        order.push_back(i);
    }
    std::ranges::stable_sort(order, {}, [&](std::size_t i) { return target_of[i]; });
    for (std::size_t i = 0; i < all.size(); ++i) {
        output.observations[i] = all[order[i]];
        std::memset(output.observations[i].projected_px, 0, sizeof output.observations[i].projected_px);
    }

    std::size_t next = 0;
    for (std::size_t index = 0; index < targets_.size(); ++index) {
        Memory memory = memory_of(before, index);
        if (memory.was_reported)
            ++memory.age_frames;
        memory.is_sighted = 0;
        arhost_target &out = output.targets[index];
        out = {};
        out.struct_size = sizeof out;
        out.state = memory.was_reported ? ARHOST_TARGET_LOST : 0;
        out.first_observation = static_cast<std::uint32_t>(next);
        while (next < all.size() && target_of[order[next]] == index)
            ++next;
        out.observation_count = static_cast<std::uint32_t>(next) - out.first_observation;
        if (out.observation_count > 0)
            solve(targets_[index], output.observations.subspan(out.first_observation, out.observation_count),
                  capture_ns, memory, out);
        if (!memory.is_sighted && memory.log_chance > confirmed_log_chance) {
            memory.track = {};
            memory.log_chance = 0;
        }
        const auto poses = std::span(reported.poses, reported.pose_count);
        if (const auto body = std::ranges::find(poses, index, &arhost_body_pose::target); body != poses.end()) {
            memory.was_reported = 1;
            memory.age_frames = out.age_frames = body->age_frames;
            Rigid pose = pose::rigid_of(body->mt);
            if (!is_rotation(pose, 1e-9)) // the precision that arhost_target.mt promises
                pose.rotation = pose::orthonormal(pose.rotation);
            std::ranges::copy(matrix_of(pose), memory.mt);
            out.state = body->state;
            std::ranges::copy(body->covariance, out.covariance);
        }
        out.age_frames = memory.age_frames;
        std::ranges::copy(memory.mt, out.mt);
        std::memcpy(static_cast<std::byte *>(after) + sizeof header + index * sizeof memory, &memory, sizeof memory);
    }
}

} // namespace arhost::worker
