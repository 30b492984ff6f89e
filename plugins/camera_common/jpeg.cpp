// SPDX-License-Identifier: Apache-2.0
#include "camera_common/jpeg.hpp"

#include <turbojpeg.h>

#include <array>
#include <new>

namespace arhost {

namespace {

// Returns whether a warning of libjpeg is harmless. Many cameras insert padding before the end marker (0xd9). libjpeg
// warns about this padding as if the picture were damaged.
bool is_harmless(const std::string &warning) {
    return warning.find("extraneous bytes before marker 0xd9") != std::string::npos;
}

} // namespace

void JpegDecoder::Destroy::operator()(void *handle) const {
    tjDestroy(handle);
}

JpegDecoder::JpegDecoder() : handle_(tjInitDecompress()) {
    if (!handle_)
        throw std::bad_alloc();
}

bool JpegDecoder::describe(std::span<const std::uint8_t> jpeg, arhost_frame_format &format) {
    int width = 0, height = 0, subsampling = 0, colour_space = 0;
    if (tjDecompressHeader3(handle_.get(), jpeg.data(), jpeg.size(), &width, &height, &subsampling, &colour_space) !=
            0 ||
        width < 1 || height < 1)
        return false;
    const bool even = width % 2 == 0 && height % 2 == 0;
    format.pixel_format = subsampling == TJSAMP_GRAY ? ARHOST_PIXEL_FORMAT_GREY8
                          : subsampling == TJSAMP_420 && colour_space == TJCS_YCbCr && even
                              ? ARHOST_PIXEL_FORMAT_I420
                              : ARHOST_PIXEL_FORMAT_BGR8;
    format.width = static_cast<std::uint32_t>(width);
    format.height = static_cast<std::uint32_t>(height);
    format.yuv_matrix = ARHOST_YUV_MATRIX_BT601; // JFIF defines this matrix
    format.yuv_range = ARHOST_YUV_RANGE_FULL;
    return true;
}

bool JpegDecoder::decode(std::span<const std::uint8_t> jpeg, const arhost_frame_format &format,
                         std::uint8_t *const *planes, std::string &fault) {
    arhost_frame_format found{};
    if (!describe(jpeg, found)) {
        fault = tjGetErrorStr2(handle_.get());
        return false;
    }
    if (found.width != format.width || found.height != format.height) {
        fault = "it is " + std::to_string(found.width) + "×" + std::to_string(found.height) + " px";
        return false;
    }
    if (format.pixel_format != ARHOST_PIXEL_FORMAT_BGR8 && found.pixel_format != format.pixel_format) {
        fault = "its chroma subsampling differs from that of the first picture";
        return false;
    }
    const auto width = static_cast<int>(format.width), height = static_cast<int>(format.height);
    int result = 0;
    if (format.pixel_format == ARHOST_PIXEL_FORMAT_I420) {
        std::array<unsigned char *, 3> to = {planes[0], planes[1], planes[2]};
        std::array<int, 3> strides{};
        for (std::size_t p = 0; p < 3; ++p)
            strides[p] = static_cast<int>(format.stride[p]);
        result = tjDecompressToYUVPlanes(handle_.get(), jpeg.data(), jpeg.size(), to.data(), width, strides.data(),
                                         height, 0);
    } else {
        result = tjDecompress2(handle_.get(), jpeg.data(), jpeg.size(), planes[0], width,
                               static_cast<int>(format.stride[0]), height,
                               format.pixel_format == ARHOST_PIXEL_FORMAT_GREY8 ? TJPF_GRAY : TJPF_BGR, 0);
    }
    if (result == 0)
        return true;
    fault = tjGetErrorStr2(handle_.get());
    return tjGetErrorCode(handle_.get()) == TJERR_WARNING && is_harmless(fault);
}

} // namespace arhost
