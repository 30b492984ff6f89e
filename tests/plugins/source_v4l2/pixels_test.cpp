// SPDX-License-Identifier: Apache-2.0
//
// Copying of uncompressed pictures, with padded rows and in one or several planes of memory.
#include "pixels.hpp"

#include "camera_common/fourcc.hpp"

#include "plugin_under_test.hpp"

#include <gmock/gmock.h>

#include <vector>

using namespace arhost;
using arhost::test::GuardedBuffer;
using testing::HasSubstr;

namespace {

constexpr std::uint32_t width = 6, height = 4, padding = 2;

std::uint8_t value(std::size_t plane, std::size_t row, std::size_t byte) {
    return static_cast<std::uint8_t>(60 * plane + 11 * row + byte + 1);
}

struct MemoryPlane {
    std::uint32_t row_bytes, rows;
};

// A picture as a driver delivers it. Every row is followed by `padding` bytes.
struct Picture {
    PictureFormat format;
    std::vector<std::vector<std::uint8_t>> memory;
    std::vector<std::span<const std::uint8_t>> planes() const { return {memory.begin(), memory.end()}; }
};

// `colours`: the colour planes; `is_separate`: each in a plane of memory of its own, otherwise all in one.
Picture make_picture(std::uint32_t fourcc, const std::vector<MemoryPlane> &colours, bool is_separate = false) {
    Picture picture;
    picture.format = {fourcc, width, height, V4L2_COLORSPACE_SRGB, 0, 0, 0, {}};
    for (std::size_t p = 0; p < colours.size(); ++p) {
        // In one plane of memory, the stride of a chroma plane follows from that of the first plane.
        const std::uint32_t stride =
            is_separate || p == 0 ? colours[p].row_bytes + padding
                                  : (colours[0].row_bytes + padding) * colours[p].row_bytes / colours[0].row_bytes;
        if (is_separate || p == 0) {
            picture.memory.emplace_back();
            picture.format.strides.push_back(stride);
        }
        for (std::uint32_t y = 0; y < colours[p].rows; ++y)
            for (std::uint32_t i = 0; i < stride; ++i)
                picture.memory.back().push_back(i < colours[p].row_bytes ? value(p, y, i) : 0xee);
    }
    return picture;
}

struct Copied {
    bool good = false;
    std::string fault;
    arhost_frame_format format{};
    std::vector<std::vector<std::uint8_t>> planes; // without padding
};

Copied copy(const Picture &picture, const std::vector<MemoryPlane> &expected) {
    Copied copied;
    EXPECT_TRUE(describe(picture.format, copied.format));
    EXPECT_EQ(defect_of(picture.format), "");
    EXPECT_TRUE(arhost_frame_layout(&copied.format));
    GuardedBuffer slot(copied.format.byte_size);
    arhost_frame_buffer buffer{sizeof buffer, 0, &copied.format, {}, nullptr, nullptr, 0};
    for (std::uint32_t p = 0; p < copied.format.plane_count; ++p)
        buffer.plane[p] = slot.data() + copied.format.offset[p];
    copied.good = copy_picture(picture.format, picture.planes(), buffer, copied.fault);
    EXPECT_TRUE(slot.intact());
    for (std::size_t p = 0; p < expected.size(); ++p) {
        auto &bytes = copied.planes.emplace_back();
        for (std::uint32_t y = 0; y < expected[p].rows; ++y)
            for (std::uint32_t i = 0; i < expected[p].row_bytes; ++i)
                bytes.push_back(buffer.plane[p][y * copied.format.stride[p] + i]);
    }
    return copied;
}

using Planes = std::vector<MemoryPlane>;

void expect_unchanged(std::uint32_t fourcc, const Planes &planes, bool is_separate, arhost_pixel_format delivered) {
    SCOPED_TRACE(fourcc_text(fourcc));
    const Copied copied = copy(make_picture(fourcc, planes, is_separate), planes);
    EXPECT_TRUE(copied.good) << copied.fault;
    EXPECT_EQ(copied.format.pixel_format, delivered);
    for (std::size_t p = 0; p < planes.size(); ++p)
        for (std::uint32_t y = 0; y < planes[p].rows; ++y)
            for (std::uint32_t i = 0; i < planes[p].row_bytes; ++i)
                ASSERT_EQ(copied.planes[p][y * planes[p].row_bytes + i], value(p, y, i)) << p << " " << y << " " << i;
}

} // namespace

