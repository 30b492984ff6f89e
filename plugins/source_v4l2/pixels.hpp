// SPDX-License-Identifier: Apache-2.0
//
// V4L2's uncompressed pixel formats, and their conversion to arhost's formats. The section "Image Formats" of the
// kernel's V4L2 documentation describes them.
#pragma once

#include "capture_device.hpp"

#include <arhost/frame.h>

#include <array>
#include <string_view>

namespace arhost {

struct RawFormat {
    std::uint32_t fourcc;
    std::string_view name; // value of the option `format`
    arhost_pixel_format delivered;
    bool is_grey;
};

// The formats in order of preference. Formats that need no conversion come first. Grey formats with more than 8 bits
// lose their lower bits.
inline constexpr std::array<RawFormat, 13> raw_formats = {{
    {V4L2_PIX_FMT_YUYV, "yuyv", ARHOST_PIXEL_FORMAT_YUYV, false},
    {V4L2_PIX_FMT_NV12, "nv12", ARHOST_PIXEL_FORMAT_NV12, false},
    {V4L2_PIX_FMT_NV12M, "nv12", ARHOST_PIXEL_FORMAT_NV12, false},
    {V4L2_PIX_FMT_YUV420, "yuv420", ARHOST_PIXEL_FORMAT_I420, false},
    {V4L2_PIX_FMT_YUV420M, "yuv420", ARHOST_PIXEL_FORMAT_I420, false},
    {V4L2_PIX_FMT_UYVY, "uyvy", ARHOST_PIXEL_FORMAT_YUYV, false},
    {V4L2_PIX_FMT_RGB24, "rgb24", ARHOST_PIXEL_FORMAT_RGB8, false},
    {V4L2_PIX_FMT_BGR24, "bgr24", ARHOST_PIXEL_FORMAT_BGR8, false},
    {V4L2_PIX_FMT_GREY, "grey", ARHOST_PIXEL_FORMAT_GREY8, true},
    {V4L2_PIX_FMT_Y16, "y16", ARHOST_PIXEL_FORMAT_GREY8, true},
    {V4L2_PIX_FMT_Y16_BE, "y16", ARHOST_PIXEL_FORMAT_GREY8, true},
    {V4L2_PIX_FMT_Y12, "y12", ARHOST_PIXEL_FORMAT_GREY8, true},
    {V4L2_PIX_FMT_Y10, "y10", ARHOST_PIXEL_FORMAT_GREY8, true},
}};

const RawFormat *find_raw_format(std::uint32_t fourcc);

// Sets pixel format, size and, for Y'CbCr, matrix and range. Returns false for compressed and unknown formats.
bool describe(const PictureFormat &camera, arhost_frame_format &format);

// Returns whether describe() sets the driver's matrix. Otherwise describe() sets the BT.601 matrix.
bool has_known_matrix(const PictureFormat &camera);

// Returns a description of a defect in the row sizes that the driver reports ("rows of 100 bytes for 640 px"), or an
// empty string.
std::string defect_of(const PictureFormat &camera);

// Copies a picture whose format describe() has set. Returns false if its planes are too small; `fault` then states
// the reason.
bool copy_picture(const PictureFormat &camera, const std::vector<std::span<const std::uint8_t>> &planes,
                  const arhost_frame_buffer &buffer, std::string &fault);

} // namespace arhost
