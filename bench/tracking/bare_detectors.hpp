// SPDX-License-Identifier: Apache-2.0
//
// The detectors of AprilTag and OpenCV without arhost, for tag36h11.
#pragma once

#include <fiducial/april_tags.hpp>
#include <fiducial/aruco.hpp>
#include <fiducial/observations.hpp>
#include <fiducial/tracker_support.hpp>

#include <map>
#include <memory>

namespace arhost::bench {

// Corners by id, in the order and with the pixel centres of arhost_observation.
using Detections = std::map<int, fiducial::Corners>;

inline cv::Mat grey_of(const test::GreyFrame &frame) {
    const arhost_frame_format &format = frame.format();
    return {static_cast<int>(format.height), static_cast<int>(format.width), CV_8UC1,
            const_cast<std::uint8_t *>(frame.frame().grey), format.grey_stride};
}

class BareAprilTag {
public:
    explicit BareAprilTag(float quad_decimate = 1) {
        detector_->quad_decimate = quad_decimate;
        apriltag_detector_add_family(detector_.get(), family_.get());
    }
    Detections operator()(const test::GreyFrame &frame) const {
        const cv::Mat grey = grey_of(frame);
        image_u8_t image{grey.cols, grey.rows, static_cast<int>(grey.step), grey.data};
        const std::unique_ptr<zarray_t, decltype(&apriltag_detections_destroy)> tags(
            apriltag_detector_detect(detector_.get(), &image), apriltag_detections_destroy);
        Detections found;
        for (int i = 0; i < zarray_size(tags.get()); ++i) {
            apriltag_detection_t *tag = nullptr;
            zarray_get(tags.get(), i, &tag);
            for (int corner = 0; corner < 4; ++corner) // from the bottom left, counter-clockwise, at +0.5
                found[tag->id][corner] = {tag->p[3 - corner][0] - 0.5, tag->p[3 - corner][1] - 0.5};
        }
        return found;
    }

private:
    std::unique_ptr<apriltag_family_t, decltype(&tag36h11_destroy)> family_{tag36h11_create(), tag36h11_destroy};
    std::unique_ptr<apriltag_detector_t, decltype(&apriltag_detector_destroy)> detector_{apriltag_detector_create(),
                                                                                         apriltag_detector_destroy};
};

class BareOpenCv {
public:
    explicit BareOpenCv(bool refine_corners) {
        // OpenCV's table of this family corrects no errors; with as many bits as AprilTag's, both correct the same.
        dictionary_.maxCorrectionBits = aruco::dictionary_types[0].april_tag_bits;
        if (refine_corners)
            parameters_.cornerRefinementMethod = cv::aruco::CORNER_REFINE_SUBPIX;
    }
    Detections operator()(const test::GreyFrame &frame) const {
        const aruco::DetectedMarkers detected = aruco::detect(grey_of(frame), dictionary_, parameters_);
        Detections found;
        for (std::size_t i = 0; i < detected.ids.size(); ++i)
            for (int corner = 0; corner < 4; ++corner) // OpenCV's prints of AprilTags are rotated by 180°
                found[detected.ids[i]][corner] = detected.corners[i][(corner + 2) % 4];
        return found;
    }

private:
    cv::aruco::Dictionary dictionary_ = aruco::predefined(cv::aruco::DICT_APRILTAG_36h11);
    cv::aruco::DetectorParameters parameters_;
};

} // namespace arhost::bench
