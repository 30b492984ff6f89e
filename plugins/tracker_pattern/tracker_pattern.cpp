// SPDX-License-Identifier: Apache-2.0
//
// tracker_pattern: detects the square patterns of ARToolKit.
#include "matrix_reader.hpp"
#include "pattern.hpp"
#include "squares.hpp"

#include <fiducial/corner_refinement.hpp>
#include <fiducial/marker_search.hpp>

#include <arhost-cpp/plugin.hpp>

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <tuple>

namespace tracker_pattern {
namespace {

namespace fiducial = arhost::fiducial;
using arhost::Failure;
using arhost::fiducial::Corners;

constexpr arhost_option_descriptor options[] = {
    arhost::option(
        ARHOST_OPTION_REAL, "min_correlation", "0.6",
        "Smallest correlation of a print with its pattern, of at most 1. ARToolKit's confidence is similar.", 0, 1),
    arhost::option(ARHOST_OPTION_REAL, "min_side_px", "12", "Shortest side of a square in px.", 8, 1000),
};

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_TRACKER,
    .id = "org.arhost.tracker_pattern",
    .name = "ARToolKit patterns",
    .version = "0.1.0",
    .vendor = "arhost",
    .licence = "Apache-2.0",
    .description = "Detects the square patterns and matrix codes of ARToolKit.",
    .capabilities = 0,
    .option_count = std::size(options),
    .options = options,
    .needs = nullptr,
};

class PatternTracker {
public:
    PatternTracker(const arhost::Host &host, const arhost::Options &options) : host_(host) { set(options); }

    static constexpr const char *changeable[] = {"min_correlation", "min_side_px", nullptr};
    void set(const arhost::Options &changed) {
        fiducial::take(changed, "min_correlation", min_correlation_);
        fiducial::take(changed, "min_side_px", min_side_px_);
    }

    void start(const arhost_tracker_setup &setup) {
        stop();
        fiducial::families_of(setup, id_count);
        for (const arhost_marker_config &marker : arhost::elements(setup.markers, setup.marker_count)) {
            const char *const family = setup.families[marker.family];
            if (const auto *type = fiducial::find_matrix_family(family)) {
                auto reader = std::ranges::find(matrix_readers_, type->side, &MatrixReader::cells);
                if (reader == matrix_readers_.end())
                    reader = matrix_readers_.insert(reader, MatrixReader(type->side));
                reader->add(*type, marker.id, marker.family);
                listed_families_.insert(type->name);
            } else if (marker.file) {
                const Pattern pattern(marker.file);
                patterns_[{marker.pattern_ratio, pattern.side()}].push_back({marker.id, marker.family, pattern});
            } else {
                throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "a marker of the family 'pattern' has no file");
            }
        }
        search_.emplace(
            host_, setup,
            [](const std::string &) {
                return fiducial::FamilyTraits{0.1, 0};
            },
            [this](const cv::Mat &grey) { return other_markers(grey); });
    }

    void track(const arhost_track_request &request, arhost::Observations &observations) {
        const fiducial::Pass pass{.family = nullptr, .detect = [&](const cv::Rect &region, auto &seen) {
                                      observe(*request.frame, region, seen);
                                  }};
        search_->track(request, observations, {}, {&pass, 1});
    }

    void stop() {
        if (search_)
            search_->finish();
        search_.reset();
        patterns_.clear();
        matrix_readers_.clear();
        listed_families_.clear();
    }

private:
    struct Marked {
        std::int32_t id;
        std::uint32_t family;
        Pattern pattern;
    };
    // The sampling of a square's interior that all patterns of the same size share.
    struct Sampling {
        double ratio; // side of the sampled area relative to the side of the square
        int side;     // number of samples
        bool operator<(const Sampling &other) const {
            return std::tie(ratio, side) < std::tie(other.ratio, other.side);
        }
    };

