// SPDX-License-Identifier: Apache-2.0
#include "raytracer_common/video.hpp"

#include <arhost/shading/lens.hpp>
#include <arhost/shading/scalar.hpp>

#include <algorithm>
#include <limits>

namespace arhost::raytracer_common {
namespace {

// Weights of red and blue in luma (ITU-R BT.601-7, BT.709-6).
struct LumaWeights {
    float red, blue;
};
LumaWeights weights_of(arhost_yuv_matrix matrix) {
    return matrix == ARHOST_YUV_MATRIX_BT709 ? LumaWeights{0.2126f, 0.0722f} : LumaWeights{0.299f, 0.114f};
}

std::uint8_t code_of(float value) {
    return static_cast<std::uint8_t>(std::clamp(value + 0.5f, 0.0f, 255.0f));
}

// Writes the colours of the frame's pixels with these Y', Cb and Cr codes.
class FromYuv {
public:
    explicit FromYuv(const arhost_frame_format &format)
        : weights_(weights_of(format.yuv_matrix)), is_limited_(format.yuv_range == ARHOST_YUV_RANGE_LIMITED) {}

    void write(std::uint8_t luma, std::uint8_t cb, std::uint8_t cr, std::uint8_t *to) const {
        const float y = is_limited_ ? (luma - 16.0f) * (255.0f / 219) : luma;
        const float scale = is_limited_ ? 255.0f / 224 : 1, b = (cb - 128.0f) * scale, r = (cr - 128.0f) * scale;
        const float red = y + 2 * (1 - weights_.red) * r, blue = y + 2 * (1 - weights_.blue) * b;
        const float green = (y - weights_.red * red - weights_.blue * blue) / (1 - weights_.red - weights_.blue);
        to[0] = code_of(red);
        to[1] = code_of(green);
        to[2] = code_of(blue);
    }

private:
    LumaWeights weights_;
    bool is_limited_;
};

} // namespace

void VideoImage::set(const arhost_frame &frame) {
    const arhost_frame_format &format = *frame.format;
    const FromYuv from_yuv(format);
    width_ = format.width;
    height_ = format.height;
    texels_.resize(std::size_t{4} * format.width * format.height, 255);
    std::uint8_t *to = texels_.data();
    for (std::size_t y = 0; y < format.height; ++y) {
        const auto row = [&](std::size_t plane, std::size_t at) {
            return frame.plane[plane] + at * format.stride[plane];
        };
        for (std::size_t x = 0; x < format.width; ++x, to += 4)
            switch (format.pixel_format) {
            case ARHOST_PIXEL_FORMAT_GREY8:
                std::fill_n(to, 3, row(0, y)[x]);
                break;
            case ARHOST_PIXEL_FORMAT_RGB8:
                std::copy_n(row(0, y) + 3 * x, 3, to);
                break;
            case ARHOST_PIXEL_FORMAT_BGR8:
                std::reverse_copy(row(0, y) + 3 * x, row(0, y) + 3 * x + 3, to);
                break;
            case ARHOST_PIXEL_FORMAT_YUYV: {
                const std::uint8_t *pair = row(0, y) + x / 2 * 4;
                from_yuv.write(pair[x % 2 * 2], pair[1], pair[3], to);
                break;
            }
            case ARHOST_PIXEL_FORMAT_NV12: {
                const std::uint8_t *chroma = row(1, y / 2) + x / 2 * 2;
                from_yuv.write(row(0, y)[x], chroma[0], chroma[1], to);
                break;
            }
            case ARHOST_PIXEL_FORMAT_I420:
                from_yuv.write(row(0, y)[x], row(1, y / 2)[x / 2], row(2, y / 2)[x / 2], to);
                break;
            }
    }
}

std::array<float, 3> VideoImage::mean() const {
    constexpr std::size_t step = 4;
    std::array<std::array<std::uint32_t, 256>, 3> counts{};
    std::uint32_t count = 0;
    for (std::size_t y = std::min(step / 2, height_ / 2); y < height_; y += step)
        for (std::size_t x = std::min(step / 2, width_ / 2); x < width_; x += step, ++count)
            for (std::size_t c = 0; c < 3; ++c)
                ++counts[c][texels_[4 * (y * width_ + x) + c]];
    std::array<double, 3> sum{};
    for (std::size_t code = 0; code < 256; ++code)
        for (std::size_t c = 0; c < 3; ++c)
            sum[c] += counts[c][code] * shading::srgb_decode(static_cast<double>(code) / 255);
    std::array<float, 3> mean{};
    std::ranges::transform(sum, mean.begin(),
                           [&](double each) { return static_cast<float>(each / std::max(count, 1u)); });
    return mean;
}

std::array<float, 3> environment_scale(const arhost_environment &environment, const VideoImage *video) {
    std::array<float, 3> scale{1, 1, 1};
    if (environment.follows_video) {
        constexpr float mid_grey = 0.18f;
        scale = {mid_grey, mid_grey, mid_grey};
        if (video) {
            const std::array<float, 3> mean = video->mean();
            const float luminance = 0.2126f * mean[0] + 0.7152f * mean[1] + 0.0722f * mean[2];
            std::ranges::transform(mean, scale.begin(), [&](float each) { return (each + luminance) / 2; });
        }
    }
    for (float &each : scale)
        each *= environment.intensity;
    return scale;
}

ColourTables::ColourTables() : srgb8(shading::make_srgb8_table()) {
    for (std::size_t code = 0; code < linear_of_srgb8.size(); ++code)
        linear_of_srgb8[code] = static_cast<float>(shading::srgb_decode(static_cast<double>(code) / 255));
}

Video video_through(const arhost_intrinsics &intrinsics, const ColourTables &tables, std::uint32_t width,
                    std::uint32_t height) {
    Video video{};
    video.image = {nullptr,
                   static_cast<std::int32_t>(intrinsics.width),
                   static_cast<std::int32_t>(intrinsics.height),
                   ARHOST_TEXEL_SRGB8,
                   ARHOST_WRAP_CLAMP,
                   ARHOST_WRAP_CLAMP};
    video.linear_of_srgb8 = tables.linear_of_srgb8.data();
    video.fx = static_cast<float>(intrinsics.fx);
    video.fy = static_cast<float>(intrinsics.fy);
    video.cx = static_cast<float>(intrinsics.cx);
    video.cy = static_cast<float>(intrinsics.cy);
    video.distortion = intrinsics.distortion;
    std::copy_n(intrinsics.coefficients, intrinsics.coefficient_count, video.coefficients);
    video.max_radius_squared = max_radius_squared(intrinsics);
    video.pixel_width = 1 / static_cast<float>(width);
    video.pixel_height = 1 / static_cast<float>(height);
    return video;
}

float max_radius_squared(const arhost_intrinsics &intrinsics) {
    if (intrinsics.distortion == ARHOST_DISTORTION_NONE)
        return std::numeric_limits<float>::infinity();
    const shading::Lens lens(intrinsics);
    double largest = 0;
    constexpr int steps = 64;
    for (int i = 0; i <= steps; ++i)
        for (int side = 0; side < 4; ++side) {
            const double along = static_cast<double>(i) / steps, x = side < 2 ? along : side - 2,
                         y = side < 2 ? side : along;
            const auto d = lens.ray({x * intrinsics.width - 0.5, y * intrinsics.height - 0.5});
            if (d && d->z > 0)
                largest = std::max(largest, (d->x * d->x + d->y * d->y) / (d->z * d->z));
        }
    return static_cast<float>(1.05 * largest);
}

} // namespace arhost::raytracer_common
