// SPDX-License-Identifier: Apache-2.0
//
// Pictures of images that a ray tracer has rendered.
#pragma once

#include "compositor/compositor.hpp"

#include <opencv2/core.hpp>

#include <string>

namespace arhost::view {

enum class Backdrop { grey, checkerboard };

cv::Mat backdrop(Backdrop kind, int width, int height);              // BGR
cv::Mat composited(const ImageView &image, const cv::Mat &backdrop); // BGR
cv::Mat with_alpha(const ImageView &image, int width, int height);   // BGRA, of a straight image
// Draws text with an outline; `line`: from 0, from the top, or from −1, from the bottom.
void draw_text(cv::Mat &picture, const std::string &text, double height_px, int line);
// Returns the bytes of a file; `extension`: ".png", ".jpg" or ".ppm". Throws std::runtime_error.
std::string encoded(const cv::Mat &picture, const std::string &extension);

} // namespace arhost::view
