// SPDX-License-Identifier: Apache-2.0
//
// A tracker plugin with the solver of its worker, in one process.
#pragma once

#include "worker/target_solver.hpp"

#include <fiducial/tracker_support.hpp>

#include <chrono>
#include <span>
#include <stdexcept>

namespace arhost::bench {

constexpr std::uint32_t default_full_search_every = 10; // of tracker.full_search_every

// The markers 0 … count − 1 of a family.
inline std::vector<test::Listed> first_markers(int count, double side_mm, const std::string &family = "tag36h11") {
    std::vector<test::Listed> listed;
    for (int id = 0; id < count; ++id)
        listed.push_back({id, side_mm, family});
    return listed;
}

// Each listed marker is a target of its own.
class SolvingTracker {
public:
    SolvingTracker(const std::string &plugin, const arhost_intrinsics &camera,
                   const std::vector<test::Listed> &listed,
                   const worker::TargetSolver::Settings &settings = {default_full_search_every},
                   const test::Options &options = {})
        : tracker_(plugin, options), solver_(camera, targets_of(listed), settings), targets_(listed.size()) {
        if (tracker_.created() != ARHOST_STATUS_OK || tracker_.start(camera, listed) != ARHOST_STATUS_OK)
            throw std::runtime_error(tracker_.log());
    }

    // Returns the time of the plugin's call.
    std::chrono::nanoseconds track(const test::GreyFrame &frame, std::int64_t capture_ns) {
        const void *const before = before_.empty() ? nullptr : before_.data();
        const auto expectation = solver_.expect(capture_ns, before);
        const auto begin = std::chrono::steady_clock::now();
        seen_ = tracker_.track(frame, expectation.markers, expectation.search_everywhere);
        const auto spent = std::chrono::steady_clock::now() - begin;
        arhost_tracker_result result{};
        result.observations = seen_.data();
        result.observation_count = static_cast<std::uint32_t>(seen_.size());
        std::vector<arhost_observation> sorted(seen_.size());
        after_.resize(solver_.state_size());
        solver_.solve(result, expectation.search_everywhere, capture_ns, before, after_.data(), {targets_, sorted});
        before_.swap(after_);
        return spent;
    }
    std::span<const arhost_observation> seen() const { return seen_; } // in the last frame
    std::span<const arhost_target> targets() const { return targets_; }

private:
    static std::vector<model::Target> targets_of(const std::vector<test::Listed> &listed) {
        std::vector<model::Target> targets;
        for (const test::Listed &one : listed) {
            const double h = one.side_mm / 2;
            targets.push_back({one.family + " " + std::to_string(one.id),
                               {{one.id, one.family, {{{-h, h, 0}, {h, h, 0}, {h, -h, 0}, {-h, -h, 0}}}}},
                               ""});
        }
        return targets;
    }

    test::Tracker tracker_;
    worker::TargetSolver solver_;
    std::vector<std::byte> before_, after_; // empty before the first frame
    std::vector<arhost_observation> seen_;
    std::vector<arhost_target> targets_;
};

} // namespace arhost::bench
