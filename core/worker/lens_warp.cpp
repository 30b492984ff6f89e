// SPDX-License-Identifier: Apache-2.0
#include "worker/lens_warp.hpp"

#include "ipc/protocol.hpp"
#include "pixels/linear.hpp"

#include <arhost/shading/lens.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>

namespace arhost::worker {
namespace {

constexpr double max_tangent = 4; // tan 76°
constexpr float no_source = -2;
constexpr std::size_t page = 4096; // alignment of arhost_image.rgba

} // namespace

void set_pixels(arhost_image &image, arhost_image_form form, void *pixels) {
    if (form == ARHOST_IMAGE_FORM_LINEAR)
        image.linear = static_cast<std::uint16_t *>(pixels);
    else
        image.rgba = static_cast<std::uint8_t *>(pixels);
}

LensWarp::LensWarp(const arhost_intrinsics &lens, arhost_image_form form, const std::function<void(double)> &progress)
    : pinhole_(lens), form_(form) {
    const shading::Lens distortion(lens);
    const std::size_t width = lens.width, height = lens.height;
    sources_.resize(width * height, {no_source, no_source});
    // One page more for the alignment, and one for the rest of the last page.
    pixels_.resize(std::size_t{ipc::overlay_stride(lens.width, form)} * height + 2 * page);
    double max_x = 1e-3, max_y = 1e-3; // extent of the lens's view on the plane z = 1
    for (std::size_t y = 0; y < height; ++y) {
        if (progress)
            progress(static_cast<double>(y) / static_cast<double>(height));
        for (std::size_t x = 0; x < width; ++x) {
            const auto ray = distortion.ray({static_cast<double>(x), static_cast<double>(y)});
            if (!ray || ray->z <= 0 || std::hypot(ray->x, ray->y) > max_tangent * ray->z)
                continue;
            const double px = ray->x / ray->z, py = ray->y / ray->z;
            sources_[y * width + x] = {static_cast<float>(px), static_cast<float>(py)};
            max_x = std::max(max_x, std::abs(px));
            max_y = std::max(max_y, std::abs(py));
        }
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

arhost_image LensWarp::pinhole_image() {
    arhost_image image{};
    image.struct_size = sizeof image;
    image.stride = ipc::overlay_stride(pinhole_.width, form_);
    image.width = pinhole_.width;
    image.height = pinhole_.height;
    void *at = pixels_.data();
    std::size_t room = pixels_.size();
    set_pixels(image, form_, std::align(page, room - page, at, room));
    return image;
}

void LensWarp::warp(const arhost_render_info &info, const arhost_image &lens_image) {
    const arhost_image image = pinhole_image();
    const std::size_t width = pinhole_.width, height = pinhole_.height;
    // The region comes from the plugin, so it is clipped to the image.
    const auto end = [](std::uint32_t first, std::uint32_t count, std::size_t limit) {
        return static_cast<float>(std::min<std::uint64_t>(std::uint64_t{first} + count, limit));
    };
    const bool has_region = info.has_region != 0;
    const float left = has_region ? static_cast<float>(info.region_x) : 0,
                top = has_region ? static_cast<float>(info.region_y) : 0;
    const float right = has_region ? end(info.region_x, info.region_width, width) : static_cast<float>(width),
                bottom = has_region ? end(info.region_y, info.region_height, height) : static_cast<float>(height);
    // Calls add(x, y, weight) for the pixels of the pinhole image between which the source lies.
    const auto for_each_neighbour = [&](const Point &source, const auto &add) {
        const float x0 = std::floor(source.x), y0 = std::floor(source.y), across = source.x - x0,
                    down = source.y - y0;
        for (int corner = 0; corner < 4; ++corner) {
            const float x = x0 + static_cast<float>(corner & 1), y = y0 + static_cast<float>(corner >> 1);
            if (x >= left && x < right && y >= top && y < bottom)
                add(static_cast<std::size_t>(x), static_cast<std::size_t>(y),
                    (corner & 1 ? across : 1 - across) * (corner >> 1 ? down : 1 - down));
        }
    };
    const auto is_inside = [&](const Point &source) {
        return source.x > left - 1 && source.x < right && source.y > top - 1 && source.y < bottom;
    };
    for (std::size_t row = 0; row < height; ++row) {
        const Point *source = &sources_[row * width];
        if (form_ == ARHOST_IMAGE_FORM_LINEAR) {
            auto *out = reinterpret_cast<LinearPixel *>(reinterpret_cast<std::byte *>(lens_image.linear) +
                                                        row * lens_image.stride);
            for (std::size_t column = 0; column < width; ++column, ++source, ++out) {
                *out = untouched;
                if (!is_inside(*source))
                    continue;
                LinearSum sum;
                for_each_neighbour(*source, [&](std::size_t x, std::size_t y, float weight) {
                    sum.add(reinterpret_cast<const LinearPixel *>(reinterpret_cast<const std::byte *>(image.linear) +
                                                                  y * image.stride)[x],
                            weight);
                });
                *out = sum.pixel();
            }
            continue;
        }
        std::uint8_t *out = lens_image.rgba + row * lens_image.stride;
        std::memset(out, 0, 4 * width);
        for (std::size_t column = 0; column < width; ++column, ++source, out += 4) {
            if (!is_inside(*source))
                continue;
            float sum[4] = {};
            for_each_neighbour(*source, [&](std::size_t x, std::size_t y, float weight) {
                const std::uint8_t *pixel = image.rgba + y * image.stride + 4 * x;
                for (int c = 0; c < 3; ++c)
                    sum[c] += weight * static_cast<float>(pixel[3]) * static_cast<float>(pixel[c]);
                sum[3] += weight * static_cast<float>(pixel[3]);
            });
            if (sum[3] <= 0)
                continue;
            for (int c = 0; c < 3; ++c)
                out[c] = static_cast<std::uint8_t>(std::lround(sum[c] / sum[3]));
            out[3] = static_cast<std::uint8_t>(std::lround(sum[3]));
        }
    }
}

} // namespace arhost::worker
