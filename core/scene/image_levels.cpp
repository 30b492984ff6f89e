// SPDX-License-Identifier: Apache-2.0
#include "scene/image_levels.hpp"

#include "scene/srgb.hpp"

#include <arhost/shading/srgb8.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

namespace arhost::scene {
namespace {

// Converts texels to and from four floats in linear light.
struct Codec {
    explicit Codec(arhost_texel_format format) : format_(format) {
        for (std::size_t i = 0; i < light_.size(); ++i)
            light_[i] =
                static_cast<float>(format == ARHOST_TEXEL_SRGB8 ? linear_from_srgb(static_cast<double>(i) / 255)
                                                                : static_cast<double>(i) / 255);
    }
    std::size_t texel_size() const { return format_ == ARHOST_TEXEL_RGBA32F ? 16 : 4; }

    void add(const std::byte *texel, std::array<float, 4> &sum) const {
        if (format_ == ARHOST_TEXEL_RGBA32F) {
            std::array<float, 4> values;
            std::memcpy(values.data(), texel, sizeof values);
            for (std::size_t i = 0; i < 4; ++i)
                sum[i] += values[i];
            return;
        }
        for (std::size_t i = 0; i < 3; ++i)
            sum[i] += light_[std::to_integer<std::size_t>(texel[i])];
        sum[3] += static_cast<float>(std::to_integer<int>(texel[3])) / 255;
    }
    void write(const std::array<float, 4> &values, std::byte *texel) const {
        if (format_ == ARHOST_TEXEL_RGBA32F) {
            std::memcpy(texel, values.data(), sizeof values);
            return;
        }
        for (std::size_t i = 0; i < 4; ++i)
            texel[i] = static_cast<std::byte>(format_ == ARHOST_TEXEL_SRGB8 && i < 3
                                                  ? codes_(values[i])
                                                  : static_cast<int>(std::lround(values[i] * 255)));
    }

private:
    arhost_texel_format format_;
    std::array<float, 256> light_;
    shading::Srgb8Table codes_ = shading::make_srgb8_table();
};

} // namespace

void add_levels(TexelImage &image) {
    const std::uint32_t count = levels_of(image);
    const Codec codec(image.format);
    const std::size_t size = codec.texel_size();
    // NOLINTNEXTLINE(clang-analyzer-cplusplus.NewDeleteLeaks): a std::unique_ptr owns it
    Texels all = Texels::of_size(texel_count(image.width, image.height, count) * size);
    std::memcpy(all.bytes.get(), image.texels.bytes.get(), image.texels.size);
    const std::byte *from = all.bytes.get();
    std::byte *to = all.bytes.get() + image.texels.size;
    for (std::uint32_t level = 1; level < count; ++level) {
        const std::size_t from_width = std::max(image.width >> (level - 1), 1u),
                          from_height = std::max(image.height >> (level - 1), 1u),
                          width = std::max(image.width >> level, 1u), height = std::max(image.height >> level, 1u);
        std::byte *next = to;
        for (std::size_t y = 0; y < height; ++y) {
            // All texels that the new one covers at least in part: three of an odd number.
            const std::size_t y0 = y * from_height / height, y1 = ((y + 1) * from_height + height - 1) / height;
            for (std::size_t x = 0; x < width; ++x, next += size) {
                const std::size_t x0 = x * from_width / width, x1 = ((x + 1) * from_width + width - 1) / width;
                std::array<float, 4> sum{};
                for (std::size_t row = y0; row < y1; ++row)
                    for (std::size_t column = x0; column < x1; ++column)
                        codec.add(from + (row * from_width + column) * size, sum);
                for (float &value : sum)
                    value /= static_cast<float>((y1 - y0) * (x1 - x0));
                codec.write(sum, next);
            }
        }
        from = to;
        to = next;
    }
    image.texels = std::move(all);
    image.level_count = count;
}

} // namespace arhost::scene
