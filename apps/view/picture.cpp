// SPDX-License-Identifier: Apache-2.0
#include "view/picture.hpp"

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <cmath>
#include <stdexcept>
#include <vector>

namespace arhost::view {

cv::Mat backdrop(Backdrop kind, int width, int height) {
    cv::Mat picture(height, width, CV_8UC3);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const int code = kind == Backdrop::checkerboard ? ((x / 20 + y / 20) % 2 ? 176 : 192)
                                                            : 80 + 80 * y / height; // brighter below
            picture.at<cv::Vec3b>(y, x) = cv::Vec3b::all(static_cast<std::uint8_t>(code));
        }
    return picture;
}

cv::Mat composited(const ImageView &image, const cv::Mat &backdrop) {
    const auto width = static_cast<std::uint32_t>(backdrop.cols), height = static_cast<std::uint32_t>(backdrop.rows);
    arhost_frame_format format{};
    format.struct_size = sizeof format;
    format.pixel_format = ARHOST_PIXEL_FORMAT_BGR8;
    format.width = width;
    format.height = height;
    if (!arhost_frame_layout(&format))
        throw std::runtime_error("the picture is too large");
    format.stride[0] = static_cast<std::uint32_t>(backdrop.step);
    cv::Mat picture(backdrop.size(), CV_8UC3);
    const std::uint8_t *planes[ARHOST_MAX_PLANES] = {backdrop.data};
    composite(format, planes, image, {0, 0, width, height}, {picture.data, picture.step});
    return picture;
}

cv::Mat with_alpha(const ImageView &image, int width, int height) {
    cv::Mat picture;
    cv::cvtColor(cv::Mat(height, width, CV_8UC4, const_cast<std::uint8_t *>(image.pixels), image.stride), picture,
                 cv::COLOR_RGBA2BGRA);
    return picture;
}

void draw_text(cv::Mat &picture, const std::string &text, double height_px, int line) {
    const double scale = height_px / 22; // of OpenCV's font
    const double from_top = line >= 0 ? line + 1 : picture.rows / (1.6 * height_px) + line + 0.6;
    const cv::Point at(static_cast<int>(height_px * 0.7), static_cast<int>(std::lround(1.6 * height_px * from_top)));
    const bool has_alpha = picture.channels() == 4;
    for (const auto &[code, width] : {std::pair(255, 7), {0, 2}})
        cv::putText(picture, text, at, cv::FONT_HERSHEY_SIMPLEX, scale,
                    has_alpha ? cv::Scalar(code, code, code, 255) : cv::Scalar::all(code),
                    std::max(1, static_cast<int>(std::lround(width * scale))), cv::LINE_AA);
}

std::string encoded(const cv::Mat &picture, const std::string &extension) {
    std::vector<unsigned char> bytes;
    if (!cv::imencode(extension, picture, bytes))
        throw std::runtime_error("cannot encode the picture");
    return {bytes.begin(), bytes.end()};
}

} // namespace arhost::view
