// SPDX-License-Identifier: Apache-2.0
#include "pixels.hpp"

#include "camera_common/copy_rows.hpp"

#include <algorithm>

namespace arhost {
namespace {

// A colour plane of a picture. Several colour planes may share a plane of memory.
struct ColourPlane {
    std::size_t memory; // index of the plane of memory
    std::size_t offset; // offset of the first row, bytes
    std::size_t stride; // bytes from row to row
    std::size_t row_bytes, rows;
};

std::vector<ColourPlane> colour_planes(const PictureFormat &camera) {
    const std::size_t width = camera.width, height = camera.height, stride = camera.strides.front();
    const auto stride_of = [&](std::size_t plane, std::size_t single) {
        return camera.strides.size() > plane ? std::size_t{camera.strides[plane]} : single;
    };
    switch (camera.fourcc) {
    case V4L2_PIX_FMT_NV12:
        return {{0, 0, stride, width, height}, {0, stride * height, stride, width, height / 2}};
    case V4L2_PIX_FMT_NV12M:
        return {{0, 0, stride, width, height}, {1, 0, stride_of(1, stride), width, height / 2}};
    case V4L2_PIX_FMT_YUV420: {
        const std::size_t half = stride / 2, size = stride * height;
        return {{0, 0, stride, width, height},
                {0, size, half, width / 2, height / 2},
                {0, size + half * (height / 2), half, width / 2, height / 2}};
    }
    case V4L2_PIX_FMT_YUV420M:
        return {{0, 0, stride, width, height},
                {1, 0, stride_of(1, stride / 2), width / 2, height / 2},
                {2, 0, stride_of(2, stride / 2), width / 2, height / 2}};
    case V4L2_PIX_FMT_GREY:
        return {{0, 0, stride, width, height}};
    case V4L2_PIX_FMT_RGB24:
    case V4L2_PIX_FMT_BGR24:
        return {{0, 0, stride, 3 * width, height}};
    default: // YUYV, UYVY and grey with more than 8 bits
        return {{0, 0, stride, 2 * width, height}};
    }
}

bool is_converted(std::uint32_t fourcc) {
    return fourcc == V4L2_PIX_FMT_UYVY || fourcc == V4L2_PIX_FMT_Y16 || fourcc == V4L2_PIX_FMT_Y16_BE ||
           fourcc == V4L2_PIX_FMT_Y12 || fourcc == V4L2_PIX_FMT_Y10;
}

void convert_row(std::uint32_t fourcc, const std::uint8_t *from, std::size_t bytes, std::uint8_t *to) {
    // Reduces samples to 8 bits by a right shift. `low`: the index of a sample's less significant byte.
    const auto reduce = [&](int low, int shift) {
        for (std::size_t i = 0; i < bytes; i += 2)
            to[i / 2] = static_cast<std::uint8_t>(std::min((from[i + low] | from[i + 1 - low] << 8) >> shift, 255));
    };
    switch (fourcc) {
    case V4L2_PIX_FMT_Y16:
        return reduce(0, 8);
    case V4L2_PIX_FMT_Y16_BE:
        return reduce(1, 8);
    case V4L2_PIX_FMT_Y12:
        return reduce(0, 4);
    case V4L2_PIX_FMT_Y10:
        return reduce(0, 2);
    default: // UYVY
        for (std::size_t i = 0; i < bytes; i += 2) {
            to[i] = from[i + 1];
            to[i + 1] = from[i];
        }
    }
}

std::uint32_t encoding_of(const PictureFormat &camera) {
    return camera.ycbcr_encoding == V4L2_YCBCR_ENC_DEFAULT
               ? std::uint32_t{V4L2_MAP_YCBCR_ENC_DEFAULT(camera.colour_space)}
               : camera.ycbcr_encoding;
}

bool is_chromatic(arhost_pixel_format format) {
    return format == ARHOST_PIXEL_FORMAT_YUYV || format == ARHOST_PIXEL_FORMAT_NV12 ||
           format == ARHOST_PIXEL_FORMAT_I420;
}

} // namespace

const RawFormat *find_raw_format(std::uint32_t fourcc) {
    const auto found = std::ranges::find(raw_formats, fourcc, &RawFormat::fourcc);
    return found == raw_formats.end() ? nullptr : &*found;
}

bool describe(const PictureFormat &camera, arhost_frame_format &format) {
    const RawFormat *raw = find_raw_format(camera.fourcc);
    if (!raw)
        return false;
    format.pixel_format = raw->delivered;
    format.width = camera.width;
    format.height = camera.height;
    const std::uint32_t encoding = encoding_of(camera);
    format.yuv_matrix = encoding == V4L2_YCBCR_ENC_709 || encoding == V4L2_YCBCR_ENC_XV709 ? ARHOST_YUV_MATRIX_BT709
                                                                                           : ARHOST_YUV_MATRIX_BT601;
    const std::uint32_t range =
        camera.quantization == V4L2_QUANTIZATION_DEFAULT
            ? std::uint32_t{V4L2_MAP_QUANTIZATION_DEFAULT(false, camera.colour_space, encoding)}
            : camera.quantization;
    const std::uint32_t transfer = camera.transfer == V4L2_XFER_FUNC_DEFAULT
                                       ? std::uint32_t{V4L2_MAP_XFER_FUNC_DEFAULT(camera.colour_space)}
                                       : camera.transfer;
    format.transfer = transfer == V4L2_XFER_FUNC_NONE ? ARHOST_TRANSFER_LINEAR : ARHOST_TRANSFER_SRGB;
    format.yuv_range = range == V4L2_QUANTIZATION_FULL_RANGE ? ARHOST_YUV_RANGE_FULL : ARHOST_YUV_RANGE_LIMITED;
    return true;
}

bool has_known_matrix(const PictureFormat &camera) {
    const RawFormat *raw = find_raw_format(camera.fourcc);
    const std::uint32_t known[] = {V4L2_YCBCR_ENC_601, V4L2_YCBCR_ENC_XV601, V4L2_YCBCR_ENC_709,
                                   V4L2_YCBCR_ENC_XV709};
    return !raw || !is_chromatic(raw->delivered) || std::ranges::count(known, encoding_of(camera)) > 0;
}

std::string defect_of(const PictureFormat &camera) {
    for (const ColourPlane &plane : colour_planes(camera))
        if (plane.stride < plane.row_bytes)
            return "rows of " + std::to_string(plane.stride) + " bytes for " + std::to_string(camera.width) + " px";
    return "";
}

bool copy_picture(const PictureFormat &camera, const std::vector<std::span<const std::uint8_t>> &planes,
                  const arhost_frame_buffer &buffer, std::string &fault) {
    const std::vector<ColourPlane> colours = colour_planes(camera);
    for (const ColourPlane &plane : colours) {
        const std::size_t size = plane.memory < planes.size() ? planes[plane.memory].size() : 0;
        if (size < plane.offset + plane.stride * (plane.rows - 1) + plane.row_bytes) {
            fault = "it has only " + std::to_string(size) + " bytes";
            return false;
        }
    }
    for (std::size_t p = 0; p < colours.size(); ++p) {
        const ColourPlane &plane = colours[p];
        const std::uint8_t *from = planes[plane.memory].data() + plane.offset;
        std::uint8_t *const to = buffer.plane[p];
        const std::size_t stride = buffer.format->stride[p];
        if (!is_converted(camera.fourcc))
            copy_rows(from, plane.stride, to, stride, plane.row_bytes, plane.rows);
        else
            for (std::size_t y = 0; y < plane.rows; ++y)
                convert_row(camera.fourcc, from + y * plane.stride, plane.row_bytes, to + y * stride);
    }
    return true;
}

} // namespace arhost
