// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>

#include <filesystem>

namespace arhost {

// Returns the Exif orientation of a WebP file: 1 to 8; 1 if the file has none, or is no WebP file. OpenCV applies the
// orientation only of other formats.
int webp_orientation(const std::filesystem::path &file);

// Returns the upright image.
cv::Mat oriented(const cv::Mat &image, int exif_orientation);

} // namespace arhost
