// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "capture_device.hpp"
#include "driver_clock.hpp"

#include "camera_common/frame_size.hpp"
#include "camera_common/silence.hpp"

#include <arhost-cpp/plugin.hpp>

#include <cstdint>
#include <deque>
#include <optional>
#include <string>

namespace arhost {

// A V4L2 node that delivers depth (Z16) beside a colour camera. Pairs the frames of both by their capture times.
class DepthCamera {
public:
    // Starts capturing in the size of the colour frames. `fps`: rate of the colour camera; 0: unknown.
    DepthCamera(const Host &host, const std::string &path, const FrameSize &size, double fps, double unit_mm);

    // Writes the depth frame that was captured nearest to `colour_ns` (CLOCK_MONOTONIC) to the depth plane of
    // `buffer`. Waits for that frame if necessary. If no frame was captured within about half a frame time, sets all
    // depths to unknown (0) and returns false. Throws Failure if the camera has delivered no frame for 5 s.
    bool read(std::int64_t colour_ns, const arhost_frame_buffer &buffer);

private:
    struct Held { // a buffer of the driver
        Capture capture;
        std::int64_t ns; // capture time
    };
    void dequeue_up_to(std::int64_t colour_ns);
    void release_farther_than_next(std::int64_t colour_ns);
    void wait_for_frame_near(std::int64_t colour_ns);
    bool copy(const Capture &capture, const arhost_frame_buffer &buffer) const;

    Host host_;
    CaptureDevice device_;
    DriverClock clock_;
    double unit_mm_;
    std::uint32_t stride_ = 0;     // bytes per row of the camera's frames
    std::int64_t interval_ns_ = 0; // time from frame to frame
    std::optional<CaptureStream> stream_;
    std::deque<Held> held_;        // in capture order; at most two after `read`
    std::int64_t last_arrival_ns_; // CLOCK_MONOTONIC
    Silence silence_;
};

} // namespace arhost
