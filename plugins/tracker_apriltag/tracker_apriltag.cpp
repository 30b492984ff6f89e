// SPDX-License-Identifier: Apache-2.0
//
// tracker_apriltag: detects AprilTags with the AprilTag library, version 3.
#include <fiducial/april_tags.hpp>
#include <fiducial/frame_refinement.hpp>
#include <fiducial/marker_search.hpp>

#include <arhost-cpp/plugin.hpp>

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace {

namespace apriltag = arhost::apriltag;
namespace fiducial = arhost::fiducial;
using arhost::Failure;
using arhost::apriltag::family_types;
using arhost::apriltag::FamilyType;
using arhost::fiducial::Family;
using arhost::fiducial::set_corners;
using arhost::fiducial::take;

constexpr const char *refinements[] = {"edges", "none", nullptr};

constexpr arhost_option_descriptor options[] = {
    arhost::option(
        ARHOST_OPTION_TEXT, "corner_refinement", "edges",
        "Corner refinement: edges (arhost fits lines to the edges), or none (corners as the library reports them).",
        0, 0, refinements),
    arhost::option(
        ARHOST_OPTION_REAL, "quad_decimate", "1",
        "Tags are detected in an image downscaled by this factor: 1, 1.5 or an integer. A larger factor is "
        "faster but misses small tags.",
        1, 8),
    arhost::option(ARHOST_OPTION_REAL, "quad_sigma", "0",
                   "Standard deviation in px of a blur before detection (0.8 helps in noisy images); negative values "
                   "sharpen.",
                   -4, 4),
    arhost::option(ARHOST_OPTION_BOOL, "refine_edges", "true",
                   "Whether the library refines the edges before it decodes the bits."),
    arhost::option(ARHOST_OPTION_REAL, "decode_sharpening", "0.25",
                   "Sharpening before the bits are decoded; helps small tags.", 0, 10),
    arhost::option(
        ARHOST_OPTION_INTEGER, "max_hamming", "-1",
        "Maximum number of bit errors to correct in listed tags; -1: 0 for families of up to 21 bits, 1 for "
        "tag25h9, otherwise 2.",
        -1, 2),
    arhost::option(ARHOST_OPTION_REAL, "min_decision_margin", "0",
                   "Minimum bit contrast of a tag, in grey levels from 0 to 255; tags of lower contrast are ignored.",
                   0, 255),
    arhost::option(
        ARHOST_OPTION_BOOL, "closer_look", "true",
        "If a target is not found, searches again, at twice the resolution or with sharper bits and more "
        "candidates for corners: where the target is expected, otherwise by turns in a part of the frame. "
        "Finds more of the strongly tilted, blurred, small and partly hidden tags of families with more than "
        "25 bits."),
    arhost::option(ARHOST_OPTION_INTEGER, "threads", "1",
                   "Number of detector threads; it does not affect the result.", 1, 64),
};

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_TRACKER,
    .id = "org.arhost.tracker_apriltag",
    .name = "AprilTag tracker",
    .version = "0.1.0",
    .vendor = "arhost",
    .licence = "Apache-2.0",
    .description = "Detects AprilTags with the AprilTag library.",
    .capabilities = 0,
    .option_count = std::size(options),
    .options = options,
    .needs = nullptr,
};

// Either the listed tags of a family or its other tags. The other tags are detected only if all their bits are
// correct: the decoding table has an entry for each tag and each combination of corrected bits, so for larger
// families it would need gigabytes.
struct Detectable {
    const Family &family;
    bool is_listed;
    std::unique_ptr<apriltag::PartOfFamily> part; // not empty

    // `configured`: the configured value; −1: the family's default.
    int max_hamming(int configured) const {
        return !is_listed ? 0 : configured < 0 ? part->type().default_max_hamming : configured;
    }
};

const FamilyType &family_type(const std::string &name) {
    std::string names;
    for (const FamilyType &type : family_types) {
        if (name == type.name)
            return type;
        names += std::string(names.empty() ? "" : ", ") + type.name;
    }
    fiducial::reject_prints_without_ids(name, "tracker_apriltag");
    throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                  "unknown family '" + name + "': tracker_apriltag has " + names +
                      (name.starts_with("DICT_") ? "; tracker_aruco has OpenCV's dictionaries" : ""));
}

