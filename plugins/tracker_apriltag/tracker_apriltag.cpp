// SPDX-License-Identifier: Apache-2.0
//
// tracker_apriltag: detects AprilTags with the AprilTag library, version 3.
#include <fiducial/apriltag_families.hpp>
#include <fiducial/corner_refinement.hpp>
#include <fiducial/observations.hpp>
#include <fiducial/other_markers.hpp>
#include <fiducial/search_regions.hpp>
#include <fiducial/undistortion.hpp>

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

using arhost::Failure;
using arhost::apriltag::family_types;
using arhost::apriltag::FamilyType;
using arhost::fiducial::Corners;
using arhost::fiducial::Family;

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
    arhost::option(ARHOST_OPTION_BOOL, "closer_look", "true",
                   "If a target is not found, searches a part of the frame again, at twice the resolution, and with "
                   "sharper bits and more candidates for corners: finds more of the strongly tilted, blurred, small "
                   "and partly hidden tags of families with more than 25 bits."),
    arhost::option(ARHOST_OPTION_INTEGER, "threads", "1",
                   "Number of detector threads; it does not affect the result.", 1, 64),
};

constexpr arhost_descriptor descriptor = {
    sizeof(arhost_descriptor),
    ARHOST_KIND_TRACKER,
    "tracker_apriltag",
    "AprilTag tracker",
    "0.1.0",
    "arhost",
    "Apache-2.0",
    "Detects AprilTags with the AprilTag library.",
    0,
    std::size(options),
    options,
    nullptr,
};

using Detector = std::unique_ptr<apriltag_detector_t, decltype(&apriltag_detector_destroy)>;
using Detections = std::unique_ptr<zarray_t, decltype(&apriltag_detections_destroy)>;

// A copy of a tag family that has only its listed tags, or only the others. The others are detected only if all of
// their bits are right: the decoding table has an entry for each tag and each combination of corrected bits, which
// would be gigabytes for the larger families.
class PartOfFamily {
public:
    PartOfFamily(const Family &family, const FamilyType &type, bool is_listed)
        : family_(family), type_(type), is_listed_(is_listed), tags_(type.create()), library_codes_(tags_->codes) {
        for (int id = 0; id < family.id_count; ++id)
            if (family.lists(id) == is_listed) {
                ids_.push_back(id);
                codes_.push_back(library_codes_[id]);
            }
        tags_->codes = codes_.data(); // a copy, because the library's table is static and must not change
        tags_->ncodes = static_cast<std::uint32_t>(codes_.size());
    }
    ~PartOfFamily() {
        tags_->codes = library_codes_;
        type_.destroy(tags_);
    }
    PartOfFamily(const PartOfFamily &) = delete;
    PartOfFamily &operator=(const PartOfFamily &) = delete;

    const Family &family() const { return family_; }
    bool is_listed() const { return is_listed_; }
    apriltag_family_t *tags() const { return tags_; }
    int id(int index) const { return ids_[index]; } // of the tag that the library numbers so

    // `configured`: −1 for the family's default.
    int max_hamming(int configured) const {
        return !is_listed_ ? 0 : configured < 0 ? type_.default_max_hamming : configured;
    }

private:
    const Family &family_;
    const FamilyType &type_;
    bool is_listed_;
    apriltag_family_t *tags_;
    std::uint64_t *library_codes_;
    std::vector<int> ids_;
    std::vector<std::uint64_t> codes_;
};

const FamilyType &family_type(const std::string &name) {
    std::string names;
    for (const FamilyType &type : family_types) {
        if (name == type.name)
            return type;
        names += std::string(names.empty() ? "" : ", ") + type.name;
    }
    arhost::fiducial::reject_prints_without_ids(name, "tracker_apriltag");
    throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                  "unknown family '" + name + "': tracker_apriltag has " + names +
                      (name.starts_with("DICT_") ? "; tracker_aruco has OpenCV's dictionaries" : ""));
}

using WholeFamily = std::unique_ptr<apriltag_family_t, void (*)(apriltag_family_t *)>;

WholeFamily whole_family(const std::string &name) {
    const FamilyType &type = family_type(name);
    return {type.create(), type.destroy};
}

arhost::fiducial::FamilyTraits traits_of(const std::string &name) {
    const WholeFamily family = whole_family(name);
    // The margin has the bits outside of the border, or is white.
    return {(family->total_width - family->width_at_border) / 2.0 / family->width_at_border,
            static_cast<int>(family->nbits)};
}

