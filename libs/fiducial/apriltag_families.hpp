// SPDX-License-Identifier: Apache-2.0
//
// The tag families of the AprilTag library.
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

#include <array>
#include <cstddef>
#include <cstdint>

namespace arhost::apriltag {

struct FamilyType {
    const char *name;
    apriltag_family_t *(*create)();
    void (*destroy)(apriltag_family_t *);
    // The largest number of bit errors, at most 2, with which fewer than 2 in 10,000 squares of random bits match one
    // of the family's tags: 4 · tags · Σ C(bits, k) / 2^bits, summed over k = 0 to the number of errors. For tag16h5,
    // even without errors it is 2 in 1,000.
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

// `index`: of the tag in the family's table.
inline fiducial::Print print_of(apriltag_family_t &family, int index) {
    image_u8_t *drawn = apriltag_to_image(&family, static_cast<std::uint32_t>(index));
    fiducial::Print print{{}, (family.total_width - family.width_at_border) / 2};
    cv::Mat(drawn->height, drawn->width, CV_8UC1, drawn->buf, static_cast<std::size_t>(drawn->stride))
        .convertTo(print.cells, CV_32F, 1 / 255.0);
    image_u8_destroy(drawn);
    return print;
}

} // namespace arhost::apriltag
