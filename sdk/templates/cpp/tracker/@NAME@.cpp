// @NAME@: a tracker for arhost. Treats the bright pixels as one white square that faces the camera: their centroid is
// the centre of the square, and their number is its area. arhost computes the pose from the corners.
#include <arhost-cpp/plugin.hpp>

#include <cmath>

namespace {

class @CLASS@ {
public:
    @CLASS@(const arhost::Host &, const arhost::Options &options) : threshold_(options.integer("threshold")) {}

    void start(const arhost_tracker_setup &setup) {
        marker_ = setup.markers[0]; // the first configured marker; this tracker does not look for others
    }

    // FILL IN: your detector.
    void track(const arhost_track_request &request, arhost::Observations &observations) {
        const arhost_frame &frame = *request.frame;
        double area = 0, x = 0, y = 0;
        for (std::uint32_t row = 0; row < frame.format->height; ++row) {
            const std::uint8_t *grey = frame.grey + std::size_t(row) * frame.format->grey_stride;
            for (std::uint32_t column = 0; column < frame.format->width; ++column)
                if (grey[column] >= threshold_) {
                    area += 1;
                    x += column;
                    y += row;
                }
        }
        if (area < 100)
            return; // no marker in this frame: not an error

        arhost_observation seen{};
        seen.id = marker_.id;
        seen.family = marker_.family;
        const double half = std::sqrt(area) / 2;
        for (int i = 0; i < 4; ++i) { // top left, top right, bottom right, bottom left on the upright print
            seen.corners_px[i][0] = x / area + (i == 1 || i == 2 ? half : -half);
            seen.corners_px[i][1] = y / area + (i >= 2 ? half : -half);
        }
        observations.add(seen);
    }

private:
    std::int64_t threshold_;
    arhost_marker_config marker_{};
};

// arhost validates the configuration against these before it calls the constructor.
constexpr arhost_option_descriptor options[] = {
    arhost::option(ARHOST_OPTION_INTEGER, "threshold", "200", "Minimum grey level of a bright pixel.", 1, 255),
};

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_TRACKER,
    .id = "org.example.@NAME@", // FILL IN: your domain in reverse order; ends with the file name
    .name = "@NAME@",
    .version = "0.1.0",
    .vendor = "unknown", // FILL IN: your name
    .licence = "NONE",   // FILL IN: SPDX identifier, e.g. "Apache-2.0"
    .description = "Detects a bright patch as the marker.",
    .capabilities = 0,
    .option_count = std::size(options),
    .options = options,
    .needs = nullptr, // permissions from the sandbox: arhost/plugin.h
};

} // namespace

ARHOST_TRACKER(@CLASS@, descriptor)