TEST(V4l2Pixels, AreCopiedUnchangedIfArhostHasTheFormat) {
    expect_unchanged(V4L2_PIX_FMT_YUYV, {{2 * width, height}}, false, ARHOST_PIXEL_FORMAT_YUYV);
    expect_unchanged(V4L2_PIX_FMT_RGB24, {{3 * width, height}}, false, ARHOST_PIXEL_FORMAT_RGB8);
    expect_unchanged(V4L2_PIX_FMT_BGR24, {{3 * width, height}}, false, ARHOST_PIXEL_FORMAT_BGR8);
    expect_unchanged(V4L2_PIX_FMT_GREY, {{width, height}}, false, ARHOST_PIXEL_FORMAT_GREY8);
    const Planes nv12 = {{width, height}, {width, height / 2}};
    expect_unchanged(V4L2_PIX_FMT_NV12, nv12, false, ARHOST_PIXEL_FORMAT_NV12);
    expect_unchanged(V4L2_PIX_FMT_NV12M, nv12, true, ARHOST_PIXEL_FORMAT_NV12);
    const Planes i420 = {{width, height}, {width / 2, height / 2}, {width / 2, height / 2}};
    expect_unchanged(V4L2_PIX_FMT_YUV420, i420, false, ARHOST_PIXEL_FORMAT_I420);
    expect_unchanged(V4L2_PIX_FMT_YUV420M, i420, true, ARHOST_PIXEL_FORMAT_I420);
}

TEST(V4l2Pixels, OfUyvyAreSwapped) {
    const Copied copied = copy(make_picture(V4L2_PIX_FMT_UYVY, {{2 * width, height}}), {{2 * width, height}});
    EXPECT_EQ(copied.format.pixel_format, ARHOST_PIXEL_FORMAT_YUYV);
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t i = 0; i < 2 * width; ++i)
            ASSERT_EQ(copied.planes[0][y * 2 * width + i], value(0, y, i ^ 1));
}

// The most significant 8 of 16, 12 or 10 bits. Values beyond the format's maximum become white.
TEST(V4l2Pixels, OfDeepGreyKeepTheUpperBits) {
    struct Case {
        std::uint32_t fourcc;
        std::array<std::uint8_t, 2> bytes;
        std::uint8_t expected;
    };
    for (const Case &c : {Case{V4L2_PIX_FMT_Y16, {0x34, 0xab}, 0xab}, Case{V4L2_PIX_FMT_Y16_BE, {0xab, 0x34}, 0xab},
                          Case{V4L2_PIX_FMT_Y12, {0x34, 0x0a}, 0xa3}, Case{V4L2_PIX_FMT_Y10, {0x34, 0x02}, 0x8d},
                          Case{V4L2_PIX_FMT_Y10, {0xff, 0x03}, 0xff}, Case{V4L2_PIX_FMT_Y10, {0x00, 0x40}, 0xff}}) {
        Picture picture = make_picture(c.fourcc, {{2 * width, height}});
        for (std::size_t i = 0; i + 1 < picture.memory[0].size(); i += 2)
            std::copy(c.bytes.begin(), c.bytes.end(), picture.memory[0].begin() + static_cast<std::ptrdiff_t>(i));
        const Copied copied = copy(picture, {{width, height}});
        EXPECT_EQ(copied.format.pixel_format, ARHOST_PIXEL_FORMAT_GREY8);
        EXPECT_THAT(copied.planes[0], testing::Each(c.expected)) << fourcc_text(c.fourcc);
    }
}

