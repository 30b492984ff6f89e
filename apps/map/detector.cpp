// SPDX-License-Identifier: Apache-2.0
#include "detector.hpp"

#include <fiducial/apriltag_families.hpp>
#include <fiducial/aruco.hpp>
#include <fiducial/corner_refinement.hpp>

#include <algorithm>
#include <map>
#include <memory>
#include <stdexcept>

namespace arhost::map {
namespace {

struct Candidate {
    int id;
    fiducial::Corners corners_px;
    double quality;
};

std::vector<Detection> best_of_each(const std::vector<Candidate> &candidates) {
    std::map<int, const Candidate *> best;
    for (const Candidate &candidate : candidates)
        if (const auto [at, is_new] = best.emplace(candidate.id, &candidate);
            !is_new && candidate.quality > at->second->quality)
            at->second = &candidate;
    std::vector<Detection> detections;
    for (const auto &[id, candidate] : best) {
        Detection &detection = detections.emplace_back();
        detection.id = id;
        std::ranges::transform(candidate->corners_px, detection.corners_px.begin(),
                               [](const cv::Point2d &px) { return Eigen::Vector2d(px.x, px.y); });
    }
    return detections;
}

// As tracker_apriltag with its default options.
class AprilTags {
public:
    AprilTags(const apriltag::FamilyType &type, const std::set<int> &ids, const arhost_intrinsics &camera)
        : ids_(ids.begin(), ids.end()), lens_(camera), family_(type.create(), type.destroy),
          library_codes_(family_->codes) {
        if (!ids_.empty()) {
            for (const int id : ids_)
                codes_.push_back(library_codes_[id]);
            family_->codes = codes_.data(); // a copy, because the library's table is static
            family_->ncodes = static_cast<std::uint32_t>(codes_.size());
        }
        detector_->quad_decimate = 1;
        detector_->quad_sigma = 0;
        detector_->refine_edges = true;
        detector_->decode_sharpening = 0.25;
        // The decoding table of a large family would take gigabytes with two bit errors.
        const bool is_large = family_->ncodes > 10'000;
        apriltag_detector_add_family_bits(detector_.get(), family_.get(),
                                          std::min(type.default_max_hamming, is_large ? 1 : 2));
    }
    ~AprilTags() {
        detector_.reset();
        family_->codes = library_codes_;
    }
    AprilTags(const AprilTags &) = delete;
    AprilTags &operator=(const AprilTags &) = delete;

    std::vector<Detection> operator()(const cv::Mat &grey) const {
        constexpr int min_side = 8; // the library reads out of bounds in smaller images
        if (std::min(grey.cols, grey.rows) < min_side)
            return {};
        image_u8_t image{grey.cols, grey.rows, static_cast<int>(grey.step), grey.data};
        const std::unique_ptr<zarray_t, decltype(&apriltag_detections_destroy)> tags(
            apriltag_detector_detect(detector_.get(), &image), apriltag_detections_destroy);
        std::vector<Candidate> candidates;
        for (int i = 0; tags && i < zarray_size(tags.get()); ++i) { // null if no thread could be started
            apriltag_detection_t *tag = nullptr;
            zarray_get(tags.get(), i, &tag);
            Candidate candidate{
                ids_.empty() ? tag->id : ids_[tag->id], {}, tag->decision_margin - 256.0 * tag->hamming};
            // AprilTag's corners begin at the bottom left and are counter-clockwise; pixel centres are at +0.5.
            for (int corner = 0; corner < 4; ++corner)
                candidate.corners_px[corner] = {tag->p[3 - corner][0] - 0.5, tag->p[3 - corner][1] - 0.5};
            candidate.corners_px =
                fiducial::refine_corners(
                    grey, ARHOST_TRANSFER_SRGB, candidate.corners_px, lens_, family_->width_at_border,
                    [&] { return apriltag::print_of(*family_, tag->id); }, true)
                    .value_or(fiducial::MeasuredCorners{candidate.corners_px})
                    .corners_px;
            candidates.push_back(candidate);
        }
        return best_of_each(candidates);
    }

private:
    std::vector<int> ids_;
    fiducial::Lens lens_;
    std::unique_ptr<apriltag_family_t, void (*)(apriltag_family_t *)> family_;
    std::uint64_t *library_codes_;
    std::vector<std::uint64_t> codes_;
    std::unique_ptr<apriltag_detector_t, decltype(&apriltag_detector_destroy)> detector_{apriltag_detector_create(),
                                                                                         apriltag_detector_destroy};
};

// As tracker_aruco with its default options.
class ArucoMarkers {
public:
    ArucoMarkers(const aruco::DictionaryType &type, const std::set<int> &ids, const arhost_intrinsics &camera)
        : ids_(ids.begin(), ids.end()), lens_(camera), dictionary_(aruco::predefined(type.name)) {
        if (!ids_.empty()) {
            cv::Mat listed;
            for (const int id : ids_)
                listed.push_back(dictionary_.bytesList.row(id));
            dictionary_.bytesList = listed;
        }
        parameters_.minMarkerDistanceRate = 0.02;
        const int size = dictionary_.markerSize, errors = size <= 4 ? 0 : size == 5 ? 1 : 3;
        if (size <= 6 && dictionary_.maxCorrectionBits > 0)
            parameters_.errorCorrectionRate = std::min(0.6, (errors + 0.5) / dictionary_.maxCorrectionBits);
    }

    std::vector<Detection> operator()(const cv::Mat &grey) const {
        const aruco::DetectedMarkers found = aruco::detect(grey, dictionary_, parameters_);
        std::vector<Candidate> candidates;
        for (std::size_t i = 0; i < found.ids.size(); ++i) {
            Candidate candidate{ids_.empty() ? found.ids[i] : ids_[found.ids[i]],
                                {},
                                cv::norm(found.corners[i][2] - found.corners[i][0])};
            std::ranges::copy(found.corners[i], candidate.corners_px.begin());
            candidate.corners_px =
                fiducial::refine_corners(grey, ARHOST_TRANSFER_SRGB, candidate.corners_px, lens_,
                                         dictionary_.markerSize + 2 * border_bits,
                                         [&] { return aruco::print_of(dictionary_, found.ids[i], border_bits); })
                    .value_or(fiducial::MeasuredCorners{candidate.corners_px})
                    .corners_px;
            candidates.push_back(candidate);
        }
        return best_of_each(candidates);
    }

private:
    static constexpr int border_bits = 1;

    std::vector<int> ids_;
    fiducial::Lens lens_;
    cv::aruco::Dictionary dictionary_;
    cv::aruco::DetectorParameters parameters_;
};

} // namespace

Detector detector_of(const marker::Family &family, const std::set<int> &ids, const arhost_intrinsics &camera) {
    const auto shared = [](auto detector) -> Detector {
        return [detector](const cv::Mat &grey) { return (*detector)(grey); };
    };
    if (family.is_dictionary) {
        const auto type =
            std::ranges::find(aruco::dictionary_types, family.name,
                              [](const aruco::DictionaryType &other) { return std::string(other.option); });
        return shared(std::make_shared<ArucoMarkers>(*type, ids, camera));
    }
    const auto type = std::ranges::find(apriltag::family_types, family.name, &apriltag::FamilyType::name);
    if (type == apriltag::family_types.end())
        throw std::runtime_error("arhost map finds AprilTags and markers of OpenCV, not " + family.name +
                                 "; write the map by hand, as in docs/markers.md");
    return shared(std::make_shared<AprilTags>(*type, ids, camera));
}

} // namespace arhost::map
