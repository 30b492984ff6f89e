// SPDX-License-Identifier: Apache-2.0
//
// The contract checks that `conform: true` enables (docs/conformance.md). They inspect a sample of the run's frames,
// report violations of the ABI, and do not change the run. Independently of these checks, the host always rejects
// values that could harm it (host/frame_validation.hpp).
#pragma once

#include "compositor/compositor.hpp"
#include "scene/box.hpp"

#include <arhost/frame.h>
#include <arhost/scene.h>
#include <arhost/shading/lens.hpp>
#include <arhost/sink.h>
#include <arhost/tracker.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>

namespace arhost::contracts {

struct ContractCheck {
    std::uint64_t checked = 0, violations = 0; // numbers of frames
    std::string first_violation;               // such as "frame 3: …"; "" if there is none
};

class ContractChecks {
public:
    // Calls `on_first` at the first violation of each check, for example with ("tracker.corners", "frame 3: …").
    explicit ContractChecks(std::function<void(const std::string &name, const std::string &violation)> on_first = {})
        : on_first_(std::move(on_first)) {}

    // Records that the check `name` examined a frame. `problem` is "" if the frame conforms.
    void add(const std::string &name, std::uint64_t frame, const std::string &problem);

    const std::map<std::string, ContractCheck> &all() const { return all_; }

private:
    std::function<void(const std::string &, const std::string &)> on_first_;
    std::map<std::string, ContractCheck> all_;
};

// Checks the frames of a source:
// source.clock: all frames have the same clock.
// source.capture-time: capture times of CLOCK_MONOTONIC are not in the future; media times are not negative.
// source.rate: media times increase according to `Rate`; skipped frames count as frames.
class SourceChecks {
public:
    struct Rate {
        double fps = 0;             // reported by the source; 0: the source is live or reports no rate
        bool is_configured = false; // the user set `fps`, so frames are 1/fps apart; otherwise spacing may vary
        bool is_paced = false;      // mode live: media time must not run ahead of the real time
    };
    SourceChecks(const Rate &rate, std::int64_t now_ns) : rate_(rate), started_ns_(now_ns) {}
    // Checks a frame that the host received at `now_ns` of CLOCK_MONOTONIC. Reads only the record's sequence number,
    // clock and capture time.
    void check(ContractChecks &checks, const arhost_record &record, std::uint32_t skipped, std::int64_t now_ns);

private:
    std::string problem_with_rate(double since_first_s, double since_last_s, std::uint32_t skipped,
                                  std::int64_t now_ns) const;

    Rate rate_;
    std::int64_t started_ns_;
    arhost_clock clock_ = 0; // clock of the first frame; 0 before the first frame
    double first_s_ = 0, last_s_ = 0;
};

// Checks a tracker's result:
// tracker.corners: the corners of each observation are clockwise in the image and form a convex quadrilateral.
// tracker.repeats: no observation is reported twice.
// tracker.covariance: covariances are symmetric, and no variance is negative.
void check_tracking(ContractChecks &checks, std::uint64_t frame, std::span<const arhost_target> targets,
                    std::span<const arhost_observation> observations);

// Returns a hash of some of the bytes; `frame` selects which. If two calls for the same frame return different
// values, the buffer was modified after hand-over.
std::size_t sample_hash(std::span<const std::byte> bytes, std::uint64_t frame);

// Checks the images of a ray tracer:
// raytracer.region: virtual objects affect no pixel outside the reported region.
// raytracer.place: alpha is 255 only inside the projected bounding box of the virtual objects, or in a linear image,
// light is added and the video hidden only there. Checked only for static scenes.
// raytracer.light: the numbers of a linear image are finite and not negative, the reserved ones 0.
class OverlayChecks {
public:
    explicit OverlayChecks(const arhost_scene &scene);
    // `overlay` must have the camera's image size.
    void check(ContractChecks &checks, std::uint64_t frame, const arhost_camera &camera, const Region &region,
               const ImageView &overlay);

private:
    bool has_translucent_shadows_ = false;  // straight images: alpha is 255 on virtual objects only
    bool checks_place_ = false;             // whether raytracer.place is checked
    std::optional<shading::Lens> lens_;     // lens of the camera, the same in all frames
    std::optional<scene::Box> virtual_box_; // world coordinates, mm; nullopt if the scene has no virtual object
};

} // namespace arhost::contracts
