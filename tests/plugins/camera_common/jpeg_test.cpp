// SPDX-License-Identifier: Apache-2.0
//
// Decoding of Motion-JPEG, including damaged pictures.
#include "camera_common/jpeg.hpp"

#include "../../support/plugin_under_test.hpp"

#include <gmock/gmock.h>

#include <turbojpeg.h>

#include <array>
#include <memory>
#include <random>

using arhost::JpegDecoder;
using arhost::test::GuardedBuffer;
using testing::HasSubstr;
using Bytes = std::vector<std::uint8_t>;

namespace {

// Returns a smooth BGR picture in which red increases to the right and green increases downwards.
Bytes smooth_bgr(int width, int height) {
    Bytes pixels;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            for (const int c : {60, y * 255 / height, x * 255 / width})
                pixels.push_back(static_cast<std::uint8_t>(c));
    return pixels;
}

Bytes make_jpeg(int width, int height, int subsampling) {
    const Bytes pixels = smooth_bgr(width, height);
    tjhandle handle = tjInitCompress();
    unsigned char *data = nullptr;
    unsigned long size = 0;
    EXPECT_EQ(tjCompress2(handle, pixels.data(), width, 0, height, TJPF_BGR, &data, &size, subsampling, 95, 0), 0);
    const Bytes jpeg(data, data + size);
    tjFree(data);
    tjDestroy(handle);
    return jpeg;
}

struct Decoded {
    bool good = false;
    std::string fault;
    arhost_frame_format format{};
    std::unique_ptr<GuardedBuffer> slot;
    std::uint8_t at(std::uint32_t plane, std::size_t x, std::size_t y) const {
        return slot->data()[format.offset[plane] + y * format.stride[plane] + x];
    }
};

// Decodes `jpeg` as a later picture of a stream whose first picture is `like`, which determines the format.
Decoded decode(const Bytes &jpeg, const Bytes &like) {
    JpegDecoder decoder;
    Decoded result;
    EXPECT_TRUE(decoder.describe(like, result.format));
    EXPECT_TRUE(arhost_frame_layout(&result.format));
    result.slot = std::make_unique<GuardedBuffer>(result.format.byte_size);
    std::array<std::uint8_t *, ARHOST_MAX_PLANES> planes{};
    for (std::uint32_t p = 0; p < result.format.plane_count; ++p)
        planes[p] = result.slot->data() + result.format.offset[p];
    result.good = decoder.decode(jpeg, result.format, planes.data(), result.fault);
    EXPECT_TRUE(result.slot->intact());
    return result;
}

Decoded decode(const Bytes &jpeg) {
    return decode(jpeg, jpeg);
}

// Returns a copy of the JPEG picture without its segments of type `marker`. 0xc4 are the Huffman tables.
Bytes without_segments(const Bytes &jpeg, std::uint8_t marker) {
    Bytes result(jpeg.begin(), jpeg.begin() + 2);
    std::size_t at = 2;
    while (at + 4 <= jpeg.size() && jpeg[at] == 0xff && jpeg[at + 1] != 0xda) {
        const std::size_t size = 2 + (std::size_t{jpeg[at + 2]} << 8 | jpeg[at + 3]);
        if (jpeg[at + 1] != marker)
            result.insert(result.end(), jpeg.begin() + static_cast<std::ptrdiff_t>(at),
                          jpeg.begin() + static_cast<std::ptrdiff_t>(at + size));
        at += size;
    }
    result.insert(result.end(), jpeg.begin() + static_cast<std::ptrdiff_t>(at), jpeg.end());
    return result;
}

} // namespace

TEST(Jpeg, Chroma420BecomesI420WithoutConversion) {
    const Decoded frame = decode(make_jpeg(96, 64, TJSAMP_420));
    ASSERT_TRUE(frame.good) << frame.fault;
    ASSERT_EQ(frame.format.pixel_format, ARHOST_PIXEL_FORMAT_I420);
    EXPECT_EQ(frame.format.yuv_matrix, ARHOST_YUV_MATRIX_BT601);
    EXPECT_EQ(frame.format.yuv_range, ARHOST_YUV_RANGE_FULL);
    // The expected values follow from the original picture by the JFIF formula.
    const Bytes pixels = smooth_bgr(96, 64);
    for (std::size_t y = 0; y < 64; ++y)
        for (std::size_t x = 0; x < 96; ++x) {
            const std::uint8_t *bgr = &pixels[3 * (y * 96 + x)];
            ASSERT_NEAR(frame.at(0, x, y), 0.299 * bgr[2] + 0.587 * bgr[1] + 0.114 * bgr[0], 4);
            ASSERT_NEAR(frame.at(1, x / 2, y / 2), 128 - 0.168736 * bgr[2] - 0.331264 * bgr[1] + 0.5 * bgr[0], 5);
            ASSERT_NEAR(frame.at(2, x / 2, y / 2), 128 + 0.5 * bgr[2] - 0.418688 * bgr[1] - 0.081312 * bgr[0], 5);
        }
}

