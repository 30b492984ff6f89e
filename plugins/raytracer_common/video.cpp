// SPDX-License-Identifier: Apache-2.0
#include "raytracer_common/video.hpp"

#include <arhost/shading/lens.hpp>
#include <arhost/shading/scalar.hpp>

#include <algorithm>
#include <cmath>
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

// Converts Y', Cb and Cr codes, in fixed point.
class FromYuv {
public:
    explicit FromYuv(const arhost_frame_format &format) {
        const auto [red, blue] = weights_of(format.yuv_matrix);
        const bool is_limited = format.yuv_range == ARHOST_YUV_RANGE_LIMITED;
        const float chroma = is_limited ? 255.0f / 224 : 1;
        black_ = is_limited ? 16 : 0;
        luma_ = fixed(is_limited ? 255.0f / 219 : 1);
        red_of_cr_ = fixed(2 * (1 - red) * chroma);
        blue_of_cb_ = fixed(2 * (1 - blue) * chroma);
        green_of_cr_ = fixed(-2 * (1 - red) * red / (1 - red - blue) * chroma);
        green_of_cb_ = fixed(-2 * (1 - blue) * blue / (1 - red - blue) * chroma);
    }

    // Writes two pixels, which have the same chroma.
    void write(std::uint8_t luma, std::uint8_t next_luma, std::uint8_t cb, std::uint8_t cr, std::uint8_t *to) const {
        const int u = cb - 128, v = cr - 128;
        const int red = v * red_of_cr_, green = u * green_of_cb_ + v * green_of_cr_, blue = u * blue_of_cb_;
        const auto write_one = [&](std::uint8_t code, std::uint8_t *pixel) {
            const int y = (code - black_) * luma_ + one / 2; // rounds
            pixel[0] = code_of(y + red);
            pixel[1] = code_of(y + green);
            pixel[2] = code_of(y + blue);
        };
        write_one(luma, to);
        write_one(next_luma, to + 4);
    }

private:
    static constexpr int shift = 16, one = 1 << shift;
    static int fixed(float value) { return static_cast<int>(std::lround(value * one)); }
    static std::uint8_t code_of(int value) { return static_cast<std::uint8_t>(std::clamp(value >> shift, 0, 255)); }

    int black_, luma_, red_of_cr_, blue_of_cb_, green_of_cr_, green_of_cb_;
};

} // namespace

void VideoImage::set(const arhost_frame &frame) {
    const arhost_frame_format &format = *frame.format;
    const FromYuv from_yuv(format);
    width_ = format.width;
    height_ = format.height;
    texels_.resize(std::size_t{4} * format.width * format.height, 255);
    for (std::size_t y = 0; y < format.height; ++y) {
        std::uint8_t *to = texels_.data() + std::size_t{4} * format.width * y;
        const auto row = [&](std::size_t plane, std::size_t at) {
            return frame.plane[plane] + at * format.stride[plane];
        };
        const std::uint8_t *from = row(0, y);
        const auto copy = [&](std::size_t step, std::size_t red, std::size_t green, std::size_t blue) {
            for (std::size_t x = 0; x < format.width; ++x) {
                to[4 * x] = from[step * x + red];
                to[4 * x + 1] = from[step * x + green];
                to[4 * x + 2] = from[step * x + blue];
            }
        };
        switch (format.pixel_format) {
        case ARHOST_PIXEL_FORMAT_GREY8:
            copy(1, 0, 0, 0);
            break;
        case ARHOST_PIXEL_FORMAT_RGB8:
            copy(3, 0, 1, 2);
            break;
        case ARHOST_PIXEL_FORMAT_BGR8:
            copy(3, 2, 1, 0);
            break;
        case ARHOST_PIXEL_FORMAT_YUYV:
            for (std::size_t x = 0; x < format.width; x += 2)
                from_yuv.write(from[2 * x], from[2 * x + 2], from[2 * x + 1], from[2 * x + 3], to + 4 * x);
            break;
        case ARHOST_PIXEL_FORMAT_NV12: {
            const std::uint8_t *chroma = row(1, y / 2);
            for (std::size_t x = 0; x < format.width; x += 2)
                from_yuv.write(from[x], from[x + 1], chroma[x], chroma[x + 1], to + 4 * x);
            break;
        }
        case ARHOST_PIXEL_FORMAT_I420: {
            const std::uint8_t *cb = row(1, y / 2), *cr = row(2, y / 2);
            for (std::size_t x = 0; x < format.width; x += 2)
                from_yuv.write(from[x], from[x + 1], cb[x / 2], cr[x / 2], to + 4 * x);
            break;
        }
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

Video video_through(const arhost_intrinsics &intrinsics, const ColourTables &tables) {
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
    video.pixel_width = 1 / static_cast<float>(intrinsics.width);
    video.pixel_height = 1 / static_cast<float>(intrinsics.height);
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
