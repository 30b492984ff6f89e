// SPDX-License-Identifier: Apache-2.0
#include "scene/image_levels.hpp"

#include <gtest/gtest.h>

#include <cstring>

namespace arhost::scene {
namespace {

TexelImage image_of(arhost_texel_format format, std::uint32_t width, std::uint32_t height, const void *texels,
                    std::size_t size) {
    TexelImage image{format, width, height, Texels::of_size(size)};
    std::memcpy(image.texels.bytes.get(), texels, size);
    return image;
}

int byte_at(const TexelImage &image, std::size_t texel, std::size_t channel) {
    return std::to_integer<int>(image.texels.bytes[4 * texel + channel]);
}

} // namespace

TEST(ImageLevels, AreMeansInLinearLight) {
    const unsigned char two[] = {255, 0, 188, 0, 0, 0, 188, 255};
    TexelImage colours = image_of(ARHOST_TEXEL_SRGB8, 2, 1, two, sizeof two);
    add_levels(colours);
    EXPECT_EQ(colours.level_count, 2u);
    EXPECT_EQ(colours.texels.size, 12u);
    EXPECT_EQ(byte_at(colours, 0, 0), 255) << "the image itself";
    EXPECT_EQ(byte_at(colours, 2, 0), 188) << "half the light";
    EXPECT_EQ(byte_at(colours, 2, 2), 188);
    EXPECT_EQ(byte_at(colours, 2, 3), 128) << "alpha is linear";
    TexelImage data = image_of(ARHOST_TEXEL_RGBA8, 2, 1, two, sizeof two);
    add_levels(data);
    EXPECT_EQ(byte_at(data, 2, 0), 128);
}

TEST(ImageLevels, HalveOddSidesDownToOneTexel) {
    const float texels[5 * 3 * 4] = {};
    TexelImage image = image_of(ARHOST_TEXEL_RGBA32F, 5, 3, texels, sizeof texels);
    for (int i = 0; i < 15; ++i) {
        const float column = static_cast<float>(i % 5);
        std::memcpy(image.texels.bytes.get() + 16 * i, &column, sizeof column);
    }
    add_levels(image);
    EXPECT_EQ(image.level_count, 3u); // 5 × 3, 2 × 1, 1 × 1
    ASSERT_EQ(image.texels.size, 16u * (15 + 2 + 1));
    EXPECT_EQ(texel_count(5, 3, 3), 18u);
    float value[3];
    for (int i = 0; i < 3; ++i)
        std::memcpy(&value[i], image.texels.bytes.get() + std::ptrdiff_t{16} * (15 + i), sizeof value[i]);
    EXPECT_EQ(value[0], 1);
    EXPECT_EQ(value[1], 3);
    EXPECT_EQ(value[2], 2);
}

} // namespace arhost::scene