// How to search a region: the normal look, or a closer one.
struct Look {
    int scale = 1;
    double min_sharpening = 0; // of the bits; the decision margin increases with it
    int max_maxima = 10;       // qtp.max_nmaxima: of an outline, so many places are tried as corners of a square
};
// The ends of what hides a corner look like corners, too.
constexpr Look enlarged{2}, sharpened{1, 2, 20};

class AprilTagTracker {
public:
    AprilTagTracker(const arhost::Host &host, const arhost::Options &options)
        : host_(host), threads_(static_cast<int>(options.integer("threads"))) {
        set(options);
    }

    static constexpr const char *changeable[] = {"corner_refinement",   "quad_decimate",     "quad_sigma",
                                                 "refine_edges",        "decode_sharpening", "max_hamming",
                                                 "min_decision_margin", "closer_look",       nullptr};
    // Takes the options that `changed` contains.
    void set(const arhost::Options &changed) {
        const auto take_real = [&](const char *key, double &value) {
            if (changed.contains(key))
                value = changed.real(key);
        };
        double decimate = decimate_;
        take_real("quad_decimate", decimate);
        // For other factors, the library would decimate by the integer part but scale the corners by the full factor.
        if (decimate != 1.5 && decimate != std::floor(decimate))
            throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "quad_decimate: must be 1, 1.5 or an integer");
        decimate_ = decimate;
        take_real("quad_sigma", sigma_);
        take_real("decode_sharpening", sharpening_);
        take_real("min_decision_margin", min_margin_);
        if (changed.contains("corner_refinement"))
            fit_edges_ = changed.text("corner_refinement") == "edges";
        if (changed.contains("refine_edges"))
            refine_edges_ = changed.boolean("refine_edges");
        if (changed.contains("closer_look"))
            looks_closer_ = changed.boolean("closer_look");
        if (changed.contains("max_hamming"))
            max_hamming_ = static_cast<int>(changed.integer("max_hamming"));
        if (detector_)
            configure_detector();
    }

    void start(const arhost_tracker_setup &setup) {
        stop();
        lens_.emplace(*setup.intrinsics);
        families_ = arhost::fiducial::families_of(
            setup, [](const std::string &name) { return static_cast<int>(whole_family(name)->ncodes); });
        regions_.emplace(setup, traits_of);
        for (const Family &family : families_)
            for (const bool is_listed : {true, false}) {
                auto part = std::make_unique<PartOfFamily>(family, family_type(family.name), is_listed);
                if (part->tags()->ncodes > 0) // the library divides by the number of tags
                    parts_.push_back(std::move(part));
            }
        others_.emplace(host_, setup, [&](const cv::Mat &grey) {
            return arhost::fiducial::markers_of_other_families(grey, families_);
        });
        detector_.reset(apriltag_detector_create());
        detector_->nthreads = threads_;
        configure_detector();
        // In older releases of the library, new threads take tasks while the task list may still be reallocated
        // (AprilRobotics/apriltag, pull request 339). Process a small frame with few tasks first: after it, the
        // threads wait for a signal before they take tasks.
        if (threads_ > 1)
            detect(*detector_, cv::Mat::zeros(min_image_side(), min_image_side(), CV_8UC1));
    }

    void track(const arhost_track_request &request, arhost::Observations &observations) {
        const auto detection = [&](const Look &look) {
            return [&, look](const cv::Rect &region, auto &seen) { observe(*request.frame, region, look, seen); };
        };
        arhost::fiducial::Pass pass{nullptr, detection({})};
        if (looks_closer_)
            pass.closer_looks.push_back({detection(enlarged), true});
        if (looks_closer_ && min_margin_ == 0 && sharpening_ < sharpened.min_sharpening)
            pass.closer_looks.push_back({detection(sharpened), true});
        arhost::fiducial::Seen seen = regions_->search(request, {grid_px(), min_image_side()}, {&pass, 1});
        others_->frame(arhost::fiducial::grey_of(*request.frame), seen.markers);
        observations.set_candidate_count(seen.candidates);
        arhost::fiducial::report(std::move(seen.markers), observations);
    }

    void stop() {
        if (others_)
            others_->finish();
        others_.reset();
        detector_.reset();
        parts_.clear();
    }

