// SPDX-License-Identifier: Apache-2.0
//
// The cells of a printed marker, upright as defined in arhost/tracker.h.
#pragma once

#include <opencv2/core.hpp>

#include <cstdint>
#include <span>
#include <string>

namespace arhost::synthetic {

// NULL-terminated option choices: "tag36h11", "DICT_6X6_250" …
std::span<const char *const> marker_families();

// 0 where the cell is black; the first row is the print's top; without the quiet zone. Throws a Failure if the
// family has no such id.
cv::Mat_<uint8_t> marker_cells(const std::string &family, std::int64_t id);

} // namespace arhost::synthetic
