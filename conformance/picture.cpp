// SPDX-License-Identifier: Apache-2.0
#include "conformance/picture.hpp"

#include <fmt/format.h>
#include <png.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <stdexcept>

namespace arhost::conformance {
namespace {

std::string base64(const std::vector<std::uint8_t> &bytes) {
    constexpr const char *digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text;
    text.reserve((bytes.size() + 2) / 3 * 4);
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
        std::uint32_t bits = 0;
        for (std::size_t k = 0; k < 3; ++k)
            bits = bits << 8 | (k < count ? bytes[i + k] : 0);
        for (std::size_t k = 0; k < 4; ++k)
            text += k <= count ? digits[bits >> (18 - 6 * k) & 63] : '=';
    }
    return text;
}

} // namespace

GuardedImage::GuardedImage(std::uint32_t width, std::uint32_t height, std::size_t pixel_bytes, std::uint8_t fill)
    : width_(width), height_(height), pixel_bytes_(pixel_bytes),
      stride_(static_cast<std::uint32_t>((pixel_bytes * width + 63) / 64 * 64 + 64)),
      memory_((2 * guard_size + std::size_t{stride_} * height + sizeof(Page) - 1) / sizeof(Page)) {
    std::memset(bytes(), guard, memory_.size() * sizeof(Page));
    for (std::uint32_t y = 0; y < height; ++y)
        std::memset(pixel(0, y), fill, pixel_bytes * width);
}

std::string GuardedImage::damage() const {
    const auto first_in = [&](std::size_t begin, std::size_t end) -> std::optional<std::size_t> {
        for (std::size_t i = begin; i < end; ++i)
            if (bytes()[i] != guard)
                return i - begin;
        return std::nullopt;
    };
    if (const auto at = first_in(0, guard_size))
        return fmt::format("a guard byte {} bytes before the image", guard_size - *at);
    for (std::uint32_t y = 0; y < height_; ++y)
        if (const auto at =
                first_in(offset(width_, y), y + 1 < height_ ? offset(0, y + 1) : memory_.size() * sizeof(Page)))
            return y + 1 < height_ ? fmt::format("a guard byte in row {}, {} bytes after its last pixel", y, *at)
                                   : fmt::format("a guard byte {} bytes after the image's last pixel", *at);
    return {};
}

arhost_image Picture::image() {
    return {sizeof(arhost_image), stride(), width(), height(), pixel(0, 0), nullptr, nullptr};
}

Pixel Picture::at(std::uint32_t x, std::uint32_t y) const {
    const std::uint8_t *p = pixel(x, y);
    return {p[0], p[1], p[2], p[3]};
}

void Picture::set(std::uint32_t x, std::uint32_t y, const Pixel &value) {
    std::copy(value.begin(), value.end(), pixel(x, y));
}

arhost_image LinearPicture::image() {
    return {sizeof(arhost_image),
            stride(),
            width(),
            height(),
            nullptr,
            reinterpret_cast<std::uint16_t *>(pixel(0, 0)),
            nullptr};
}

LinearPixel LinearPicture::at(std::uint32_t x, std::uint32_t y) const {
    LinearPixel value;
    std::memcpy(&value, pixel(x, y), sizeof value);
    return value;
}

Picture LinearPicture::shown() const {
    constexpr std::uint8_t video = 128;
    Picture shown(width(), height());
    for (std::uint32_t y = 0; y < height(); ++y)
        for (std::uint32_t x = 0; x < width(); ++x) {
            const LinearPixel p = at(x, y);
            Pixel code{0, 0, 0, 255};
            for (int c = 0; c < 3; ++c)
                code[c] = added_and_transmitted(p.added[c], p.transmittance[c], video);
            shown.set(x, y, code);
        }
    return shown;
}

Picture LinearPicture::straight() const {
    Picture straight(width(), height());
    for (std::uint32_t y = 0; y < height(); ++y)
        for (std::uint32_t x = 0; x < width(); ++x) {
            std::uint8_t rgba[4];
            straight_from_linear(reinterpret_cast<const std::uint16_t *>(pixel(x, y)), rgba, 1);
            straight.set(x, y, {rgba[0], rgba[1], rgba[2], rgba[3]});
        }
    return straight;
}

bool Picture::is_smooth(std::uint32_t x, std::uint32_t y) const {
    for (std::uint32_t j = y - (y > 0); j <= std::min(y + 1, height() - 1); ++j)
        for (std::uint32_t i = x - (x > 0); i <= std::min(x + 1, width() - 1); ++i)
            if (alpha(i, j) != alpha(x, y) || differs(at(i, j), at(x, y), 24))
                return false;
    return true;
}

std::string Picture::png_base64() const {
    png_image png{};
    png.version = PNG_IMAGE_VERSION;
    png.width = width();
    png.height = height();
    png.format = PNG_FORMAT_RGBA;
    std::vector<std::uint8_t> file(PNG_IMAGE_PNG_SIZE_MAX(png));
    png_alloc_size_t size = file.size();
    if (!png_image_write_to_memory(&png, file.data(), &size, 0, pixel(0, 0), static_cast<png_int_32>(stride()),
                                   nullptr))
        throw std::runtime_error(std::string("libpng: ") + png.message);
    file.resize(size);
    return base64(file);
}

bool differs(const Pixel &a, const Pixel &b, int tolerance) {
    for (int channel = a[3] != 0 && b[3] != 0 ? 0 : 3; channel < 4; ++channel)
        if (std::abs(a[channel] - b[channel]) > tolerance)
            return true;
    return false;
}

std::optional<std::array<unsigned, 2>> first_difference(const Picture &a, const Picture &b, int tolerance) {
    for (std::uint32_t y = 0; y < a.height(); ++y)
        for (std::uint32_t x = 0; x < a.width(); ++x)
            if (differs(a.at(x, y), b.at(x, y), tolerance))
                return {{x, y}};
    return std::nullopt;
}

Picture difference(const Picture &a, const Picture &b) {
    Picture result(a.width(), a.height());
    for (std::uint32_t y = 0; y < a.height(); ++y)
        for (std::uint32_t x = 0; x < a.width(); ++x) {
            const Pixel p = a.at(x, y), q = b.at(x, y);
            Pixel d{0, 0, 0, 255};
            for (int channel = 0; channel < 3; ++channel)
                d[channel] = std::min(
                    255, 5 * std::max(std::abs(p[channel] * p[3] - q[channel] * q[3]) / 255, std::abs(p[3] - q[3])));
            result.set(x, y, d);
        }
    return result;
}

} // namespace arhost::conformance
