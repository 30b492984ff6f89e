// SPDX-License-Identifier: Apache-2.0
//
// Accesses the AprilTag library: its tag families and its detector.
#pragma once

#include "observations.hpp"

#include <apriltag.h>
#include <tag16h5.h>
#include <tag25h9.h>
#include <tag36h10.h>
#include <tag36h11.h>
#include <tagCircle21h7.h>
#include <tagCircle49h12.h>
#include <tagCustom48h12.h>
#include <tagStandard41h12.h>
#include <tagStandard52h13.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

namespace arhost::apriltag {

struct FamilyType {
    const char *name;
    apriltag_family_t *(*create)();
    void (*destroy)(apriltag_family_t *);
    // The largest number of bit errors, at most 2, with which fewer than 2 in 10,000 squares of random bits match any
    // tag of the family. The expected share of such squares is 4 · tags · Σ C(bits, k) / 2^bits, summed over k = 0 to
    // the number of errors. For tag16h5, it is 2 in 1,000 even without errors, so its value is 0.
    int default_max_hamming = 2;
};

inline constexpr std::array family_types{
    FamilyType{"tag36h11", tag36h11_create, tag36h11_destroy},
    FamilyType{"tag36h10", tag36h10_create, tag36h10_destroy},
    FamilyType{"tag25h9", tag25h9_create, tag25h9_destroy, 1},
    FamilyType{"tag16h5", tag16h5_create, tag16h5_destroy, 0},
    FamilyType{"tagCircle21h7", tagCircle21h7_create, tagCircle21h7_destroy, 0},
    FamilyType{"tagCircle49h12", tagCircle49h12_create, tagCircle49h12_destroy},
    FamilyType{"tagCustom48h12", tagCustom48h12_create, tagCustom48h12_destroy},
    FamilyType{"tagStandard41h12", tagStandard41h12_create, tagStandard41h12_destroy},
    FamilyType{"tagStandard52h13", tagStandard52h13_create, tagStandard52h13_destroy},
};

// `index`: the index of the tag in the family's table.
inline fiducial::Print print_of(apriltag_family_t &family, int index) {
    image_u8_t *drawn = apriltag_to_image(&family, static_cast<std::uint32_t>(index));
    fiducial::Print print{{}, (family.total_width - family.width_at_border) / 2};
    cv::Mat(drawn->height, drawn->width, CV_8UC1, drawn->buf, static_cast<std::size_t>(drawn->stride))
        .convertTo(print.cells, CV_32F, 1 / 255.0);
    image_u8_destroy(drawn);
    return print;
}

// A copy of a family that contains only some of the family's tags.
class PartOfFamily {
public:
    PartOfFamily(const FamilyType &type, const std::function<bool(int id)> &contains)
        : type_(type), tags_(type.create()), library_codes_(tags_->codes) {
        for (int id = 0; id < static_cast<int>(tags_->ncodes); ++id)
            if (contains(id)) {
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

    const FamilyType &type() const { return type_; }
    apriltag_family_t *tags() const { return tags_; }
    int id(int index) const { return ids_[index]; } // `index`: the index that the library reports

private:
    const FamilyType &type_;
    apriltag_family_t *tags_;
    std::uint64_t *library_codes_;
    std::vector<int> ids_;
    std::vector<std::uint64_t> codes_;
};

using Detector = std::unique_ptr<apriltag_detector_t, decltype(&apriltag_detector_destroy)>;

// In images smaller than one of its 4×4 px tiles, the library reads out of bounds. Smaller images are therefore not
// searched.
inline int min_image_side_px(const apriltag_detector_t &detector) {
    return static_cast<int>(8 * detector.quad_decimate);
}

// Calls `found` with each tag in a picture. Returns whether the library could search the picture.
inline bool detect(apriltag_detector_t &detector, const cv::Mat &grey,
                   const std::function<void(const apriltag_detection_t &)> &found) {
    if (std::min(grey.cols, grey.rows) < min_image_side_px(detector))
        return false;
    cv::Mat pixels = grey;
    if (detector.quad_sigma != 0 && detector.quad_decimate == 1) // otherwise the library would blur `grey` in place
        pixels = grey.clone();
    image_u8_t image{pixels.cols, pixels.rows, static_cast<int>(pixels.step), pixels.data};
    const std::unique_ptr<zarray_t, decltype(&apriltag_detections_destroy)> tags(
        apriltag_detector_detect(&detector, &image), apriltag_detections_destroy);
    for (int i = 0; tags && i < zarray_size(tags.get()); ++i) {
        apriltag_detection_t *tag = nullptr;
        zarray_get(tags.get(), i, &tag);
        found(*tag);
    }
    return tags != nullptr; // null if no thread could be started
}

// AprilTag's corners begin at the bottom left and are counter-clockwise; its pixel centres are at +0.5. `scale`: the
// size of the searched picture divided by the size of the frame, in whose pixels the corners are returned.
inline fiducial::Corners corners_of(const apriltag_detection_t &tag, double scale = 1) {
    fiducial::Corners corners_px;
    for (int i = 0; i < 4; ++i)
        corners_px[i] = {tag.p[3 - i][0] / scale - 0.5, tag.p[3 - i][1] / scale - 0.5};
    return corners_px;
}

} // namespace arhost::apriltag
