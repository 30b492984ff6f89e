// SPDX-License-Identifier: Apache-2.0
//
// tracker_apriltag: detects AprilTags with the AprilTag library, version 3.
#include <fiducial_common/apriltag_families.hpp>
#include <fiducial_common/edge_refinement.hpp>
#include <fiducial_common/marker_report.hpp>

#include <arhost-cpp/plugin.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace {

using arhost::Failure;
using arhost::apriltag::family_types;
using arhost::apriltag::FamilyType;
using arhost::fiducial::Detection;
using arhost::fiducial::MarkerReport;

constexpr auto family_names = [] {
    std::array<const char *, family_types.size() + 1> names{};
    std::ranges::transform(family_types, names.begin(), &FamilyType::name);
    return names;
}();

constexpr const char *refinements[] = {"edges", "none", nullptr};

constexpr arhost_option_descriptor options[] = {
    arhost::option(ARHOST_OPTION_TEXT, "family", "tag36h11", "Family of the tags.", 0, 0, family_names.data()),
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
    arhost::option(ARHOST_OPTION_INTEGER, "max_hamming", "-1",
                   "Maximum number of bit errors to correct; -1: 0 for families of up to 21 bits, 1 for tag25h9, "
                   "otherwise 2.",
                   -1, 2),
    arhost::option(ARHOST_OPTION_REAL, "min_decision_margin", "0",
                   "Minimum bit contrast of a tag, in grey levels from 0 to 255; tags of lower contrast are ignored.",
                   0, 255),
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
    "Detects AprilTags of one family with the AprilTag library.",
    0,
    std::size(options),
    options,
    nullptr,
};

using Detector = std::unique_ptr<apriltag_detector_t, decltype(&apriltag_detector_destroy)>;
using Detections = std::unique_ptr<zarray_t, decltype(&apriltag_detections_destroy)>;

// A copy of a tag family that has only the listed tags. Other tags are not reported, and the decoding table, which
// would take gigabytes for the larger families, stays small. The id of a detection is an index in `ids`.
class ListedFamily {
public:
    ListedFamily(const FamilyType &type, const std::vector<int> &ids)
        : destroy_(type.destroy), family_(type.create()), library_codes_(family_->codes) {
        for (int id : ids)
            codes_.push_back(library_codes_[id]);
        family_->codes = codes_.data(); // a copy, because the library's table is static and must not change
        family_->ncodes = static_cast<std::uint32_t>(codes_.size());
    }
    ~ListedFamily() {
        family_->codes = library_codes_;
        destroy_(family_);
    }
    ListedFamily(const ListedFamily &) = delete;
    ListedFamily &operator=(const ListedFamily &) = delete;
    apriltag_family_t *get() const { return family_; }

private:
    void (*destroy_)(apriltag_family_t *);
    apriltag_family_t *family_;
    std::uint64_t *library_codes_;
    std::vector<std::uint64_t> codes_;
};

const FamilyType &family_type(const std::string &name) {
    for (const FamilyType &type : family_types)
        if (name == type.name)
            return type;
    throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "family: unknown family '" + name + "'");
}

class AprilTagTracker {
public:
    AprilTagTracker(const arhost::Host &, const arhost::Options &options)
        : type_(family_type(options.text("family"))), threads_(static_cast<int>(options.integer("threads"))) {
        set(options);
    }

    static constexpr const char *changeable[] = {
        "corner_refinement", "quad_decimate", "quad_sigma",          "refine_edges",
        "decode_sharpening", "max_hamming",   "min_decision_margin", nullptr};
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
        if (changed.contains("max_hamming"))
            max_hamming_ = static_cast<int>(changed.integer("max_hamming"));
        if (detector_)
            configure_detector();
    }

    void start(const arhost_tracker_setup &setup) {
        stop();
        const std::unique_ptr<apriltag_family_t, decltype(type_.destroy)> whole(type_.create(), type_.destroy);
        report_.emplace(setup, type_.name, whole->ncodes);
        family_.emplace(type_, report_->ids());
        detector_.reset(apriltag_detector_create());
        detector_->nthreads = threads_;
        configure_detector();
        // In older releases of the library, new threads take tasks while the task list may still be reallocated
        // (AprilRobotics/apriltag, pull request 339). Process a small frame with few tasks first: after it, the
        // threads wait for a signal before they take tasks.
        if (threads_ > 1)
            detect(cv::Mat::zeros(min_image_side(), min_image_side(), CV_8UC1));
    }

    void track(const arhost_track_request &request, arhost_tracker_result &result) {
        const arhost_frame &frame = *request.frame;
        const cv::Mat grey(static_cast<int>(frame.format->height), static_cast<int>(frame.format->width), CV_8UC1,
                           const_cast<std::uint8_t *>(frame.grey), frame.format->grey_stride);
        std::vector<Detection> detections;
        const Detections tags = detect(grey);
        for (int i = 0; tags && i < zarray_size(tags.get()); ++i) {
            apriltag_detection_t *tag = nullptr;
            zarray_get(tags.get(), i, &tag);
            if (tag->decision_margin < min_margin_)
                continue;
            Detection detection{static_cast<std::size_t>(tag->id), {}, tag->decision_margin - 256.0 * tag->hamming};
            // AprilTag's corners begin at the bottom left and are counter-clockwise; pixel centres are at +0.5.
            for (int corner = 0; corner < 4; ++corner)
                detection.corners_px[corner] = {tag->p[3 - corner][0] - 0.5, tag->p[3 - corner][1] - 0.5};
            if (fit_edges_)
                detection.corners_px = arhost::fiducial::refine_edges(grey, detection.corners_px, report_->lens(),
                                                                      family_->get()->width_at_border, refine_edges_)
                                           .value_or(detection.corners_px);
            detections.push_back(detection);
        }
        report_->write(detections, result);
    }

    void stop() {
        detector_.reset();
        family_.reset();
    }

private:
    void configure_detector() {
        detector_->quad_decimate = static_cast<float>(decimate_);
        detector_->quad_sigma = static_cast<float>(sigma_);
        detector_->refine_edges = refine_edges_;
        detector_->decode_sharpening = sharpening_;
        apriltag_detector_clear_families(detector_.get());
        apriltag_detector_add_family_bits(detector_.get(), family_->get(),
                                          max_hamming_ < 0 ? type_.default_max_hamming : max_hamming_);
    }

    // The library reads out of bounds in images smaller than one of its 4×4 px tiles.
    int min_image_side() const { return static_cast<int>(8 * decimate_); }

    Detections detect(const cv::Mat &grey) {
        if (std::min(grey.cols, grey.rows) < min_image_side())
            return {nullptr, apriltag_detections_destroy};
        cv::Mat pixels = grey;
        if (sigma_ != 0 && decimate_ == 1) // make a copy: the library would blur in place, but the frame is read-only
            pixels = grey.clone();
        image_u8_t image{pixels.cols, pixels.rows, static_cast<int>(pixels.step), pixels.data};
        return {apriltag_detector_detect(detector_.get(), &image), apriltag_detections_destroy};
    }

    const FamilyType &type_;
    const int threads_;
    bool fit_edges_ = true;
    double decimate_ = 1, sigma_ = 0;
    bool refine_edges_ = true;
    double sharpening_ = 0.25;
    int max_hamming_ = -1; // −1: type_.default_max_hamming
    double min_margin_ = 0;

    std::optional<MarkerReport> report_;
    std::optional<ListedFamily> family_;
    Detector detector_{
        nullptr, apriltag_detector_destroy}; // declared last, because it must be destroyed before the family it uses
};

} // namespace

ARHOST_TRACKER(AprilTagTracker, descriptor)
