// SPDX-License-Identifier: Apache-2.0
//
// Encoders for small test images. Samples begin with the top row.
#pragma once

#include <webp/encode.h>
#include <zlib.h>

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace arhost::scene::test {

inline std::string big_endian(std::uint32_t value) {
    return {static_cast<char>(value >> 24), static_cast<char>(value >> 16), static_cast<char>(value >> 8),
            static_cast<char>(value)};
}

// `channels` is 1 to 4, `depth` is 8 or 16 bits. `samples` are the bytes as stored in the file before compression.
inline std::string png(std::uint32_t width, std::uint32_t height, int channels, const std::string &samples,
                       int depth = 8) {
    const auto chunk = [](const std::string &type, const std::string &data) {
        const std::string body = type + data;
        const auto sum = crc32(0, reinterpret_cast<const Bytef *>(body.data()), static_cast<uInt>(body.size()));
        return big_endian(static_cast<std::uint32_t>(data.size())) + body +
               big_endian(static_cast<std::uint32_t>(sum));
    };
    const char colour_types[] = {0, 4, 2, 6};
    std::string header = big_endian(width) + big_endian(height) + char(depth) + colour_types[channels - 1];
    header += std::string(3, '\0');
    std::string rows;
    const std::size_t stride = std::size_t(width) * channels * depth / 8;
    for (std::uint32_t row = 0; row < height; ++row)
        rows += '\0' + (samples.empty() ? std::string(stride, '\0') : samples.substr(row * stride, stride));
    uLongf size = compressBound(rows.size());
    std::string packed(size, '\0');
    compress2(reinterpret_cast<Bytef *>(packed.data()), &size, reinterpret_cast<const Bytef *>(rows.data()),
              rows.size(), 1);
    packed.resize(size);
    return "\x89PNG\r\n\x1a\n" + chunk("IHDR", header) + chunk("IDAT", packed) + chunk("IEND", "");
}

// A grey JPEG of 8 × 8 px; all have the value 128.
inline std::string jpeg() {
    static const char hex[] =
        "ffd8ffe000104a46494600010200000100010000fffe00104c61766335392e33372e31303000ffdb00430008040404040405"
        "05050505050606060606060606060606060607070708080807070706060707080808080909090808080809090a0a0a0c0c0b"
        "0b0e0e0e111114ffc4004a000100000000000000000000000000000000010100000000000000000000000000000000100100"
        "000000000000000000000000000000110100000000000000000000000000000000ffc0001108000800080301120002120003"
        "1200ffda000c03010002110311003f00000fffd9";
    std::string bytes;
    for (const char *p = hex; *p; p += 2)
        bytes += static_cast<char>(std::stoi(std::string(p, 2), nullptr, 16));
    return bytes;
}

// `samples`: RGBA. `quality`: 0 to 100, or −1 for lossless.
inline std::string webp(int width, int height, const std::string &samples, float quality = -1) {
    const auto *from = reinterpret_cast<const std::uint8_t *>(samples.data());
    std::uint8_t *to = nullptr;
    const std::size_t size = quality < 0 ? WebPEncodeLosslessRGBA(from, width, height, 4 * width, &to)
                                         : WebPEncodeRGBA(from, width, height, 4 * width, quality, &to);
    const std::string bytes(reinterpret_cast<const char *>(to), size);
    WebPFree(to);
    return bytes;
}

// Radiance HDR with a shared exponent: the bytes r, g, b, e stand for the texel (r, g, b) · 2^(e − 136).
inline std::string hdr(int width, int height, const std::string &rgbe) {
    return "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y " + std::to_string(height) + " +X " + std::to_string(width) +
           "\n" + rgbe;
}

// OpenEXR with one row of uncompressed floats. The file stores the channels in the order B, G, R.
inline std::string exr(const std::vector<float> &b, const std::vector<float> &g, const std::vector<float> &r) {
    const auto raw = [](auto value) { return std::string(reinterpret_cast<const char *>(&value), sizeof value); };
    const auto number = [&](int value) { return raw(std::int32_t(value)); };
    const auto attribute = [&](const std::string &name, const std::string &type, const std::string &value) {
        return name + '\0' + type + '\0' + number(static_cast<int>(value.size())) + value;
    };
    std::string channels;
    for (const char *name : {"B", "G", "R"})
        channels += std::string(name) + '\0' + number(2) + number(0) + number(1) + number(1);
    const int width = static_cast<int>(b.size());
    const std::string window = number(0) + number(0) + number(width - 1) + number(0);
    std::string file = number(20000630) + number(2) + attribute("channels", "chlist", channels + '\0') +
                       attribute("compression", "compression", std::string(1, '\0')) +
                       attribute("dataWindow", "box2i", window) + attribute("displayWindow", "box2i", window) +
                       attribute("lineOrder", "lineOrder", std::string(1, '\0')) +
                       attribute("pixelAspectRatio", "float", raw(1.f)) +
                       attribute("screenWindowCenter", "v2f", raw(0.f) + raw(0.f)) +
                       attribute("screenWindowWidth", "float", raw(1.f)) + '\0';
    std::string pixels;
    for (const auto *channel : {&b, &g, &r})
        for (const float value : *channel)
            pixels += raw(value);
    file += raw(std::uint64_t(file.size() + 8));
    return file + number(0) + number(static_cast<int>(pixels.size())) + pixels;
}

} // namespace arhost::scene::test
