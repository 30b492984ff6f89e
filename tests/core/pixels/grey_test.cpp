// SPDX-License-Identifier: Apache-2.0
#include "pixels/grey.hpp"

#include "instruction_sets.hpp"
#include "pixels/formulas.hpp"

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <random>
#include <vector>

namespace arhost {
namespace {

arhost_frame_format layout(arhost_pixel_format pixel_format, std::uint32_t width, std::uint32_t height,
                           arhost_yuv_range range = ARHOST_YUV_RANGE_LIMITED) {
    arhost_frame_format format{};
    format.struct_size = sizeof format;
    format.pixel_format = pixel_format;
    format.width = width;
    format.height = height;
    format.yuv_matrix = ARHOST_YUV_MATRIX_BT601;
    format.yuv_range = range;
    EXPECT_TRUE(arhost_frame_layout(&format));
    return format;
}

// Returns a frame whose planes, including the grey plane, are filled with random bytes and then passed to `fill`,
// which is fill_grey or fill_grey_reference.
template <class Fill> std::vector<std::uint8_t> filled(const arhost_frame_format &format, const Fill &fill) {
    std::mt19937 random(3);
    std::vector<std::uint8_t> bytes(format.byte_size);
    std::generate(bytes.begin(), bytes.end(), std::ref(random));
    const std::uint8_t *planes[ARHOST_MAX_PLANES] = {bytes.data() + format.offset[0], bytes.data() + format.offset[1],
                                                     bytes.data() + format.offset[2]};
    fill(format, planes, bytes.data() + format.grey_offset);
    return bytes;
}

} // namespace

TEST(Grey, MatchesTheReferenceForEveryFormatAndWidthAndLeavesPaddingUntouched) {
    test::on_each_instruction_set([] {
        for (const auto pixel_format : {ARHOST_PIXEL_FORMAT_RGB8, ARHOST_PIXEL_FORMAT_BGR8, ARHOST_PIXEL_FORMAT_YUYV})
            for (const auto range : {ARHOST_YUV_RANGE_LIMITED, ARHOST_YUV_RANGE_FULL})
                for (std::uint32_t width = 2; width <= 130; width += 2) {
                    const auto format = layout(pixel_format, width, 3, range);
                    ASSERT_EQ(filled(format, fill_grey), filled(format, fill_grey_reference))
                        << "format " << pixel_format << ", " << width << " px";
                }
    });
}

TEST(Grey, WritesNothingForFormatsWithALumaPlane) {
    for (const auto pixel_format : {ARHOST_PIXEL_FORMAT_GREY8, ARHOST_PIXEL_FORMAT_NV12, ARHOST_PIXEL_FORMAT_I420}) {
        const auto format = layout(pixel_format, 66, 4);
        EXPECT_EQ(filled(format, fill_grey), filled(format, [](auto &&...) {}));
    }
}

// Tests all 2^24 colours.
TEST(Grey, IsWithinOneOfOpenCvForEveryColour) {
    const auto format = layout(ARHOST_PIXEL_FORMAT_BGR8, 4096, 4096);
    std::vector<std::uint8_t> bytes(format.byte_size);
    for (std::uint32_t colour = 0; colour < 1u << 24; ++colour) {
        std::uint8_t *pixel = &bytes[3 * std::size_t(colour)];
        pixel[0] = static_cast<std::uint8_t>(colour);
        pixel[1] = static_cast<std::uint8_t>(colour >> 8);
        pixel[2] = static_cast<std::uint8_t>(colour >> 16);
    }
    const std::uint8_t *planes[ARHOST_MAX_PLANES] = {bytes.data()};
    fill_grey(format, planes, bytes.data() + format.grey_offset);
    const cv::Mat bgr(4096, 4096, CV_8UC3, bytes.data(), format.stride[0]);
    const cv::Mat grey(4096, 4096, CV_8UC1, bytes.data() + format.grey_offset, format.grey_stride);
    cv::Mat opencv, difference;
    cv::cvtColor(bgr, opencv, cv::COLOR_BGR2GRAY);
    cv::absdiff(grey, opencv, difference);
    double greatest = 0;
    cv::minMaxLoc(difference, nullptr, &greatest);
    EXPECT_LE(greatest, 1);
    EXPECT_LT(cv::countNonZero(difference), (1 << 24) / 100);
}

TEST(Grey, ExpandsLimitedRangeYuyvButNotFullRange) {
    for (const auto range : {ARHOST_YUV_RANGE_LIMITED, ARHOST_YUV_RANGE_FULL}) {
        const auto format = layout(ARHOST_PIXEL_FORMAT_YUYV, 4, 1, range);
        std::vector<std::uint8_t> bytes(format.byte_size);
        const std::uint8_t row[] = {16, 7, 235, 7, 126, 7, 255, 7};
        std::copy(std::begin(row), std::end(row), bytes.begin());
        const std::uint8_t *planes[ARHOST_MAX_PLANES] = {bytes.data()};
        fill_grey(format, planes, bytes.data() + format.grey_offset);
        const std::vector<std::uint8_t> grey(bytes.begin() + std::ptrdiff_t(format.grey_offset),
                                             bytes.begin() + std::ptrdiff_t(format.grey_offset) + 4);
        EXPECT_EQ(grey, (range == ARHOST_YUV_RANGE_LIMITED ? std::vector<std::uint8_t>{0, 255, 128, 255}
                                                           : std::vector<std::uint8_t>{16, 235, 126, 255}));
    }
}

TEST(Grey, ExpandsALumaPlaneOfLimitedRangeAndLeavesPaddingUntouched) {
    for (const auto pixel_format : {ARHOST_PIXEL_FORMAT_NV12, ARHOST_PIXEL_FORMAT_I420}) {
        EXPECT_FALSE(has_limited_luma_plane(layout(pixel_format, 66, 4, ARHOST_YUV_RANGE_FULL)));
        const auto format = layout(pixel_format, 66, 4, ARHOST_YUV_RANGE_LIMITED);
        EXPECT_TRUE(has_limited_luma_plane(format));
        std::vector<std::uint8_t> luma(std::size_t{format.grey_stride} * format.height), grey(luma.size(), 7);
        for (std::size_t i = 0; i < luma.size(); ++i)
            luma[i] = static_cast<std::uint8_t>(i);
        expand_luma_plane(format, luma.data(), grey.data());
        for (std::size_t i = 0; i < grey.size(); ++i)
            EXPECT_EQ(grey[i], i % format.grey_stride < format.width ? full_range(luma[i]) : 7) << i;
    }
    for (const auto pixel_format : {ARHOST_PIXEL_FORMAT_GREY8, ARHOST_PIXEL_FORMAT_RGB8, ARHOST_PIXEL_FORMAT_YUYV})
        EXPECT_FALSE(has_limited_luma_plane(layout(pixel_format, 66, 4)));
}

} // namespace arhost
