// SPDX-License-Identifier: Apache-2.0
//
// Markers drawn by the AprilTag library and by OpenCV.
#pragma once

#include "rendered_marker.hpp"

#include <fiducial/april_tags.hpp>
#include <fiducial/aruco.hpp>
#include <fiducial/corner_refinement.hpp>

#include <string_view>

namespace arhost::test {

inline const apriltag::FamilyType &family_type(std::string_view name) {
    for (const auto &type : apriltag::family_types)
        if (type.name == name)
            return type;
    throw std::runtime_error("unknown family");
}

inline Print april_tag(std::string_view family_name, int id) {
    const auto &type = family_type(family_name);
    apriltag_family_t *family = type.create();
    image_u8_t *drawn = apriltag_to_image(family, id);
    const Print print{cv::Mat_<uint8_t>(drawn->height, drawn->width, drawn->buf, drawn->stride).clone(),
                      family->width_at_border};
    image_u8_destroy(drawn);
    type.destroy(family);
    return print;
}

inline Print aruco_marker(std::string_view dictionary, int id, int border_bits = 1) {
    for (const auto &type : aruco::dictionary_types)
        if (type.option == dictionary) {
            const auto table = aruco::predefined(type.name);
            const int cells = table.markerSize + 2 * border_bits;
            cv::Mat drawn;
            aruco::draw(table, id, cells, drawn, border_bits);
            return Print{drawn, cells}.with_margin(1);
        }
    throw std::runtime_error("unknown dictionary");
}

inline void expect_near(const std::optional<fiducial::MeasuredCorners> &found, const fiducial::Corners &truth,
                        double max_px) {
    ASSERT_TRUE(found);
    for (std::size_t k = 0; k < 4; ++k)
        EXPECT_LT(cv::norm(found->corners_px[k] - truth[k]), max_px) << k;
}

} // namespace arhost::test
