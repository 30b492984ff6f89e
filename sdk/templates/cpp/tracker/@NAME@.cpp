// @NAME@: a tracker for arhost. It takes the brightest patch of the image for a white square that faces the camera:
// its middle gives the direction, its area the distance.
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
        wanted_ = setup.markers[0]; // the first that the configuration lists: the only one that is looked for
    }

    void track(const arhost_frame &frame, arhost_tracker_result &result) {
        const auto patch = detect(frame);
        if (!patch)
            return; // nothing found is no error: the video goes on without an overlay
        const double half = std::sqrt(patch->area) / 2;
        const double distance = lens_.fx * wanted_.side_mm / (2 * half);

        result.marker_count = 1;
        arhost_marker &marker = result.markers[0];
        marker.struct_size = sizeof marker;
        marker.id = wanted_.id;
        std::strcpy(marker.family, "bright");
        marker.state = ARHOST_MARKER_DETECTED;
        for (int i = 0; i < 4; ++i) { // top left, top right, bottom right, bottom left of the upright print
            marker.corners_px[i][0] = patch->x + (i == 1 || i == 2 ? half : -half);
            marker.corners_px[i][1] = patch->y + (i >= 2 ? half : -half);
        }
        // Marker to camera, column-major, x right, y up, looking along -z, in mm. Not turned: it faces the camera.
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
    arhost_marker_config wanted_{};
};

// arhost checks the configuration against these before the constructor sees a value.
constexpr arhost_option_descriptor options[] = {
    arhost::option(ARHOST_OPTION_INTEGER, "threshold", "200", "Grey level from which on a pixel counts as bright.", 1, 255),
};

constexpr arhost_descriptor descriptor = {
    sizeof(arhost_descriptor),
    ARHOST_KIND_TRACKER,
    "@NAME@", // the file's name
    "@NAME@",
    "0.1.0",
    "unknown", // FILL IN: you
    "NONE", // FILL IN: the licence (SPDX), "Apache-2.0"
    "Takes the brightest patch for the marker.",
    0,
    std::size(options),
    options,
    nullptr, // what of the machine it needs: arhost/plugin.h
};

} // namespace

ARHOST_TRACKER(@CLASS@, descriptor)
