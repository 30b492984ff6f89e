// SPDX-License-Identifier: Apache-2.0
//
// tracker_image: detects planar pictures, such as posters and book covers.
#include "picture.hpp"

#include <fiducial/observations.hpp>

#include <arhost-cpp/plugin.hpp>

#include <opencv2/core/utility.hpp>

#include <algorithm>
#include <cstring>
#include <optional>
#include <vector>

namespace tracker_image {
namespace {

namespace fiducial = arhost::fiducial;
using arhost::Failure;

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_TRACKER,
    .id = "org.arhost.tracker_image",
    .name = "Pictures",
    .version = "0.1.0",
    .vendor = "arhost",
    .licence = "Apache-2.0",
    .description = "Detects plane pictures, such as posters and covers of books.",
    .capabilities = 0,
    .option_count = 0,
    .options = nullptr,
    .needs = nullptr,
};

class ImageTracker {
public:
    ImageTracker(const arhost::Host &, const arhost::Options &) { cv::setNumThreads(1); }

    void start(const arhost_tracker_setup &setup) {
        stop();
        for (std::uint32_t i = 0; i < setup.family_count; ++i)
            if (std::strcmp(setup.families[i], "image") != 0)
                throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                              std::string("unknown family '") + setup.families[i] +
                                  "': tracker_image finds targets with an 'image'; tracker_apriltag and "
                                  "tracker_aruco have families of markers");
        for (const arhost_marker_config &marker : arhost::elements(setup.markers, setup.marker_count)) {
            if (!marker.file)
                throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "a marker of the family 'image' has no file");
            shown_.push_back({marker.id, marker.family, Picture(marker.file)});
        }
        camera_.emplace(*setup.intrinsics);
    }

    double aspect(std::uint32_t marker) const { return shown_.at(marker).picture.aspect(); }

    // Aligns expected pictures at their expected places. Only other pictures need the features of the frame.
    void track(const arhost_track_request &request, arhost::Observations &observations) const {
        const cv::Mat grey = fiducial::grey_of(*request.frame);
        std::vector<bool> is_found(shown_.size()), is_missed(shown_.size());
        std::vector<arhost_observation> seen;
        for (const arhost_expected_marker &expected : arhost::elements(request.expected, request.expected_count)) {
            std::vector<cv::Point2d> corners;
            for (const auto &corner : expected.corners_px)
                corners.emplace_back(corner[0], corner[1]);
            const Shown &shown = shown_.at(expected.marker);
            const auto place = shown.picture.align(grey, *camera_, corners);
            is_found[expected.marker] = place.has_value();
            is_missed[expected.marker] = !place;
            if (place)
                seen.push_back(observation_of(shown, *place));
        }
        const bool searches_all = request.search_everywhere != 0;
        if (searches_all || std::ranges::count(is_missed, true) > 0) {
            const Features features = features_of(grey);
            for (std::size_t i = 0; i < shown_.size(); ++i)
                if (!is_found[i] && (searches_all || is_missed[i]))
                    for (const Picture::Place &place : shown_[i].picture.find(grey, *camera_, features))
                        seen.push_back(observation_of(shown_[i], place));
        }
        fiducial::report(std::move(seen), observations);
    }

    void stop() {
        shown_.clear();
        camera_.reset();
    }

private:
    // A picture of a target.
    struct Shown {
        std::int32_t id;
        std::uint32_t family;
        Picture picture;
    };

    static arhost_observation observation_of(const Shown &shown, const Picture::Place &place) {
        const std::vector<cv::Point2d> &corners = place.corners_px;
        return fiducial::observation_of(shown.id, shown.family, {{corners[0], corners[1], corners[2], corners[3]}},
                                        {0, 100 * place.inlier_share, 0});
    }

    std::optional<Camera> camera_;
    std::vector<Shown> shown_; // in the order of the markers in the setup
};

} // namespace
} // namespace tracker_image

using tracker_image::ImageTracker;
ARHOST_TRACKER(ImageTracker, tracker_image::descriptor)