TEST(Jpeg, OtherSubsamplingsAndOddSizesBecomeBgr) {
    struct Case {
        int width, height, subsampling;
    };
    for (const Case &c : {Case{96, 64, TJSAMP_422}, Case{96, 64, TJSAMP_444}, Case{96, 64, TJSAMP_440},
                          Case{97, 63, TJSAMP_420}, Case{1, 1, TJSAMP_420}}) {
        SCOPED_TRACE(std::to_string(c.width) + "×" + std::to_string(c.height) + " " + std::to_string(c.subsampling));
        const Decoded frame = decode(make_jpeg(c.width, c.height, c.subsampling));
        ASSERT_TRUE(frame.good) << frame.fault;
        ASSERT_EQ(frame.format.pixel_format, ARHOST_PIXEL_FORMAT_BGR8);
        const Bytes pixels = smooth_bgr(c.width, c.height);
        for (std::size_t y = 0; y < static_cast<std::size_t>(c.height); ++y)
            for (std::size_t i = 0; i < static_cast<std::size_t>(3 * c.width); ++i)
                ASSERT_NEAR(frame.at(0, i, y), pixels[y * static_cast<std::size_t>(3 * c.width) + i], 8);
    }
}

TEST(Jpeg, GreyStaysGrey) {
    const Decoded frame = decode(make_jpeg(33, 21, TJSAMP_GRAY));
    ASSERT_TRUE(frame.good) << frame.fault;
    ASSERT_EQ(frame.format.pixel_format, ARHOST_PIXEL_FORMAT_GREY8);
    const Bytes pixels = smooth_bgr(33, 21);
    for (std::size_t y = 0; y < 21; ++y)
        for (std::size_t x = 0; x < 33; ++x) {
            const std::uint8_t *bgr = &pixels[3 * (y * 33 + x)];
            ASSERT_NEAR(frame.at(0, x, y), 0.299 * bgr[2] + 0.587 * bgr[1] + 0.114 * bgr[0], 4);
        }
}

TEST(Jpeg, UsesTheStandardTablesIfItHasNoHuffmanTables) {
    const Bytes whole = make_jpeg(96, 64, TJSAMP_420), bare = without_segments(whole, 0xc4);
    ASSERT_LT(bare.size(), whole.size());
    const Decoded expected = decode(whole, whole), frame = decode(bare, whole);
    ASSERT_TRUE(frame.good) << frame.fault;
    for (std::size_t y = 0; y < 64; ++y)
        for (std::size_t x = 0; x < 96; ++x)
            ASSERT_EQ(frame.at(0, x, y), expected.at(0, x, y));
}

TEST(Jpeg, IsIntactIfItsEndIsPadded) {
    const Bytes whole = make_jpeg(96, 64, TJSAMP_422);
    Bytes padded = whole;
    padded.insert(padded.end() - 2, 5, 0);
    padded.insert(padded.end(), 300, 0);
    const Decoded frame = decode(padded, whole);
    EXPECT_TRUE(frame.good) << frame.fault;
}

TEST(Jpeg, TruncatedAnywhereIsDamaged) {
    for (const int subsampling : {TJSAMP_420, TJSAMP_422, TJSAMP_GRAY}) {
        const Bytes whole = make_jpeg(96, 64, subsampling);
        for (std::size_t size = 0; size < whole.size() - 2; size += size < 700 ? 1 : 37) {
            const Decoded frame =
                decode(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size)), whole);
            ASSERT_FALSE(frame.good) << size << " of " << whole.size() << " bytes";
            ASSERT_NE(frame.fault, "");
        }
    }
}

TEST(Jpeg, IsDamagedIfItsSizeOrSubsamplingChanges) {
    const Bytes first = make_jpeg(96, 64, TJSAMP_420);
    EXPECT_THAT(decode(make_jpeg(80, 64, TJSAMP_420), first).fault, HasSubstr("80×64"));
    EXPECT_THAT(decode(make_jpeg(192, 128, TJSAMP_420), first).fault, HasSubstr("192×128"));
    EXPECT_THAT(decode(make_jpeg(96, 64, TJSAMP_422), first).fault, HasSubstr("subsampling"));
    EXPECT_TRUE(decode(make_jpeg(96, 64, TJSAMP_420), make_jpeg(96, 64, TJSAMP_422)).good)
        << "both subsamplings are decoded to BGR, so the format stays the same";
}

TEST(Jpeg, GarbageIsRejected) {
    const Bytes whole = make_jpeg(96, 64, TJSAMP_420);
    Bytes garbage(4000);
    std::minstd_rand random(7);
    for (std::uint8_t &byte : garbage)
        byte = static_cast<std::uint8_t>(random());
    arhost_frame_format format{};
    EXPECT_FALSE(JpegDecoder().describe(garbage, format));
    EXPECT_FALSE(JpegDecoder().describe({}, format));
    EXPECT_FALSE(decode(garbage, whole).good);
    EXPECT_FALSE(decode({}, whole).good);
    // Wherever a picture is damaged, the decoder must not write outside the slot.
    for (int round = 0; round < 300; ++round) {
        Bytes damaged = whole;
        for (int i = 0; i < 8; ++i)
            damaged.at(random() % damaged.size()) = static_cast<std::uint8_t>(random());
        decode(damaged, whole); // checks the guard bytes
    }
}
