// SPDX-License-Identifier: Apache-2.0
//
// A tracker that reports the poses of bodies. In the frame with the number n, the body with the index i in `targets`
// is at (n, 20·i, −500) mm, rotated by n/100 rad about the camera's y axis.
#include "faults.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

namespace {

using namespace arhost;

class Bodies {
public:
    Bodies(const Host &, const Options &options)
        : faults_(options), known_(options.text("bodies")), lost_from_(options.integer("lost_from")),
          lost_to_(options.integer("lost_to")), lost_target_(options.integer("lost_target")),
          has_covariance_(options.boolean("covariance")) {}

    void start(const arhost_tracker_setup &setup) {
        target_count_ = setup.target_count;
        for (const arhost_target_config &target : elements(setup.targets, setup.target_count)) {
            if (!target.body)
                throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                              std::string("targets: '") + target.name + "' has no 'body'; markers are not supported");
            if (!knows(target.body))
                throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                              std::string("targets: there is no body '") + target.body + "'; known: " + known_);
        }
    }

    void track(const arhost_track_request &request, arhost_tracker_result &result) {
        const std::uint64_t number = request.frame->sequence;
        faults_.at(number);
        const auto signed_number = static_cast<std::int64_t>(number);
        const bool are_lost = signed_number >= lost_from_ && signed_number < lost_to_;
        for (std::uint32_t target = 0; target < target_count_; ++target) {
            const bool is_lost = are_lost && (lost_target_ < 0 || lost_target_ == target);
            if (is_lost && lost_from_ == 0)
                continue; // never seen
            arhost_body_pose &pose = elements(result.poses, target_count_)[result.pose_count++];
            pose.target = target;
            pose.state = is_lost ? ARHOST_TARGET_LOST : ARHOST_TARGET_DETECTED;
            pose.age_frames = is_lost ? static_cast<std::uint32_t>(signed_number - lost_from_ + 1) : 0;
            const double n = static_cast<double>(is_lost ? lost_from_ - 1 : signed_number), c = std::cos(n / 100),
                         s = std::sin(n / 100);
            const double mt[16] = {c, 0, -s, 0, 0, 1, 0, 0, s, 0, c, 0, n, 20.0 * target, -500, 1};
            std::copy_n(mt, 16, pose.mt);
            std::fill_n(pose.covariance, 36, 0.0);
            for (int i = 0; i < 6 && has_covariance_ && !is_lost; ++i)
                pose.covariance[7 * i] = i < 3 ? 0.25 : 1e-6; // (0.5 mm)², (1 mrad)²
        }
    }

private:
    bool knows(const std::string &body) const {
        std::istringstream names(known_);
        for (std::string name; names >> name;)
            if (name == body)
                return true;
        return false;
    }

    test::Faults faults_;
    std::string known_;
    std::int64_t lost_from_, lost_to_, lost_target_;
    bool has_covariance_;
    std::uint32_t target_count_ = 0;
};

constexpr arhost_option_descriptor options[] = {
    option(ARHOST_OPTION_TEXT, "bodies", "head hand", "Names of the bodies that it knows"),
    option(ARHOST_OPTION_INTEGER, "lost_from", "0", "First frame in which the bodies are lost"),
    option(ARHOST_OPTION_INTEGER, "lost_to", "0", "End of that range of frames, exclusive"),
    option(ARHOST_OPTION_INTEGER, "lost_target", "-1", "Index of the only target that is lost then; -1: all"),
    option(ARHOST_OPTION_BOOL, "covariance", "true", "Reports covariances"),
    ARHOST_FAULT_OPTIONS};
constexpr arhost_descriptor descriptor = {sizeof(arhost_descriptor),
                                          ARHOST_KIND_TRACKER,
                                          "org.arhost.test.tracker_body",
                                          "Bodies",
                                          "0.1.0",
                                          "arhost",
                                          "Apache-2.0",
                                          "Reports the poses of bodies, for tests.",
                                          ARHOST_TRACKER_CAPABILITY_REPORTS_POSES,
                                          std::size(options),
                                          options,
                                          nullptr};

} // namespace

ARHOST_TRACKER(Bodies, descriptor)
