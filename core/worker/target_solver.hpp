// SPDX-License-Identifier: Apache-2.0
//
// Computes the poses of targets from what a tracker reports.
#pragma once

#include "model/target.hpp"
#include "pose/motion_filter.hpp"

#include <arhost/tracker.h>

#include <map>
#include <span>

namespace arhost::worker {

// The result of each call depends only on the arguments. The memory of the targets is passed as `before` and `after`,
// so it survives the worker (ADR 26). It contains the motion of each target, which distinguishes the two solutions of
// the planar pose problem (pose/track.hpp).
class TargetSolver {
public:
    struct Settings {
        std::uint32_t
            full_search_every; // maximum interval, in frames, between searches of the whole frame; at least 1
        bool smooth = false;   // whether the poses are filtered (pose/smoothing.hpp)
        bool confirm = true;   // whether a target is reported only when it is improbable that all its sightings are
                               // false (arhost_observation.false_positive_rate; ADR 29)
    };
    TargetSolver(const arhost_intrinsics &intrinsics, const std::vector<model::Target> &targets,
                 const Settings &settings);

    // Size of `before` and `after`, in bytes.
    std::uint64_t state_size() const;

    // The fields of the same names of arhost_track_request, which tell a tracker where to search in the next frame.
    struct Expectation {
        std::vector<arhost_expected_marker> markers;
        bool search_everywhere;
    };
    Expectation expect(std::int64_t capture_ns, const void *before) const;

    // Moves the markers that the tracker has not reported to the end, and returns their number. The report must be
    // valid.
    std::uint32_t move_missed_to_end(Expectation &expectation, const arhost_tracker_result &reported) const;

    struct Output {
        std::span<arhost_target> targets; // one for each target; state 0 if it was never reported
        // At least as many as reported. Observations of the same target are adjacent.
        std::span<arhost_observation> observations;
    };
    // Throws std::runtime_error if the report violates the contract. `before`: what the last accepted call wrote to
    // `after`; null in the first frame.
    void solve(const arhost_tracker_result &reported, bool searched_everywhere, std::int64_t capture_ns,
               const void *before, void *after, const Output &output) const;

private:
    struct Marker {
        std::uint32_t index; // index in arhost_tracker_setup.markers
        std::size_t target;
        std::array<Eigen::Vector3d, 4> corners_mm;
    };
    struct Target {
        bool is_body, has_map;
        double corner_sigma_px() const;
    };
    struct Header;
    struct Memory;

    Header header_of(const void *state) const;
    Memory memory_of(const void *state, std::size_t target) const;
    std::optional<arhost_expected_marker> expected(const Marker &marker, const pose::Motion &motion) const;
    bool is_near(const arhost_observation &observation, const pose::Motion &motion, bool is_predicted) const;
    const Marker *marker_of(const arhost_observation &observation) const;
    pose::ObservedMarker observed(const arhost_observation &observation, double corner_sigma_px) const;
    std::vector<const arhost_observation *> without_copies(std::span<const arhost_observation> observations,
                                                           const std::optional<pose::Motion> &predicted,
                                                           double corner_sigma_px) const;
    void add_sighting(Memory &memory, const arhost_observation &seen,
                      const std::optional<pose::Motion> &predicted) const;
    void solve(const Target &target, std::span<arhost_observation> observations, std::int64_t capture_ns,
               Memory &memory, arhost_target &out) const;
    void check(const arhost_tracker_result &reported) const;
    pose::Matrix6d single_covariance(const pose::Rigid &pose, const arhost_observation &seen) const;
    bool fits(const pose::ObservedMarker &marker, const pose::Rigid &pose) const;
    void project(const pose::Rigid &pose, arhost_observation &observation) const;

    pose::Projection projection_;
    std::vector<Target> targets_;
    std::map<std::pair<std::uint32_t, std::int32_t>, Marker> markers_; // by family and id
    std::vector<std::uint32_t> marker_counts_;                         // number of markers of each family
    Settings settings_;
};

} // namespace arhost::worker