using WholeFamily = std::unique_ptr<apriltag_family_t, void (*)(apriltag_family_t *)>;

WholeFamily whole_family(const std::string &name) {
    const FamilyType &type = family_type(name);
    return {type.create(), type.destroy};
}

fiducial::FamilyTraits traits_of(const std::string &name) {
    const WholeFamily family = whole_family(name);
    // The margin of the tag contains the bits outside the border, or is white.
    return {(family->total_width - family->width_at_border) / 2.0 / family->width_at_border,
            static_cast<int>(family->nbits)};
}

// The parameters of a search: the normal look or a closer look.
struct Look {
    int scale = 1;
    double min_sharpening = 0; // sharpening of the bits; the decision margin increases with it
    int max_maxima = 10; // qtp.max_nmaxima: number of places on an outline that are tried as corners of a square
};
// If an object hides a corner, the places where its outline crosses the square look like corners, too. `sharpened`
// therefore tries more places.
constexpr Look enlarged{2}, sharpened{1, 2, 20};
constexpr double max_part = 1 / 8.0; // of the frame, that each of them searches at expected places

class AprilTagTracker {
public:
    AprilTagTracker(const arhost::Host &host, const arhost::Options &options)
        : host_(host), threads_(static_cast<int>(options.integer("threads"))) {
        set(options);
    }

    static constexpr const char *changeable[] = {"corner_refinement",   "quad_decimate",     "quad_sigma",
                                                 "refine_edges",        "decode_sharpening", "max_hamming",
                                                 "min_decision_margin", "closer_look",       nullptr};
    // Sets the options that `changed` contains.
    void set(const arhost::Options &changed) {
        double decimate = decimate_;
        take(changed, "quad_decimate", decimate);
        // For other factors, the library would decimate by the integer part, but scale the corners by the full
        // factor.
        if (decimate != 1.5 && decimate != std::floor(decimate))
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "quad_decimate: must be 1, 1.5 or an integer");
        decimate_ = decimate;
        take(changed, "quad_sigma", sigma_);
        take(changed, "decode_sharpening", sharpening_);
        take(changed, "min_decision_margin", min_margin_);
        take(changed, "refine_edges", refine_edges_);
        take(changed, "closer_look", looks_closer_);
        take(changed, "max_hamming", max_hamming_);
        if (changed.contains("corner_refinement"))
            fit_edges_ = changed.text("corner_refinement") == "edges";
        if (detector_)
            configure_detector();
    }

    void start(const arhost_tracker_setup &setup) {
        stop();
        families_ = fiducial::families_of(
            setup, [](const std::string &name) { return static_cast<int>(whole_family(name)->ncodes); });
        search_.emplace(host_, setup, traits_of,
                        [&](const cv::Mat &grey) { return fiducial::markers_of_other_families(grey, families_); });
        for (const Family &family : families_)
            for (const bool is_listed : {true, false}) {
                auto part = std::make_unique<apriltag::PartOfFamily>(
                    family_type(family.name), [&](int id) { return family.lists(id) == is_listed; });
                if (part->tags()->ncodes > 0) // the library divides by the number of tags
                    detectables_.push_back({family, is_listed, std::move(part)});
            }
        detector_.reset(apriltag_detector_create());
        detector_->nthreads = threads_;
        configure_detector();
        // In older releases of the library, new threads take tasks while the task list may still be reallocated
        // (AprilRobotics/apriltag, pull request 339). Process a small frame with few tasks first: after it, the
        // threads wait for a signal before they take tasks.
        const int side_px = apriltag::min_image_side_px(*detector_);
        if (threads_ > 1)
            apriltag::detect(*detector_, cv::Mat::zeros(side_px, side_px, CV_8UC1), [](const auto &) {});
    }

    void track(const arhost_track_request &request, arhost::Observations &observations) {
        // The library takes about 40 ns for each pixel, refinement at most about as long.
        constexpr double work_per_px = 0.28;
        const cv::Mat grey = fiducial::grey_of(*request.frame);
        fiducial::FrameRefinement refinement(grey, request.frame->format->transfer, search_->lens(), work_per_px);
        const auto detection = [&](const Look &look) {
            return [&, look](const cv::Rect &region, auto &seen) { observe(grey, region, look, refinement, seen); };
        };
        fiducial::Pass pass{.family = nullptr, .detect = detection({})};
        if (looks_closer_)
            pass.closer_looks.push_back({detection(enlarged), max_part});
        if (looks_closer_ && min_margin_ == 0 && sharpening_ < sharpened.min_sharpening)
            pass.closer_looks.push_back({detection(sharpened), max_part});
        search_->track(request, observations, {grid_px(), apriltag::min_image_side_px(*detector_)}, {&pass, 1});
    }

    void stop() {
        if (search_)
            search_->finish();
        search_.reset();
        detector_.reset();
        detectables_.clear();
    }

