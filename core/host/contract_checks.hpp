// SPDX-License-Identifier: Apache-2.0
//
// The contract checks of `conform: true` (docs/conformance.md): samples real frames and reports violations of the ABI
// without any other effect. What could harm the host is rejected even without them (frames.hpp).
#pragma once

#include "compositor/compositor.hpp"
#include "scene/box.hpp"

#include <arhost/frame.h>
#include <arhost/scene.h>
#include <arhost/sink.h>
#include <arhost/tracker.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>

namespace arhost::host {

struct ContractCheck {
    std::uint64_t checked = 0, violations = 0; // frames
    std::string first_violation;               // "frame 3: …"
};

class ContractChecks {
public:
    // Calls `on_first` at the first violation of each check: ("tracker.order", "frame 3: …").
    explicit ContractChecks(std::function<void(const std::string &name, const std::string &violation)> on_first = {})
        : on_first_(std::move(on_first)) {}

    // Counts a frame. `problem` is empty if the frame conforms.
    void add(const std::string &name, std::uint64_t frame, const std::string &problem);

    const std::map<std::string, ContractCheck> &all() const { return all_; }

private:
    std::function<void(const std::string &, const std::string &)> on_first_;
    std::map<std::string, ContractCheck> all_;
};

// source.clock: all frames have the same clock.
// source.capture-time: monotonic capture times are not in the future; media time starts at 0 or later.
// source.rate: media time advances according to `Rate`, including skipped frames.
class SourceChecks {
public:
    struct Rate {
        double fps = 0;             // reported by the source; 0: none, or it is live
        bool is_configured = false; // frames are 1/fps apart; otherwise a film's frames may be unevenly spaced
        bool is_paced = false;      // mode live: no faster than the clock
    };
    SourceChecks(const Rate &rate, std::int64_t now_ns) : rate_(rate), started_ns_(now_ns) {}
    // For a frame received at `now_ns` of CLOCK_MONOTONIC. Uses the record's sequence, clock and time.
    void check(ContractChecks &checks, const arhost_record &record, std::uint32_t skipped, std::int64_t now_ns);

private:
    std::string problem_with_rate(double since_first_s, double since_last_s, std::uint32_t skipped,
                                  std::int64_t now_ns) const;

    Rate rate_;
    std::int64_t started_ns_;
    arhost_clock clock_ = 0; // of the first frame; 0: no frame yet
    double first_s_ = 0, last_s_ = 0;
};

// tracker.order, tracker.numbers and tracker.pose (the pose's reprojection error is as reported).
void check_markers(ContractChecks &checks, const arhost_record &record, const arhost_intrinsics &intrinsics,
                   std::span<const arhost_marker_config> markers);

// Hash of a sample of the bytes, a different one for each frame: detects changes after hand-over.
std::size_t sample_hash(std::span<const std::byte> bytes, std::uint64_t frame);

// raytracer.region: alpha is 0 outside the reported region.
// raytracer.place: alpha is 255 only inside the projected bounds of virtual objects; static scenes and pinholes only.
class OverlayChecks {
public:
    explicit OverlayChecks(const arhost_scene &scene);
    // `overlay` has the camera's size.
    void check(ContractChecks &checks, std::uint64_t frame, const arhost_camera &camera, const Region &region,
               const ImageView &overlay) const;

private:
    bool checks_place_ = false;             // otherwise opaque pixels may be anywhere
    std::optional<scene::Box> virtual_box_; // world, mm; none: no virtual object
};

} // namespace arhost::host
