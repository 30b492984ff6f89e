// SPDX-License-Identifier: Apache-2.0
#include "negotiation.hpp"

#include <gtest/gtest.h>

using namespace arhost::uvc;

TEST(Probe, HasTheSizeOfTheVersionOfTheClass) {
    EXPECT_EQ(probe_size(0x0100), 26u);
    EXPECT_EQ(probe_size(0x0110), 34u);
    EXPECT_EQ(probe_size(0x0150), 48u);
}

TEST(Probe, RequestsFormatFrameAndInterval) {
    for (const std::size_t size : {26u, 34u, 48u}) {
        const auto bytes = encode_probe({3, 4, 0x01020304, 99, 99, 99}, size);
        ASSERT_EQ(bytes.size(), size);
        std::vector<std::uint8_t> expected(size);
        const std::vector<std::uint8_t> first = {1, 0, 3, 4, 4, 3, 2, 1};
        std::copy(first.begin(), first.end(), expected.begin());
        EXPECT_EQ(bytes, expected) << "the camera decides the rest";
    }
}

TEST(Probe, IsReadInEveryVersion) {
    std::vector<std::uint8_t> bytes(48);
    for (std::size_t i = 0; i < bytes.size(); ++i)
        bytes[i] = static_cast<std::uint8_t>(i);
    const auto probe = decode_probe(bytes);
    ASSERT_TRUE(probe);
    EXPECT_EQ(probe->format, 2);
    EXPECT_EQ(probe->frame, 3);
    EXPECT_EQ(probe->interval, 0x07060504u);
    EXPECT_EQ(probe->max_frame_bytes, 0x15141312u);
    EXPECT_EQ(probe->max_payload_bytes, 0x19181716u);
    EXPECT_EQ(probe->clock_hz, 0x1d1c1b1au);
    bytes.resize(26);
    EXPECT_EQ(decode_probe(bytes)->clock_hz, 0u);
    bytes[24] = bytes[25] = 0xff;
    EXPECT_EQ(decode_probe(bytes)->max_payload_bytes, 0x1716u) << "the sign of a 16-bit number is extended";
    bytes.resize(25);
    EXPECT_FALSE(decode_probe(bytes));
}

TEST(FrameBytes, AreExactForUncompressedFormatsAndBoundedForMjpeg) {
    Format format;
    FrameSize frame;
    frame.width = 640;
    frame.height = 480;
    format.encoding = Encoding::yuy2;
    EXPECT_EQ(max_frame_bytes(format, frame, 5), 614400u);
    format.encoding = Encoding::nv12;
    EXPECT_EQ(max_frame_bytes(format, frame, 0xffffffff), 460800u);
    format.encoding = Encoding::mjpeg;
    EXPECT_EQ(exact_frame_bytes(format.encoding, 640, 480), 0u);
    EXPECT_EQ(max_frame_bytes(format, frame, 0), 640u * 480 / 2 + 65536);
    EXPECT_EQ(max_frame_bytes(format, frame, 614400), 614400u);
    EXPECT_EQ(max_frame_bytes(format, frame, 0xffffffff), 640u * 480 * 3 + 65536) << "a camera may lie";
}

TEST(AlternateSetting, HasTheLeastSufficientBandwidth) {
    StreamingInterface stream;
    EXPECT_EQ(choose_alternate(stream, 0), nullptr);
    for (const std::uint32_t bytes : {192u, 3060u, 944u, 384u})
        stream.alternates.push_back({static_cast<std::uint8_t>(bytes & 0xff), 0x81, false, bytes, bytes});
    EXPECT_EQ(choose_alternate(stream, 0)->payload_bytes, 192u);
    EXPECT_EQ(choose_alternate(stream, 192)->payload_bytes, 192u);
    EXPECT_EQ(choose_alternate(stream, 193)->payload_bytes, 384u);
    EXPECT_EQ(choose_alternate(stream, 1000)->payload_bytes, 3060u);
    EXPECT_EQ(choose_alternate(stream, 3061), nullptr);
    stream.alternates = {{0, 0x81, true, 512, 512}};
    EXPECT_EQ(choose_alternate(stream, 1 << 20)->payload_bytes, 512u) << "a bulk payload needs several packets";
}
