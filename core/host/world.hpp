// SPDX-License-Identifier: Apache-2.0
//
// The pose of the world, which belongs to the first target of the configuration.
#pragma once

#include "pose/estimate.hpp"

#include <arhost/tracker.h>

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>

namespace arhost::host {

// While the first target is lost, computes the pose of the world from the other targets and their poses relative to
// the first target. These relative poses are averaged over the frames in which both are detected. Therefore the world
// does not jump when the first target is lost. The order of the targets does not matter.
class World {
public:
    // Returns the pose of the world in a frame, as arhost_target.mt. `first`: name of the first target.
    // `grace_frames`: number of frames for which a stored relative pose is used after both targets were detected.
    std::optional<std::array<double, 16>> locate(const std::string &first, std::span<const arhost_target> targets,
                                                 std::uint64_t frame, std::uint64_t grace_frames);

    // A pose, and the covariance of its errors as in arhost_target.
    struct Estimate {
        pose::Rigid pose; // in the axes of arhost_target.mt
        pose::Matrix6d covariance;
    };

private:
    struct Relation {
        Estimate target_from_world;
        bool is_ambiguous;   // whether one of both targets was ambiguous in all frames
        std::uint64_t frame; // the last frame in which both were detected
    };
    void learn(const arhost_target &first, const arhost_target &target, std::uint64_t frame);

    std::map<std::string, Relation> relations_; // by name of the target
    std::set<std::string> followed_;            // the targets that were used instead in the last frame
};

} // namespace arhost::host