private:
    void configure_detector() {
        detector_->quad_decimate = static_cast<float>(decimate_);
        detector_->quad_sigma = static_cast<float>(sigma_);
        detector_->refine_edges = refine_edges_;
        detector_->decode_sharpening = sharpening_;
        apriltag_detector_clear_families(detector_.get());
        for (const Detectable &one : detectables_)
            apriltag_detector_add_family_bits(detector_.get(), one.part->tags(), one.max_hamming(max_hamming_));
    }

    // Adds the tags of a region of the frame to `seen`.
    void observe(const cv::Mat &grey, const cv::Rect &region, const Look &look, fiducial::FrameRefinement &refinement,
                 fiducial::Seen &seen) {
        cv::Mat larger;
        if (look.scale > 1)
            cv::resize(grey(region), larger, {}, look.scale, look.scale, cv::INTER_CUBIC);
        detector_->decode_sharpening = std::max(look.min_sharpening, sharpening_);
        detector_->qtp.max_nmaxima = look.max_maxima;
        std::vector<std::size_t> refined; // indices in seen.markers
        std::vector<fiducial::RoughMarker> rough;
        const auto observe_one = [&](const apriltag_detection_t &tag) {
            if (tag.decision_margin < min_margin_)
                return;
            const Detectable &one =
                *std::ranges::find(detectables_, tag.family, [](const Detectable &any) { return any.part->tags(); });
            fiducial::MeasuredCorners corners{apriltag::corners_of(tag, look.scale)};
            for (cv::Point2d &corner : corners.corners_px)
                corner += cv::Point2d(region.tl());
            const auto hamming = static_cast<std::uint32_t>(tag.hamming);
            const arhost_observation observed =
                one.family.observation(one.part->id(tag.id), corners,
                                       {hamming, tag.decision_margin,
                                        fiducial::false_positive_rate(static_cast<int>(tag.family->nbits), hamming)});
            if (one.is_listed && seen.wants && !seen.wants(observed.id, observed.family))
                return;
            if (fit_edges_ && one.is_listed) {
                refined.push_back(seen.markers.size());
                rough.push_back({corners.corners_px, tag.family->width_at_border,
                                 [tags = tag.family, id = tag.id] { return apriltag::print_of(*tags, id); },
                                 refine_edges_});
            }
            seen.markers.push_back(observed);
        };
        if (apriltag::detect(*detector_, look.scale > 1 ? larger : grey(region), observe_one))
            seen.candidates += detector_->nquads;
        const auto corners = refinement.refine(rough, threads_);
        for (std::size_t i = 0; i < refined.size(); ++i)
            if (corners[i])
                set_corners(seen.markers[refined[i]], *corners[i]);
    }

    // Returns the side of a threshold tile in px of the frame: the library computes its threshold per 4×4 px tile of
    // the decimated image. If a search region begins at a multiple of this side, its tiles are those of the whole
    // frame.
    int grid_px() const { return decimate_ == 1.5 ? 6 : 4 * static_cast<int>(decimate_); }

    arhost::Host host_;
    const int threads_;
    bool fit_edges_ = true;
    double decimate_ = 1, sigma_ = 0;
    bool refine_edges_ = true;
    double sharpening_ = 0.25;
    bool looks_closer_ = true;
    int max_hamming_ = -1; // −1: the default of each family
    double min_margin_ = 0;

    std::optional<fiducial::MarkerSearch> search_;
    std::vector<Family> families_;
    std::vector<Detectable> detectables_;
    // Declared last, because it must be destroyed before the families it uses.
    apriltag::Detector detector_{nullptr, apriltag_detector_destroy};
};

} // namespace

ARHOST_TRACKER(AprilTagTracker, descriptor)
