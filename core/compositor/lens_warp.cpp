// SPDX-License-Identifier: Apache-2.0
#include "compositor/lens_warp.hpp"

#include <arhost/shading/lens.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>

namespace arhost {
namespace {

constexpr double max_tangent = 4; // tan 76°
constexpr float no_source = -2;

} // namespace

LensWarp::LensWarp(const arhost_intrinsics &lens) : pinhole_(lens) {
    const shading::Lens distortion(lens);
    const std::size_t width = lens.width, height = lens.height;
    sources_.resize(width * height, {no_source, no_source});
    warped_.resize(4 * width * height);
    double max_x = 1e-3, max_y = 1e-3; // extent of the lens's view on the plane z = 1
    for (std::size_t y = 0; y < height; ++y)
        for (std::size_t x = 0; x < width; ++x) {
            const auto ray = distortion.ray({static_cast<double>(x), static_cast<double>(y)});
            if (!ray || ray->z <= 0 || std::hypot(ray->x, ray->y) > max_tangent * ray->z)
                continue;
            const double px = ray->x / ray->z, py = ray->y / ray->z;
            sources_[y * width + x] = {static_cast<float>(px), static_cast<float>(py)};
            max_x = std::max(max_x, std::abs(px));
            max_y = std::max(max_y, std::abs(py));
        }
    pinhole_.distortion = ARHOST_DISTORTION_NONE;
    pinhole_.coefficient_count = 0;
    std::fill_n(pinhole_.coefficients, ARHOST_MAX_DISTORTION, 0);
    pinhole_.cx = (lens.width - 1) / 2.0;
    pinhole_.cy = (lens.height - 1) / 2.0;
    pinhole_.fx = std::max(pinhole_.cx, 0.5) / max_x;
    pinhole_.fy = std::max(pinhole_.cy, 0.5) / max_y;
    for (Point &source : sources_)
        if (source.x != no_source)
            source = {static_cast<float>(source.x * pinhole_.fx + pinhole_.cx),
                      static_cast<float>(source.y * pinhole_.fy + pinhole_.cy)};
}

ImageView LensWarp::warp(const ImageView &image, const Region &region) {
    const std::size_t width = pinhole_.width, height = pinhole_.height;
    std::memset(warped_.data(), 0, warped_.size());
    // The region comes from an untrusted worker, so it is clipped to the image.
    const auto right = static_cast<float>(std::min<std::uint64_t>(std::uint64_t{region.x} + region.width, width));
    const auto bottom = static_cast<float>(std::min<std::uint64_t>(std::uint64_t{region.y} + region.height, height));
    const auto left = static_cast<float>(region.x), top = static_cast<float>(region.y);
    for (std::size_t i = 0; i < sources_.size(); ++i) {
        const Point &source = sources_[i];
        if (!(source.x > left - 1 && source.x < right && source.y > top - 1 && source.y < bottom))
            continue;
        const float x0 = std::floor(source.x), y0 = std::floor(source.y), across = source.x - x0,
                    down = source.y - y0;
        float sum[4] = {};
        for (int corner = 0; corner < 4; ++corner) {
            const float x = x0 + static_cast<float>(corner & 1), y = y0 + static_cast<float>(corner >> 1);
            if (x < left || x >= right || y < top || y >= bottom)
                continue;
            const std::uint8_t *pixel =
                image.rgba + static_cast<std::size_t>(y) * image.stride + 4 * static_cast<std::size_t>(x);
            const float weight = (corner & 1 ? across : 1 - across) * (corner >> 1 ? down : 1 - down);
            for (int c = 0; c < 3; ++c)
                sum[c] += weight * static_cast<float>(pixel[3]) * static_cast<float>(pixel[c]);
            sum[3] += weight * static_cast<float>(pixel[3]);
        }
        if (sum[3] <= 0)
            continue;
        for (int c = 0; c < 3; ++c)
            warped_[4 * i + c] = static_cast<std::uint8_t>(std::lround(sum[c] / sum[3]));
        warped_[4 * i + 3] = static_cast<std::uint8_t>(std::lround(sum[3]));
    }
    return {warped_.data(), 4 * width};
}

} // namespace arhost
