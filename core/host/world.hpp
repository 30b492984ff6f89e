// SPDX-License-Identifier: Apache-2.0
//
// The pose of the world, which belongs to the first target of the configuration.
#pragma once

#include <arhost/tracker.h>

#include <glm/glm.hpp>

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>

namespace arhost::host {

// While the first target is lost, computes the pose of the world from another target and the relative pose of both
// targets. This relative pose is stored whenever both are detected. Therefore the world does not jump when the first
// target is lost.
class World {
public:
    // Returns the pose of the world in a frame, as arhost_target.mt. `first`: name of the first target.
    // `grace_frames`: number of frames for which a stored relative pose is used after both targets were detected.
    std::optional<std::array<double, 16>> locate(const std::string &first, std::span<const arhost_target> targets,
                                                 std::uint64_t frame, std::uint64_t grace_frames);

private:
    struct Relation {
        glm::dmat4 target_from_world;
        std::uint64_t frame; // the last frame in which both were detected
    };
    std::map<std::string, Relation> relations_; // by name of the target
    std::string substitute_;                    // the target that was used instead in the last frame
};

} // namespace arhost::host
