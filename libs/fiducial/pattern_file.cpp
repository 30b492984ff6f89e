// SPDX-License-Identifier: Apache-2.0
#include "pattern_file.hpp"

#include <arhost-cpp/plugin.hpp>

#include <charconv>
#include <cmath>
#include <fstream>
#include <vector>

namespace arhost::fiducial {
namespace {

constexpr int orientations = 4, planes = 3;
constexpr int min_side = 4, max_side = 64;
constexpr std::size_t max_file_size = std::size_t{1} << 20;

[[noreturn]] void reject(const std::string &file, const std::string &reason) {
    throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "'" + file + "' " + reason);
}

std::vector<int> numbers_in(const std::string &file) {
    std::ifstream stream(file, std::ios::binary);
    if (!stream)
        reject(file, "cannot be read");
    std::string text(max_file_size + 1, '\0');
    stream.read(text.data(), static_cast<std::streamsize>(text.size()));
    text.resize(static_cast<std::size_t>(stream.gcount()));
    if (text.size() > max_file_size)
        reject(file, "is too large for a pattern of ARToolKit");
    std::vector<int> numbers;
    int line = 1;
    for (const char *at = text.data(), *end = at + text.size(); at != end;) {
        if (*at == ' ' || *at == '\t' || *at == '\r' || *at == '\n') {
            line += *at == '\n';
            ++at;
            continue;
        }
        int number = 0;
        const auto [after, error] = std::from_chars(at, end, number);
        if (error != std::errc() || number < 0 || number > 255)
            reject(file,
                   "is not a pattern of ARToolKit: line " + std::to_string(line) +
                       " has something other than numbers from 0 to 255; name a file that ARToolKit's mk_patt wrote");
        numbers.push_back(number);
        at = after;
    }
    return numbers;
}

} // namespace

cv::Mat_<float> read_pattern(const std::string &file) {
    const std::vector<int> numbers = numbers_in(file);
    const int side =
        static_cast<int>(std::lround(std::sqrt(static_cast<double>(numbers.size()) / (orientations * planes))));
    if (side < min_side || side > max_side ||
        numbers.size() !=
            std::size_t{orientations * planes} * static_cast<std::size_t>(side) * static_cast<std::size_t>(side))
        reject(file,
               "is not a pattern of ARToolKit: it has " + std::to_string(numbers.size()) +
                   " numbers; a pattern of 16 x 16 has 3072: four orientations of three colours; if the file is cut "
                   "short, copy it again");
    // The first orientation is the upright one. The others are the same picture, rotated.
    cv::Mat_<float> upright(side, side, 0.0F);
    constexpr float weights[planes] = {0.114F, 0.587F, 0.299F}; // luma of BT.601, as in frames
    const int size = side * side;
    for (int plane = 0; plane < planes; ++plane)
        for (int i = 0; i < size; ++i)
            upright(i / side, i % side) += weights[plane] * static_cast<float>(numbers[plane * size + i]);
    return upright;
}

} // namespace arhost::fiducial
