// SPDX-License-Identifier: Apache-2.0
//
// The common part of source_uvc and source_v4l2: options, the choice of a format, and waiting for pictures.
#pragma once

#include "camera_common/control_options.hpp"
#include "camera_common/frame_size.hpp"
#include "camera_common/jpeg.hpp"
#include "camera_common/silence.hpp"

#include <arhost-cpp/plugin.hpp>

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace arhost {

class CameraSource {
public:
    // The options that set controls.
    static constexpr const char *changeable[] = {"exposure", "gain", "focus", "white_balance", "power_line_frequency",
                                                 "controls", nullptr};

protected:
    static constexpr auto poll_slice = std::chrono::milliseconds(100); // the ABI permits no longer wait

    CameraSource(const Host &host, const Options &options)
        : host_(host), configured_size_{static_cast<std::uint32_t>(options.integer("width")),
                                        static_cast<std::uint32_t>(options.integer("height"))},
          format_option_(options.text("format")), control_values_(given_options(options, changeable)) {
        if ((configured_size_.width == 0) != (configured_size_.height == 0))
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "width, height: set both or neither");
    }

    // Calls `open`. After a restart, the options are known to work, so every failure is temporary: the camera is not
    // connected, not ready, or not accessible until udev has set its permissions. The host then waits for the camera.
    template <class Open> static void start_camera(const arhost_source_setup &setup, const Open &open) {
        try {
            open();
        } catch (const Failure &failure) {
            if (setup.first_sequence == 0 || failure.status() == ARHOST_STATUS_ERROR_CANCELLED)
                throw;
            throw Failure(ARHOST_STATUS_ERROR_DEVICE_LOST, failure.what());
        }
    }

    // Returns whether the option `format` permits the format `name`.
    bool permits(std::string_view name) const { return format_option_ == "auto" || format_option_ == name; }
    std::string permitted_text() const { return format_option_ == "auto" ? "supported format" : format_option_; }

    // Returns the first of `modes` in which the camera reaches the configured rate `fps` (0: not set). If there is
    // none, returns the fastest mode. `max_fps(mode)`: the maximum rate of a mode; 0 if unknown.
    template <class Mode, class MaxFps>
    static const Mode &choose_by_rate(const std::vector<Mode> &modes, double fps, const MaxFps &max_fps) {
        const double wanted = 0.95 * (fps > 0 ? fps : 25);
        const Mode *best = &modes.front();
        double best_fps = -1;
        for (const Mode &mode : modes) {
            const double offered = max_fps(mode);
            if (offered <= 0 || offered >= wanted)
                return mode;
            if (offered > best_fps) {
                best = &mode;
                best_fps = offered;
            }
        }
        return *best;
    }

    // Calls `take`, which waits no longer than `poll_slice`, until it returns a frame. Returns std::nullopt if the
    // host cancels the call. Throws Failure when `silence` exceeds its limit. `camera`: the name of the camera, for
    // messages.
    template <class Take> auto wait_for_frame(Silence &silence, const std::string &camera, const Take &take) {
        for (;;) {
            if (host_.cancelled())
                return decltype(take())();
            if (auto frame = take())
                return frame;
            host_.progress(-1, "waiting for a picture"); // the plugin reports a silent camera itself
            if (silence.exceeds_limit())
                throw Failure(ARHOST_STATUS_ERROR_DEVICE_LOST,
                              camera + " has delivered no intact picture for " +
                                  std::to_string(Silence::limit.count()) + " s" +
                                  (fault_.empty() ? "" : "; the last picture was rejected: " + fault_));
        }
    }

    // Waits for a JPEG picture and sets `format` to the picture's format. Only a picture shows its chroma
    // subsampling. `use_next(silence, use)` waits for a frame and calls `use` with the frame's bytes; it returns
    // false if the host cancels the call. `mode`: the mode to which the camera was set, for messages.
    template <class UseNext>
    void describe_first_picture(arhost_frame_format &format, const FrameSize &size, const std::string &camera,
                                const std::string &mode, const UseNext &use_next) {
        bool is_described = false;
        for (Silence silence; !is_described;) {
            host_.progress(-1, "waiting for the camera's first picture");
            if (!use_next(silence, [&](auto bytes) { is_described = jpeg_.describe(bytes, format); }))
                throw Failure(ARHOST_STATUS_ERROR_CANCELLED, "starting " + camera + " was cancelled");
            if (!is_described)
                fault_ = "it is not a JPEG picture";
        }
        if (const FrameSize sent{format.width, format.height}; sent != size)
            throw Failure(ARHOST_STATUS_ERROR_IO,
                          camera + " was set to " + mode + ", but sends pictures of " + sent.text());
    }

    Host host_;
    FrameSize configured_size_; // 0×0: use the size of the calibration or the camera's default
    std::string format_option_;
    std::vector<std::pair<std::string, std::string>> control_values_; // values of the options that set controls
    bool newest_only_ = false;
    JpegDecoder jpeg_;
    std::string fault_; // fault of the last damaged picture
};

} // namespace arhost
