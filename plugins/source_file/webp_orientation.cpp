// SPDX-License-Identifier: Apache-2.0
#include "webp_orientation.hpp"

#include <cstdint>
#include <fstream>
#include <string>
#include <string_view>

namespace arhost {

namespace {

// Returns 0 outside of the bytes.
std::uint32_t number_at(std::string_view bytes, std::size_t at, std::size_t size, bool is_big_endian) {
    if (at > bytes.size() || size > bytes.size() - at)
        return 0;
    std::uint32_t number = 0;
    for (std::size_t i = 0; i < size; ++i)
        number = number << 8 | static_cast<unsigned char>(bytes[at + (is_big_endian ? i : size - 1 - i)]);
    return number;
}

// `exif`: a TIFF file (TIFF 6.0, section 2), whose first directory may have the orientation.
int orientation_of(std::string_view exif) {
    constexpr std::uint32_t tag_orientation = 0x112;
    constexpr std::size_t entry_size = 12;
    if (exif.starts_with(std::string_view("Exif\0\0", 6))) // some programs write the prefix of JPEG files
        exif.remove_prefix(6);
    const bool is_big_endian = exif.starts_with("MM");
    const std::size_t directory = number_at(exif, 4, 4, is_big_endian);
    const std::uint32_t count = number_at(exif, directory, 2, is_big_endian);
    for (std::uint32_t i = 0; i < count; ++i) {
        const std::size_t entry = directory + 2 + entry_size * i;
        if (number_at(exif, entry, 2, is_big_endian) != tag_orientation)
            continue;
        const std::uint32_t orientation = number_at(exif, entry + 8, 2, is_big_endian);
        return orientation >= 1 && orientation <= 8 ? static_cast<int>(orientation) : 1;
    }
    return 1;
}

} // namespace

int webp_orientation(const std::filesystem::path &file) {
    constexpr std::uint32_t max_exif_size = 1 << 20;
    std::ifstream stream(file, std::ios::binary);
    char header[12] = {};
    stream.read(header, sizeof header);
    const std::string_view start(header, sizeof header);
    if (!stream || !start.starts_with("RIFF") || !start.ends_with("WEBP"))
        return 1;
    char chunk[8];
    while (stream.read(chunk, sizeof chunk)) {
        const std::uint32_t size = number_at({chunk, sizeof chunk}, 4, 4, false);
        if (std::string_view(chunk, 4) == "EXIF" && size <= max_exif_size) {
            std::string exif(size, '\0');
            stream.read(exif.data(), size);
            return orientation_of(exif);
        }
        stream.seekg(std::int64_t{size} + (size & 1), std::ios::cur); // chunks have an even size
    }
    return 1;
}

cv::Mat oriented(const cv::Mat &image, int exif_orientation) {
    constexpr int first_transposed = 5, both_axes = -1, around_x = 0, around_y = 1;
    cv::Mat result = image;
    if (exif_orientation >= first_transposed)
        cv::transpose(image, result);
    switch (exif_orientation) {
    case 2:
    case 6:
        cv::flip(result, result, around_y);
        break;
    case 3:
    case 7:
        cv::flip(result, result, both_axes);
        break;
    case 4:
    case 8:
        cv::flip(result, result, around_x);
        break;
    default:
        break;
    }
    return result;
}

} // namespace arhost
