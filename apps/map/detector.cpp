// SPDX-License-Identifier: Apache-2.0
#include "detector.hpp"

#include "base/text.hpp"

#include <fiducial/april_tags.hpp>
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

// Detects markers like tracker_apriltag with its default options.
class AprilTags {
public:
    AprilTags(const apriltag::FamilyType &type, const std::set<int> &ids, const arhost_intrinsics &camera)
        : lens_(camera), family_(type, [&](int id) { return ids.empty() || ids.contains(id); }) {
        detector_->quad_decimate = 1;
        detector_->quad_sigma = 0;
        detector_->refine_edges = true;
        detector_->decode_sharpening = 0.25;
        // With two bit errors, the decoding table of a large family would take gigabytes.
        const bool is_large = family_.tags()->ncodes > 10'000;
        apriltag_detector_add_family_bits(detector_.get(), family_.tags(),
                                          std::min(type.default_max_hamming, is_large ? 1 : 2));
    }

    std::vector<Detection> operator()(const cv::Mat &grey) const {
        std::vector<Candidate> candidates;
        apriltag::detect(*detector_, grey, [&](const apriltag_detection_t &tag) {
            const fiducial::Corners rough_px = apriltag::corners_of(tag);
            candidates.push_back({family_.id(tag.id),
                                  fiducial::refine_corners(
                                      grey, ARHOST_TRANSFER_SRGB, rough_px, lens_, tag.family->width_at_border,
                                      [&] { return apriltag::print_of(*tag.family, tag.id); }, true)
                                      .value_or(fiducial::MeasuredCorners{rough_px})
                                      .corners_px,
                                  tag.decision_margin - 256.0 * tag.hamming});
        });
        return best_of_each(candidates);
    }

private:
    fiducial::Lens lens_;
    apriltag::PartOfFamily family_;
    apriltag::Detector detector_{apriltag_detector_create(), apriltag_detector_destroy};
};

// Detects markers like tracker_aruco with its default options.
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
        parameters_.errorCorrectionRate = aruco::default_correction_rate(dictionary_);
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

std::string seen_instead(const std::vector<cv::Mat> &grey_images, const arhost_intrinsics &camera,
                         const std::function<void()> &poll) {
    std::set<int> best_ids;
    std::string best;
    for (const std::string &name : marker::family_names()) {
        const marker::Family family = marker::find_family(name);
        const bool is_known =
            family.is_dictionary || std::ranges::count(apriltag::family_types, name, &apriltag::FamilyType::name) > 0;
        if (!is_known || family.count > 10'000) // the decoding tables of large families take seconds
            continue;
        poll();
        const Detector detect = detector_of(family, {}, camera);
        std::set<int> ids;
        for (const cv::Mat &grey : grey_images)
            for (const Detection &detection : detect(grey))
                ids.insert(detection.id);
        // Of dictionaries that contain each other, the first one is the smallest.
        if (ids.size() > best_ids.size()) {
            best_ids = ids;
            best = base::count_of(ids.size(), "marker") + " of " + name + ", such as " + std::to_string(*ids.begin());
        }
    }
    return best;
}

} // namespace arhost::map
