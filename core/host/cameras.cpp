// SPDX-License-Identifier: Apache-2.0
#include "host/cameras.hpp"

#include "camera/mapping.hpp"

namespace arhost::host {

void Cameras::set_coordinates(const camera::Coordinates &coordinates) {
    coordinates_ = coordinates;
    last_.reset();
}

void Cameras::set_targets(Targets targets, bool is_same_world) {
    targets_ = std::move(targets);
    if (is_same_world)
        return;
    world_ = World();
    last_.reset();
}

void Cameras::set_from_targets(Frame &frame) {
    frame.world = world_.locate(targets_.world, frame.targets, frame.record.sequence, targets_.grace_frames);
    if (!trajectory_)
        set_or_hold(frame);
}

void Cameras::update(Frame &frame) {
    frame.record.has_camera = 0;
    set_or_hold(frame);
}

void Cameras::set_or_hold(Frame &frame) {
    const std::uint64_t sequence = frame.record.sequence;
    if (frame.world)
        if (const auto camera = camera::camera_from_marker(*frame.world, coordinates_, intrinsics_))
            last_ = {sequence, *camera};
    if (!last_ || sequence - last_->first > targets_.held_frames)
        return;
    frame.held = last_->first != sequence;
    frame.record.camera = last_->second;
    frame.record.has_camera = 1;
}

void Cameras::set_from_recording(Frame &frame) const {
    if (trajectory_ || !frame.recorded->view)
        return;
    frame.held = frame.recorded->overlay == ARHOST_OVERLAY_HELD;
    frame.record.camera = camera::camera_of(*frame.recorded->view, intrinsics_);
    frame.record.has_camera = 1;
}

void Cameras::set_from_trajectory(Frame &frame) const {
    const camera::TrajectoryFrame *recorded = trajectory_->at_or_after(frame.record.sequence);
    if (!recorded || recorded->frame != frame.record.sequence) // the recorded run has dropped this frame
        return;
    if (trajectory_->clock) {
        frame.record.clock = *trajectory_->clock;
        frame.record.capture_ns = recorded->capture_ns;
    }
    if (recorded->view) {
        frame.record.camera = camera::camera_of(*recorded->view, intrinsics_);
        frame.record.has_camera = 1;
    }
}

} // namespace arhost::host
