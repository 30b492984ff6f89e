// SPDX-License-Identifier: Apache-2.0
// All wrong trackers of bodies: the body "head" at a fixed place, with a defect that this library's file name
// selects.
#include "defect.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace {

using namespace arhost;
using namespace arhost::test;

class Bodies {
public:
    Bodies(const Host &, const Options &) {}

    void start(const arhost_tracker_setup &setup) {
        if (has("rejects_bodies"))
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "there is no body");
        for (const arhost_target_config &target : elements(setup.targets, setup.target_count))
            if (!target.body || (target.body != std::string_view("head") && !has("accepts_any_body")))
                throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "there is only the body 'head'");
        target_count_ = setup.target_count;
    }

    void track(const arhost_track_request &request, arhost_tracker_result &result) {
        if (has("reports_nothing"))
            return;
        result.pose_count = has("reports_bodies_twice") ? 2 * target_count_ : target_count_;
        const double angle = 0.1 * static_cast<double>(request.frame->sequence), c = std::cos(angle),
                     s = std::sin(angle);
        for (std::uint32_t target = 0; target < target_count_; ++target)
            report(target, c, s, elements(result.poses, target_count_)[target]);
    }

private:
    static void report(std::uint32_t target, double c, double s, arhost_body_pose &pose) {
        pose.target = has("unknown_target") ? target + 1 : target;
        pose.state = has("no_state") ? 0 : ARHOST_TARGET_DETECTED;
        pose.age_frames = has("age_of_detected") ? 1 : 0;
        const double mt[16] = {c, s, 0, 0, -s, c, 0, 0, 0, 0, 1, 0, 5, 7, -400, 1};
        std::copy_n(mt, 16, pose.mt);
        if (has("nan_pose"))
            pose.mt[12] = std::numeric_limits<double>::quiet_NaN();
        if (has("single_precision"))
            std::for_each_n(pose.mt, 12, [](double &x) { x = static_cast<float>(x); });
        if (has("row_major"))
            for (int row = 0; row < 4; ++row)
                for (int column = 0; column < 4; ++column)
                    pose.mt[4 * row + column] = mt[4 * column + row];
        if (has("mirrored_pose"))
            std::for_each_n(pose.mt + 8, 3, [](double &x) { x = -x; });
        if (has("unset_covariance"))
            return;
        std::fill_n(pose.covariance, 36, 0.0);
        if (has("no_covariance"))
            return;
        for (int i = 0; i < 6; ++i)
            pose.covariance[7 * i] = i < 3 ? 0.25 : 1e-6;
        if (has("asymmetric_covariance"))
            pose.covariance[1] = 0.1;
        if (has("negative_variance"))
            pose.covariance[35] = -1e-6;
        if (has("indefinite_covariance"))
            pose.covariance[1] = pose.covariance[6] = 0.3;
    }

    std::uint32_t target_count_ = 0;
};

constexpr arhost_descriptor descriptor = {sizeof(arhost_descriptor),
                                          ARHOST_KIND_TRACKER,
                                          "org.arhost.test.wrong_body",
                                          "Bodies",
                                          "0.1.0",
                                          "arhost",
                                          "Apache-2.0",
                                          "Reports a body at a fixed place.",
                                          ARHOST_TRACKER_CAPABILITY_REPORTS_POSES,
                                          0,
                                          nullptr,
                                          nullptr};

} // namespace

extern "C" {
extern ARHOST_EXPORT const arhost_entry_point arhost_entry = {
    sizeof arhost_entry, 0, [](const arhost_offer *offer, arhost_answer *answer) {
        return negotiate_as<Bodies>(offer, answer, descriptor, &detail::tracker_functions<Bodies>);
    }};
}
