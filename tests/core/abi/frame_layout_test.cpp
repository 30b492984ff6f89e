// SPDX-License-Identifier: Apache-2.0
#include <arhost/arhost.h>

#include <gtest/gtest.h>

namespace {

arhost_frame_format format_of(arhost_pixel_format pixel_format, std::uint32_t width, std::uint32_t height) {
    arhost_frame_format format{};
    format.pixel_format = pixel_format;
    format.width = width;
    format.height = height;
    return format;
}

} // namespace

TEST(FrameLayout, AlignsRowsAndPlanes) {
    arhost_frame_format format = format_of(ARHOST_PIXEL_FORMAT_BGR8, 101, 7);
    ASSERT_TRUE(arhost_frame_layout(&format));
    EXPECT_EQ(format.stride[0], 320u);
    EXPECT_EQ(format.grey_offset, 320u * 7);
    EXPECT_EQ(format.grey_stride, 128u);
    EXPECT_EQ(format.byte_size, 320u * 7 + 128u * 7);
}

TEST(FrameLayout, UsesTheLumaPlaneAsTheGreyPlane) {
    arhost_frame_format format = format_of(ARHOST_PIXEL_FORMAT_I420, 100, 50);
    ASSERT_TRUE(arhost_frame_layout(&format));
    EXPECT_EQ(format.plane_count, 3u);
    EXPECT_EQ(format.grey_offset, 0u);
    EXPECT_EQ(format.grey_stride, format.stride[0]);
    EXPECT_EQ(format.stride[1], 64u);
    EXPECT_EQ(format.byte_size, 128u * 50 + 2u * 64 * 25);
}

TEST(FrameLayout, RejectsInvalidFormats) {
    for (auto [pixel_format, width, height] : {std::tuple{ARHOST_PIXEL_FORMAT_YUYV, 101, 8},
                                               {ARHOST_PIXEL_FORMAT_NV12, 100, 7},
                                               {ARHOST_PIXEL_FORMAT_I420, 99, 8},
                                               {ARHOST_PIXEL_FORMAT_BGR8, 0, 8},
                                               {ARHOST_PIXEL_FORMAT_BGR8, 8, 20000}}) {
        arhost_frame_format format =
            format_of(pixel_format, static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height));
        EXPECT_FALSE(arhost_frame_layout(&format));
    }
    arhost_frame_format unknown = format_of(0, 8, 8);
    EXPECT_FALSE(arhost_frame_layout(&unknown));
}
