// @NAME@: a tracker for arhost. Treats the bright pixels as one white square that faces the camera: their centroid
// gives the direction, their area the distance.
#include <arhost-cpp/plugin.hpp>

#include <cmath>
#include <cstring>
#include <optional>

namespace {

struct Patch {
    double x, y, area; // px
};

class @CLASS@ {
public:
    @CLASS@(const arhost::Host &, const arhost::Options &options) : threshold_(options.integer("threshold")) {}

    void start(const arhost_tracker_setup &setup) {
        lens_ = *setup.intrinsics;
        target_ = setup.markers[0]; // the first configured marker; this tracker ignores the others
    }

    void track(const arhost_track_request &request, arhost_tracker_result &result) {
        const auto patch = detect(*request.frame);
        if (!patch)
            return; // no marker in this frame: not an error
        const double half = std::sqrt(patch->area) / 2;
        const double distance = lens_.fx * target_.side_mm / (2 * half);

        result.marker_count = 1;
        arhost_marker &marker = result.markers[0];
        marker.struct_size = sizeof marker;
        marker.id = target_.id;
        std::strcpy(marker.family, "bright");
        marker.state = ARHOST_MARKER_DETECTED;
        for (int i = 0; i < 4; ++i) { // top left, top right, bottom right, bottom left on the upright print
            marker.corners_px[i][0] = patch->x + (i == 1 || i == 2 ? half : -half);
            marker.corners_px[i][1] = patch->y + (i >= 2 ? half : -half);
        }
        // Marker to camera, column-major; camera axes x right, y up, looking along -z; mm. No rotation: frontal view.
        for (int i = 0; i < 16; i += 5)
            marker.mt[i] = 1;
        marker.mt[12] = distance * (patch->x - lens_.cx) / lens_.fx;
        marker.mt[13] = -distance * (patch->y - lens_.cy) / lens_.fy;
        marker.mt[14] = -distance;
    }

private:
    // FILL IN: your detector.
    std::optional<Patch> detect(const arhost_frame &frame) const {
        Patch sum{0, 0, 0};
        for (std::uint32_t row = 0; row < frame.format->height; ++row) {
            const std::uint8_t *grey = frame.grey + std::size_t(row) * frame.format->grey_stride;
            for (std::uint32_t column = 0; column < frame.format->width; ++column)
                if (grey[column] >= threshold_) {
                    sum.x += column;
                    sum.y += row;
                    sum.area += 1;
                }
        }
        if (sum.area < 100)
            return std::nullopt;
        return Patch{sum.x / sum.area, sum.y / sum.area, sum.area};
    }

    std::int64_t threshold_;
    arhost_intrinsics lens_{};
    arhost_marker_config target_{};
};

// arhost validates the configuration against these before it calls the constructor.
constexpr arhost_option_descriptor options[] = {
    arhost::option(ARHOST_OPTION_INTEGER, "threshold", "200", "Minimum grey level of a bright pixel.", 1, 255),
};

constexpr arhost_descriptor descriptor = {
    sizeof(arhost_descriptor),
    ARHOST_KIND_TRACKER,
    "@NAME@", // must equal the file name without ".so"
    "@NAME@",
    "0.1.0",
    "unknown", // FILL IN: your name
    "NONE",    // FILL IN: SPDX identifier, e.g. "Apache-2.0"
    "Tracks a bright patch as the marker.",
    0,
    std::size(options),
    options,
    nullptr, // permissions from the sandbox: arhost/plugin.h
};

} // namespace

ARHOST_TRACKER(@CLASS@, descriptor)