// The last row need not be padded.
TEST(V4l2Pixels, OfATruncatedPictureAreRejected) {
    const Planes i420 = {{width, height}, {width / 2, height / 2}, {width / 2, height / 2}};
    for (const bool is_separate : {false, true}) {
        const Picture whole =
            make_picture(is_separate ? V4L2_PIX_FMT_YUV420M : V4L2_PIX_FMT_YUV420, i420, is_separate);
        for (std::size_t m = 0; m < whole.memory.size(); ++m) {
            Picture picture = whole;
            const std::size_t unneeded = is_separate ? padding : padding / 2;
            picture.memory[m].resize(picture.memory[m].size() - unneeded);
            EXPECT_TRUE(copy(picture, i420).good);
            picture.memory[m].pop_back();
            const Copied copied = copy(picture, i420);
            EXPECT_FALSE(copied.good);
            EXPECT_THAT(copied.fault,
                        HasSubstr("it has only " + std::to_string(picture.memory[m].size()) + " bytes"));
        }
    }
    Picture missing = make_picture(V4L2_PIX_FMT_NV12M, {{width, height}, {width, height / 2}}, true);
    missing.memory.pop_back();
    EXPECT_FALSE(copy(missing, {{width, height}, {width, height / 2}}).good);
}

TEST(V4l2Pixels, WithTooShortRowsAreADefectOfTheDriver) {
    PictureFormat format{V4L2_PIX_FMT_YUV420M, width, height, 0, 0, 0, 0, {width, width / 2, width / 2 - 1}};
    EXPECT_EQ(defect_of(format), "rows of 2 bytes for 6 px");
    format.strides.back() = width / 2;
    EXPECT_EQ(defect_of(format), "");
}

TEST(V4l2Pixels, HaveTheMatrixAndRangeOfTheDriver) {
    const auto picture = [](std::uint32_t fourcc, std::uint32_t colorspace, std::uint32_t encoding = 0,
                            std::uint32_t quantization = 0, std::uint32_t transfer = 0) {
        return PictureFormat{fourcc, width, height, colorspace, encoding, quantization, transfer, {width}};
    };
    arhost_frame_format format{};
    ASSERT_TRUE(describe(picture(V4L2_PIX_FMT_NV12, V4L2_COLORSPACE_REC709), format));
    EXPECT_EQ(format.yuv_matrix, ARHOST_YUV_MATRIX_BT709);
    EXPECT_EQ(format.yuv_range, ARHOST_YUV_RANGE_LIMITED);
    ASSERT_TRUE(
        describe(picture(V4L2_PIX_FMT_NV12, V4L2_COLORSPACE_REC709, V4L2_YCBCR_ENC_601, V4L2_QUANTIZATION_FULL_RANGE),
                 format));
    EXPECT_EQ(format.yuv_matrix, ARHOST_YUV_MATRIX_BT601);
    EXPECT_EQ(format.yuv_range, ARHOST_YUV_RANGE_FULL);
    EXPECT_EQ(format.transfer, ARHOST_TRANSFER_SRGB);
    ASSERT_TRUE(describe(picture(V4L2_PIX_FMT_GREY, V4L2_COLORSPACE_RAW), format));
    EXPECT_EQ(format.transfer, ARHOST_TRANSFER_LINEAR);
    ASSERT_TRUE(describe(picture(V4L2_PIX_FMT_GREY, V4L2_COLORSPACE_SRGB, 0, 0, V4L2_XFER_FUNC_NONE), format));
    EXPECT_EQ(format.transfer, ARHOST_TRANSFER_LINEAR);
    EXPECT_TRUE(has_known_matrix(picture(V4L2_PIX_FMT_NV12, V4L2_COLORSPACE_REC709)));
    EXPECT_FALSE(has_known_matrix(picture(V4L2_PIX_FMT_NV12, V4L2_COLORSPACE_BT2020)));
    EXPECT_TRUE(has_known_matrix(picture(V4L2_PIX_FMT_RGB24, V4L2_COLORSPACE_BT2020)));
    EXPECT_FALSE(describe(picture(V4L2_PIX_FMT_MJPEG, 0), format));
}
