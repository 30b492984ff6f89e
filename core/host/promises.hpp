// SPDX-License-Identifier: Apache-2.0
//
// What `conform: true` looks at while a component works (docs/conformance.md): promises of the ABI that show on real
// frames, a few lines of each. It reports, and changes nothing; what could harm the host is refused in any case
// (frames.hpp).
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

struct Promise {
    std::uint64_t looked = 0, broken = 0; // frames
    std::string first;                    // one sentence about the first that broke it
};

class Promises {
public:
    // `on_first` is called when a promise is first broken, as in ("tracker.order", "frame 3: …").
    explicit Promises(std::function<void(const std::string &name, const std::string &sentence)> on_first = {})
        : on_first_(std::move(on_first)) {}

    // `problem` is empty where the promise was kept.
    void look(const std::string &name, std::uint64_t frame, const std::string &problem);

    const std::map<std::string, Promise> &all() const { return all_; }

private:
    std::function<void(const std::string &, const std::string &)> on_first_;
    std::map<std::string, Promise> all_;
};

// source.clock: all frames have the same.
// source.capture-time: on the monotonic clock, a frame was captured before now; media time begins at 0 or later.
// source.rate: media time goes on as `Rate` has it, the skipped frames counted.
class SourcePromises {
public:
    struct Rate {
        double fps = 0; // that the source tells; 0: none, or it is live
        bool is_asked =
            false; // by the configuration: each frame is 1/fps behind the one before; a film's own need not be
        bool is_paced = false; // mode live: no faster than the clock, either
    };
    SourcePromises(const Rate &rate, std::int64_t now_ns) : rate_(rate), began_ns_(now_ns) {}
    // `record` is of a frame that has come at `now_ns` of CLOCK_MONOTONIC, and has sequence, clock and time.
    void look(Promises &promises, const arhost_record &record, std::uint32_t skipped, std::int64_t now_ns);

private:
    std::string problem_with_rate(double since_first_s, double since_last_s, std::uint32_t skipped,
                                  std::int64_t now_ns) const;

    Rate rate_;
    std::int64_t began_ns_;
    arhost_clock clock_ = 0; // of all frames; 0: there was none
    double first_s_ = 0, last_s_ = 0;
};

// tracker.order, tracker.numbers, and tracker.pose: corners are as far from where the pose has them as is told.
void look_at_markers(Promises &promises, const arhost_record &record, const arhost_intrinsics &intrinsics,
                     std::span<const arhost_marker_config> markers);

// A number of some of the bytes, others with each frame: who changes them after the hand-over is found out.
std::size_t sample_of(std::span<const std::byte> bytes, std::uint64_t frame);

// raytracer.region: alpha is 0 outside of the region that is told.
// raytracer.place: where alpha is 255 a pinhole camera looks towards a virtual object, while none moves.
class OverlayPromises {
public:
    explicit OverlayPromises(const arhost_scene &scene);
    // `overlay` has the camera's size.
    void look(Promises &promises, std::uint64_t frame, const arhost_camera &camera, const Region &region,
              const ImageView &overlay) const;

private:
    bool knows_place_ = false;              // else opaque pixels may be anywhere
    std::optional<scene::Box> virtual_box_; // world, mm; none: no virtual object
};

} // namespace arhost::host
