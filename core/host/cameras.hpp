// SPDX-License-Identifier: Apache-2.0
//
// Determines the position of the ray tracer's camera in each frame, from the targets or from a recording.
#pragma once

#include "camera/coordinates.hpp"
#include "host/frame.hpp"
#include "host/world.hpp"

#include <optional>
#include <string>
#include <utility>

namespace arhost::host {

class Cameras {
public:
    // Settings of the current tracker that concern its targets.
    struct Targets {
        std::string world;              // name of the target whose pose is that of the world
        std::uint64_t grace_frames = 0; // parameter of World::locate
        std::uint64_t held_frames = 0;  // frames without a pose of the world that use the last camera
    };

    // `trajectory`: cameras to use instead of those from the targets; null: none.
    explicit Cameras(const camera::Trajectory *trajectory) : trajectory_(trajectory) {}

    void set_intrinsics(const arhost_intrinsics &intrinsics) { intrinsics_ = intrinsics; }
    void set_coordinates(const camera::Coordinates &coordinates);
    // `is_same_world`: whether the previous and the new targets have the same world coordinates.
    void set_targets(Targets targets, bool is_same_world);

    // Each function sets the frame's camera, unless no camera is known for the frame.
    void set_from_targets(Frame &frame); // must be called for the frames in their order
    void set_from_recording(Frame &frame) const;
    // Also sets the frame's capture time to that of the trajectory, if it has times. The capture time determines the
    // positions of animated objects.
    void set_from_trajectory(Frame &frame) const;
    // Sets the camera again after `set_coordinates`, from the pose that `set_from_targets` found.
    void update(Frame &frame);

private:
    void set_or_hold(Frame &frame);

    const camera::Trajectory *trajectory_;
    arhost_intrinsics intrinsics_{};
    camera::Coordinates coordinates_;
    Targets targets_;
    World world_;
    std::optional<std::pair<std::uint64_t, arhost_camera>> last_; // last camera, with the number of its frame
};

} // namespace arhost::host
