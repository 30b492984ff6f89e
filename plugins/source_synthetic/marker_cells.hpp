// SPDX-License-Identifier: Apache-2.0
//
// The cells of a printed marker, upright as defined in arhost/tracker.h.
#pragma once

#include <opencv2/core.hpp>

#include <cstdint>
#include <span>
#include <string>

namespace arhost::synthetic {

// Returns the choices of the option `family`, terminated by NULL: "tag36h11", "DICT_6X6_250" …
std::span<const char *const> marker_families();

// Returns the cells of a marker without its quiet zone; 0 is black, and the first row is the top of the print. Throws
// Failure if the family has no marker `id`.
cv::Mat_<uint8_t> marker_cells(const std::string &family, std::int64_t id);

} // namespace arhost::synthetic
