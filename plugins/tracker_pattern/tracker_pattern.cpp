// SPDX-License-Identifier: Apache-2.0
//
// tracker_pattern: detects the square patterns of ARToolKit.
#include "pattern.hpp"
#include "squares.hpp"

#include <fiducial_common/edge_refinement.hpp>
#include <fiducial_common/lens.hpp>
#include <fiducial_common/search_regions.hpp>

#include <arhost-cpp/plugin.hpp>

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>

namespace tracker_pattern {
namespace {

using arhost::Failure;
using arhost::fiducial::Corners;

constexpr arhost_option_descriptor options[] = {
    arhost::option(
        ARHOST_OPTION_REAL, "min_correlation", "0.6",
        "Smallest correlation of a print with its pattern, of at most 1. ARToolKit's confidence is similar.", 0, 1),
    arhost::option(ARHOST_OPTION_REAL, "min_side_px", "12", "Shortest side of a square in px.", 8, 1000),
};

constexpr arhost_descriptor descriptor = {
    sizeof(arhost_descriptor),
    ARHOST_KIND_TRACKER,
    "tracker_pattern",
    "ARToolKit patterns",
    "0.1.0",
    "arhost",
    "Apache-2.0",
    "Detects the square patterns of ARToolKit.",
    0,
    std::size(options),
    options,
    nullptr,
};

class PatternTracker {
public:
    PatternTracker(const arhost::Host &, const arhost::Options &options) { set(options); }

    static constexpr const char *changeable[] = {"min_correlation", "min_side_px", nullptr};
    void set(const arhost::Options &changed) {
        if (changed.contains("min_correlation"))
            min_correlation_ = changed.real("min_correlation");
        if (changed.contains("min_side_px"))
            min_side_px_ = changed.real("min_side_px");
    }

    void start(const arhost_tracker_setup &setup) {
        stop();
        for (std::uint32_t i = 0; i < setup.family_count; ++i)
            if (std::strcmp(setup.families[i], "pattern") != 0)
                throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                              std::string("unknown family '") + setup.families[i] +
                                  "': tracker_pattern finds targets with a 'pattern'; tracker_apriltag and "
                                  "tracker_aruco have families of markers");
        for (const arhost_marker_config &marker : arhost::elements(setup.markers, setup.marker_count)) {
            if (!marker.file)
                throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "a marker of the family 'pattern' has no file");
            marked_.push_back({marker.id, marker.family, marker.pattern_ratio, Pattern(marker.file)});
        }
        lens_.emplace(*setup.intrinsics);
        regions_.emplace(setup, [](const std::string &) { return 0.1; });
    }

    void track(const arhost_track_request &request, arhost::Observations &observations) const {
        const arhost_frame &frame = *request.frame;
        const cv::Mat grey(static_cast<int>(frame.format->height), static_cast<int>(frame.format->width), CV_8UC1,
                           const_cast<std::uint8_t *>(frame.grey), frame.format->grey_stride);
        std::vector<arhost_observation> seen;
        for (const cv::Rect &region : regions_->of(request, {}))
            observe(grey, region, seen);
        if (regions_->miss_a_target(request, seen)) {
            seen.clear();
            observe(grey, cv::Rect({0, 0}, grey.size()), seen);
        }
        arhost::fiducial::report(std::move(seen), observations);
    }

    void stop() { marked_.clear(); }

private:
    // A pattern that a target has.
    struct Marked {
        std::int32_t id;
        std::uint32_t family;
        double ratio; // of the side of the picture to that of the square
        Pattern pattern;
    };

    // Adds the patterns in a region of the frame to `seen`.
    void observe(const cv::Mat &grey, const cv::Rect &region, std::vector<arhost_observation> &seen) const {
        for (Corners rough_px : find_squares(grey(region), min_side_px_)) {
            for (cv::Point2d &corner : rough_px)
                corner += cv::Point2d(region.tl());
            const Marked *best = nullptr;
            Pattern::Match match{min_correlation_, 0};
            for (const Marked &marked : marked_) {
                const Samples samples = normalized(interior(grey, rough_px, marked.ratio, marked.pattern.side()));
                if (samples.empty())
                    continue;
                if (const Pattern::Match found = marked.pattern.match(samples);
                    found.correlation > match.correlation) {
                    match = found;
                    best = &marked;
                }
            }
            if (!best)
                continue;
            Corners corners_px = rough_px;
            // The search for an edge must not reach the picture inside the border.
            const int cells = static_cast<int>(std::ceil(2 / (1 - best->ratio)));
            corners_px = arhost::fiducial::refine_edges(grey, corners_px, *lens_, cells).value_or(corners_px);
            // A print that is rotated clockwise begins with a later corner.
            std::rotate(corners_px.begin(), corners_px.begin() + match.quarter_turns, corners_px.end());
            arhost_observation &one = seen.emplace_back();
            one.id = best->id;
            one.family = best->family;
            for (std::size_t i = 0; i < 4; ++i) {
                one.corners_px[i][0] = corners_px[i].x;
                one.corners_px[i][1] = corners_px[i].y;
            }
            one.decision_margin = 100 * match.correlation;
        }
    }

    // The mean grey levels of the picture within a square.
    static Samples interior(const cv::Mat &grey, const Corners &corners_px, double ratio, int side) {
        constexpr int oversampling = 4;
        const int size = side * oversampling;
        const auto margin = static_cast<float>(size * (1 / ratio - 1) / 2);
        const float first = -margin - 0.5F, last = static_cast<float>(size) + margin - 0.5F;
        const cv::Point2f square[] = {{first, first}, {last, first}, {last, last}, {first, last}};
        cv::Point2f corners[4];
        std::ranges::copy(corners_px, corners);
        cv::Mat unwarped, samples;
        cv::warpPerspective(grey, unwarped, cv::getPerspectiveTransform(corners, square), {size, size},
                            cv::INTER_LINEAR, cv::BORDER_REPLICATE);
        cv::resize(unwarped, samples, {side, side}, 0, 0, cv::INTER_AREA);
        samples.convertTo(samples, CV_32F);
        return samples;
    }

    double min_correlation_ = 0.6, min_side_px_ = 12;
    std::optional<arhost::fiducial::Lens> lens_;
    std::optional<arhost::fiducial::SearchRegions> regions_;
    std::vector<Marked> marked_;
};

} // namespace
} // namespace tracker_pattern

using tracker_pattern::PatternTracker;
ARHOST_TRACKER(PatternTracker, tracker_pattern::descriptor)