    static int id_count(const std::string &family) {
        if (family == "pattern")
            return std::numeric_limits<int>::max();
        if (const auto *type = fiducial::find_matrix_family(family))
            return type->id_count;
        std::string names;
        for (const auto &type : fiducial::matrix_families())
            names += std::string(names.empty() ? "" : ", ") + type.name;
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      "unknown family '" + family + "': tracker_pattern finds targets with a 'pattern', and has " +
                          names + "; tracker_apriltag and tracker_aruco have other families");
    }

    // The marker that is most similar to a square.
    struct Best {
        std::int32_t id = 0;
        std::uint32_t family = 0, wrong_cells = 0;
        double correlation = 0, ratio = 0;
        int quarter_turns = 0;
        double false_positive_rate = 0; // negligible for a pattern
    };
    Best recognised(const cv::Mat &grey, const Corners &corners_px) const {
        Best best;
        const auto consider = [&](const auto &marker, const auto &match, double ratio, std::uint32_t wrong_cells,
                                  double false_positive_rate) {
            if (match.correlation > best.correlation)
                best = {marker.id, marker.family,       wrong_cells,        match.correlation,
                        ratio,     match.quarter_turns, false_positive_rate};
        };
        for (const auto &[sampling, patterns] : patterns_) {
            const Samples samples = normalized(interior(grey, corners_px, sampling.ratio, sampling.side));
            if (samples.empty())
                continue;
            for (const Marked &marked : patterns)
                if (const Pattern::Match match = marked.pattern.match(samples); match.correlation > min_correlation_)
                    consider(marked, match, sampling.ratio, 0, 0);
        }
        for (const MatrixReader &reader : matrix_readers_)
            if (const auto match = reader.match(interior(grey, corners_px, reader.ratio(), reader.side())))
                consider(*match, *match, fiducial::matrix_ratio, match->wrong_cells,
                         fiducial::matrix_false_positive_rate(reader.cells(), match->wrong_cells));
        return best;
    }

    // Adds the markers in a region of the frame to `seen`.
    void observe(const arhost_frame &frame, const cv::Rect &region, fiducial::Seen &seen) const {
        const cv::Mat grey = fiducial::grey_of(frame);
        for (Corners corners_px : find_squares(grey(region), min_side_px_)) {
            ++seen.candidates;
            for (cv::Point2d &corner : corners_px)
                corner += cv::Point2d(region.tl());
            const Best best = recognised(grey, corners_px);
            if (best.correlation <= 0)
                continue;
            // The search for an edge must not reach the picture inside the border.
            const int cells = static_cast<int>(std::ceil(2 / (1 - best.ratio)));
            const auto measured =
                fiducial::refine_edges(grey, frame.format->transfer, corners_px, search_->lens(), cells);
            // Without straight edges, a corner may be that of an object that hides the print's corner.
            constexpr double min_correlation_without_edges = 0.9;
            if (!measured && best.correlation < min_correlation_without_edges)
                continue;
            fiducial::MeasuredCorners corners = measured.value_or(fiducial::MeasuredCorners{corners_px});
            // If the marker is rotated clockwise in the image, its first corner comes later in the list.
            std::rotate(corners.corners_px.begin(), corners.corners_px.begin() + best.quarter_turns,
                        corners.corners_px.end());
            seen.markers.push_back(fiducial::observation_of(
                best.id, best.family, corners, {best.wrong_cells, 100 * best.correlation, best.false_positive_rate}));
        }
    }

    // Squares of other markers may match matrix codes, because these have few or no check bits.
    fiducial::OtherMarkers::Markers other_markers(const cv::Mat &grey) const {
        auto markers = fiducial::markers_of_other_families(grey, {});
        if (!markers.empty() || matrix_readers_.empty())
            return markers;
        for (const Corners &corners_px : find_squares(grey, min_side_px_))
            if (recognised(grey, corners_px).correlation <= 0)
                if (const auto code = any_code(grey, corners_px))
                    markers[code->type->name].insert(code->id);
        return markers;
    }

    // Returns the code of any family that is most similar to a square. If several families have this code, prefers a
    // listed code, then the family with the fewest codes.
    std::optional<MatrixReader::AnyCode> any_code(const cv::Mat &grey, const Corners &corners_px) const {
        const auto rank = [&](const MatrixReader::AnyCode &code) {
            return std::tuple(code.correlation, listed_families_.contains(code.type->name), -code.type->id_count);
        };
        std::optional<MatrixReader::AnyCode> best;
        for (const int cells : {3, 4, 5}) {
            const MatrixReader reader(cells);
            for (const auto &code : reader.codes(interior(grey, corners_px, reader.ratio(), reader.side())))
                if (!best || rank(code) > rank(*best))
                    best = code;
        }
        return best;
    }

    // Returns the mean grey levels of the picture inside a square.
    static Samples interior(const cv::Mat &grey, const Corners &corners_px, double ratio, int side) {
        constexpr int oversampling = 4;
        const int size = side * oversampling;
        cv::Mat samples;
        cv::resize(fiducial::unwarped(grey, corners_px, size, size * (1 / ratio - 1) / 2), samples, {side, side}, 0,
                   0, cv::INTER_AREA);
        samples.convertTo(samples, CV_32F);
        return samples;
    }

    arhost::Host host_;
    double min_correlation_ = 0.6, min_side_px_ = 12;
    std::optional<fiducial::MarkerSearch> search_;
    std::map<Sampling, std::vector<Marked>> patterns_;
    std::vector<MatrixReader> matrix_readers_;
    std::set<std::string> listed_families_; // listed families of matrix codes
};

} // namespace
} // namespace tracker_pattern

using tracker_pattern::PatternTracker;
ARHOST_TRACKER(PatternTracker, tracker_pattern::descriptor)
