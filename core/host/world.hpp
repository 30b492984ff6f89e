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

// While the first target is lost, the pose of the world is computed from another target and the relative pose of
// both, which is stored whenever both are detected. Therefore the world does not jump when the target changes.
class World {
public:
    // Returns the pose of the world in a frame, as arhost_target.mt. `first`: name of the first target.
    // `grace_frames`: for how long the relation of a target is trusted after both were detected.
    std::optional<std::array<double, 16>> locate(const std::string &first, std::span<const arhost_target> targets,
                                                 std::uint64_t frame, std::uint64_t grace_frames);

private:
    struct Relation {
        glm::dmat4 target_from_world;
        std::uint64_t frame; // in which both were detected
    };
    std::map<std::string, Relation> relations_; // by name of the target
    std::string substitute_;                    // the target that was used instead in the last frame
};

} // namespace arhost::host
