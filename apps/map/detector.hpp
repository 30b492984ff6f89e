// SPDX-License-Identifier: Apache-2.0
//
// Finds markers in images with the libraries and default settings of the trackers.
#pragma once

#include "learning.hpp"
#include "marker/family.hpp"

#include <arhost/camera.h>

#include <opencv2/core.hpp>

#include <functional>
#include <set>
#include <string>
#include <vector>

namespace arhost::map {

// Returns the markers in a grey image, in the order of their ids. If a marker is found twice, returns the better
// detection.
using Detector = std::function<std::vector<Detection>(const cv::Mat &grey)>;

// `ids`: the markers to find; empty: all of the family.
Detector detector_of(const marker::Family &family, const std::set<int> &ids, const arhost_intrinsics &camera);

// Returns, for images without a marker of the expected family, which family they show: "3 markers of tag25h9, such as
// 7"; "" if none. The search takes seconds; `poll` is called meanwhile and may throw.
std::string seen_instead(const std::vector<cv::Mat> &grey_images, const arhost_intrinsics &camera,
                         const std::function<void()> &poll);

} // namespace arhost::map
