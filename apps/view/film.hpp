// SPDX-License-Identifier: Apache-2.0
//
// Films, which the plugin sink_video encodes.
#pragma once

#include <opencv2/core.hpp>

#include <filesystem>
#include <functional>

namespace arhost::view {

// Writes a film of the pictures that `frame` returns for 0 to `frames` − 1; all have the same size. The file gets its
// name when it is complete. Throws std::runtime_error, or what `frame` throws; then no file remains.
void write_film(const std::filesystem::path &file, int frames, double fps, const std::function<cv::Mat(int)> &frame);

} // namespace arhost::view