private:
    void configure(apriltag_detector_t &detector) const {
        detector.quad_decimate = static_cast<float>(decimate_);
        detector.quad_sigma = static_cast<float>(sigma_);
        detector.refine_edges = refine_edges_;
        detector.decode_sharpening = sharpening_;
    }

    void configure_detector() {
        configure(*detector_);
        apriltag_detector_clear_families(detector_.get());
        for (const auto &part : parts_)
            apriltag_detector_add_family_bits(detector_.get(), part->tags(), part->max_hamming(max_hamming_));
    }

    // Adds the tags of a region of the frame to `seen`.
    void observe(const arhost_frame &frame, const cv::Rect &region, const Look &look, arhost::fiducial::Seen &seen) {
        const cv::Mat grey = arhost::fiducial::grey_of(frame);
        cv::Mat larger;
        if (look.scale > 1)
            cv::resize(grey(region), larger, {}, look.scale, look.scale, cv::INTER_CUBIC);
        detector_->decode_sharpening = std::max(look.min_sharpening, sharpening_);
        detector_->qtp.max_nmaxima = look.max_maxima;
        const Detections tags = detect(*detector_, look.scale > 1 ? larger : grey(region));
        if (tags)
            seen.candidates += detector_->nquads;
        for (int i = 0; tags && i < zarray_size(tags.get()); ++i) {
            apriltag_detection_t *tag = nullptr;
            zarray_get(tags.get(), i, &tag);
            if (tag->decision_margin < min_margin_)
                continue;
            const PartOfFamily &part =
                **std::ranges::find(parts_, tag->family, [](const auto &one) { return one->tags(); });
            arhost::fiducial::MeasuredCorners corners;
            // AprilTag's corners begin at the bottom left and are counter-clockwise; pixel centres are at +0.5.
            for (int corner = 0; corner < 4; ++corner)
                corners.corners_px[corner] = {tag->p[3 - corner][0] / look.scale - 0.5 + region.x,
                                              tag->p[3 - corner][1] / look.scale - 0.5 + region.y};
            if (fit_edges_ && part.is_listed())
                corners = arhost::fiducial::refine_corners(
                              grey, frame.format->transfer, corners.corners_px, *lens_, tag->family->width_at_border,
                              [&] { return arhost::apriltag::print_of(*tag->family, tag->id); }, refine_edges_)
                              .value_or(corners);
            arhost_observation &one = seen.markers.emplace_back(part.family().observation(part.id(tag->id), corners));
            one.hamming = static_cast<std::uint32_t>(tag->hamming);
            one.decision_margin = tag->decision_margin;
            one.false_positive_rate =
                arhost::fiducial::false_positive_rate(static_cast<int>(tag->family->nbits), one.hamming);
        }
    }

    // The library's threshold is that of 4×4 px tiles of the decimated image. Regions on this grid have the tiles of
    // the whole frame.
    int grid_px() const { return decimate_ == 1.5 ? 6 : 4 * static_cast<int>(decimate_); }

    // The library reads out of bounds in images smaller than one of its 4×4 px tiles.
    int min_image_side() const { return static_cast<int>(8 * decimate_); }

    Detections detect(apriltag_detector_t &detector, const cv::Mat &grey) const {
        if (std::min(grey.cols, grey.rows) < min_image_side())
            return {nullptr, apriltag_detections_destroy};
        cv::Mat pixels = grey;
        if (sigma_ != 0 && decimate_ == 1) // make a copy: the library would blur in place, but the frame is read-only
            pixels = grey.clone();
        image_u8_t image{pixels.cols, pixels.rows, static_cast<int>(pixels.step), pixels.data};
        return {apriltag_detector_detect(&detector, &image), apriltag_detections_destroy};
    }

    arhost::Host host_;
    const int threads_;
    bool fit_edges_ = true;
    double decimate_ = 1, sigma_ = 0;
    bool refine_edges_ = true;
    double sharpening_ = 0.25;
    bool looks_closer_ = true;
    int max_hamming_ = -1; // −1: that of each family
    double min_margin_ = 0;

    std::optional<arhost::fiducial::Lens> lens_;
    std::optional<arhost::fiducial::SearchRegions> regions_;
    std::optional<arhost::fiducial::OtherMarkers> others_;
    std::vector<Family> families_;
    std::vector<std::unique_ptr<PartOfFamily>> parts_;
    Detector detector_{
        nullptr, apriltag_detector_destroy}; // declared last, because it must be destroyed before the parts it uses
};

} // namespace

ARHOST_TRACKER(AprilTagTracker, descriptor)
