// SPDX-License-Identifier: Apache-2.0
// Trackers that report the poses of bodies.
#include "conformance/rigid.hpp"
#include "conformance/tracker.hpp"

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <thread>

namespace arhost::conformance {
namespace {

// Starts the tracker with the body and a target of another kind, if it detects markers.
TrackerSetup setup_of(const Context &context, const std::string &body) {
    const bool has_markers = !context.family.empty();
    TrackerSetup setup(context, wide_camera(context),
                       has_markers ? std::vector<std::string>{context.family} : std::vector<std::string>{});
    if (has_markers)
        setup.add({prints_of(context).front().id, 80});
    setup.add_body(body);
    return setup;
}

struct Started {
    explicit Started(Context &context) : tracker(context), image(empty_image(wide_camera(context))) {
        const TrackerSetup setup = setup_of(context, context.body);
        tracker.instance().expect_ok("start", tracker.start_with(setup));
        body_target = setup.setup().target_count - 1;
    }
    Tracker tracker;
    Grey image;
    std::uint32_t body_target; // index of the only target with a body
};

void start(Context &context) {
    if (!(context.library.descriptor().capabilities & ARHOST_TRACKER_CAPABILITY_REPORTS_POSES))
        throw Skip("ARHOST_TRACKER_CAPABILITY_REPORTS_POSES is not declared");
    if (context.body.empty() && context.family.empty())
        throw Failure("it starts with no marker, and no body is named: give --family NAME or --body NAME");
    if (context.body.empty())
        throw Skip("give a body that it knows: --body NAME");
    Started started(context);
}

// Calls `check(number)` after each of up to `frames` frames until it returns true.
template <class Check> void track_frames(Started &started, int frames, Check &&check) {
    for (int number = 0; number < frames && !check(started.tracker.track(started.image), number); ++number)
        std::this_thread::sleep_for(std::chrono::nanoseconds(frame_ns)); // its data may come at this rate
}

void track(Context &context) {
    Started started(context);
    bool reported = false;
    track_frames(started, 60, [&](const auto &, int) { return reported = !started.tracker.poses().empty(); });
    if (!reported)
        throw Failure(fmt::format("it reports no pose of the body '{}' in 60 frames of 1/30 s", context.body));
}

void unknown_body(Context &context) {
    const char *const name = "no such body";
    Tracker tracker(context);
    if (const arhost_status status = tracker.start_with(setup_of(context, name));
        status != ARHOST_STATUS_ERROR_CONFIGURATION)
        throw Failure(fmt::format("with the unknown body '{}', start returned {}; expected CONFIGURATION", name,
                                  status_name(status)));
}

// Returns what is wrong with a covariance, as the end of a sentence; empty if nothing is.
std::string problem_with_covariance(const double (&numbers)[36]) {
    constexpr double tolerance = 1e-9; // relative to the largest variance
    const Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>> covariance(numbers);
    if (!covariance.allFinite())
        return "is not finite";
    if (const double off = (covariance - covariance.transpose()).cwiseAbs().maxCoeff();
        off > tolerance * covariance.cwiseAbs().maxCoeff())
        return fmt::format("is not symmetric: two elements differ by {:.3g}", off);
    if (const double least = covariance.diagonal().minCoeff(); least < 0)
        return fmt::format("has the variance {:.3g}", least);
    // Scaled to variances of 1, because the units differ.
    const Eigen::Matrix<double, 6, 1> scale =
        covariance.diagonal().unaryExpr([](double variance) { return variance > 0 ? 1 / std::sqrt(variance) : 1; });
    const Eigen::Matrix<double, 6, 6> scaled = scale.asDiagonal() * covariance * scale.asDiagonal();
    const double least = Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>>(scaled).eigenvalues().minCoeff();
    if (least < -tolerance)
        return fmt::format("is not positive semidefinite: scaled to variances of 1, an eigenvalue is {:.3g}", least);
    return "";
}

// Returns what is wrong with a pose, as a sentence; empty if nothing is.
std::string problem_with(const arhost_body_pose &pose, const Started &started) {
    if (pose.struct_size != started.tracker.pose_size())
        return fmt::format("struct_size is {}; expected {}, as it was set", pose.struct_size,
                           started.tracker.pose_size());
    if (pose.target != started.body_target)
        return fmt::format("target is {}; the only target with a body is {}", pose.target, started.body_target);
    if (pose.state < ARHOST_TARGET_DETECTED || pose.state > ARHOST_TARGET_LOST)
        return fmt::format("state is {}", pose.state);
    if (pose.state == ARHOST_TARGET_DETECTED && pose.age_frames != 0)
        return fmt::format("age_frames is {} although the body is detected; expected 0", pose.age_frames);
    if (const std::string problem = not_rigid(pose.mt, 1e-9); !problem.empty())
        return "mt " + problem;
    if (const std::string problem = problem_with_covariance(pose.covariance); !problem.empty())
        return "covariance " + problem;
    return "";
}

void pose(Context &context) {
    Started started(context);
    track_frames(started, 10, [&](const auto &, int number) {
        std::set<std::uint32_t> targets;
        for (const arhost_body_pose &one : started.tracker.poses()) {
            if (const std::string problem = problem_with(one, started); !problem.empty())
                throw Failure(fmt::format("in frame {}, a pose's {}", number, problem));
            if (!targets.insert(one.target).second)
                throw Failure(fmt::format("in frame {}, target {} has two poses", number, one.target));
        }
        return false;
    });
}

constexpr const char *gate = "tracker.body-track";
constexpr Test tests[] = {
    {"tracker.body-start", "If REPORTS_POSES is declared, it starts with a body that it knows, and stops.",
     "abi.create", 30s, start},
    {"tracker.body-track", "It reports a pose of the body within 60 frames.", "tracker.body-start", 30s, track},
    {"tracker.body-pose",
     "A body has at most one pose per frame: finite, orthonormal to 1e-9, with a valid state and age, and a "
     "covariance "
     "that is 0 or symmetric and positive semidefinite.",
     gate, 20s, pose},
    {"tracker.unknown-body", "A body that it does not know is rejected with CONFIGURATION.", gate, 20s, unknown_body},
};

} // namespace

std::span<const Test> tracker_body_tests() {
    return tests;
}

} // namespace arhost::conformance
