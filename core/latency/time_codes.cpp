// SPDX-License-Identifier: Apache-2.0
#include "latency/time_codes.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

namespace arhost::latency {
namespace {

constexpr std::uint32_t data_cells = 6;
constexpr std::uint32_t cells = data_cells + 4; // including the black border and the white border around it

// The first 64 tags of the family tag36h11 (AprilTag 3, BSD licence): the cells in rows from the top left, 1 is
// white.
constexpr std::uint64_t tags[TimeCodes::count] = {
    0xd5d628584, 0xd97f18b49, 0xdd280910e, 0xe479e9c98, 0xebcbca822, 0xf31dab3ac, 0x056a5d085, 0x10652e1d4,
    0x22b1dfead, 0x265ad0472, 0x34fe91b86, 0x3ff962cd5, 0x43a25329a, 0x474b4385f, 0x4e9d243e9, 0x5246149ae,
    0x5997f5538, 0x683bb6c4c, 0x6be4a7211, 0x7e3158eea, 0x81da494af, 0x858339a74, 0x8cd51a5fe, 0x9f21cc2d7,
    0xa2cabc89c, 0xadc58d9eb, 0xb16e7dfb0, 0xb8c05eb3a, 0xd25ef139d, 0xd607e1962, 0xe4aba3076, 0x2dde6a3da,
    0x43d40c678, 0x5620be351, 0x64c47fa65, 0x686d7002a, 0x6c16605ef, 0x6fbf50bb4, 0x8d06d39dc, 0x9f53856b5,
    0xadf746dc9, 0xbc9b084dd, 0xd290aa77b, 0xd9e28b305, 0xe4dd5c454, 0xfad2fe6f2, 0x181a8151a, 0x26be42c2e,
    0x2e10237b8, 0x405cd5491, 0x7742eab1c, 0x85e6ac230, 0x8d388cdba, 0x9f853ea93, 0xc41ea2445, 0xcf1973594,
    0x14a34a333, 0x31eacd15b, 0x6c79d2dab, 0x73cbb3935, 0x89c155bd3, 0x8d6a46198, 0x91133675d, 0xa708d89fb,
};

bool is_white(std::uint64_t tag, std::uint32_t x, std::uint32_t y) {
    const auto is_inside = [](std::uint32_t at, std::uint32_t border) { return at >= border && at < cells - border; };
    if (!is_inside(x, 1) || !is_inside(y, 1))
        return true;
    if (!is_inside(x, 2) || !is_inside(y, 2))
        return false;
    const std::uint32_t bit = data_cells * data_cells - 1 - (data_cells * (y - 2) + x - 2);
    return (tag >> bit & 1) != 0;
}

} // namespace

void TimeCodes::draw(const OutputView &out, std::uint32_t width, std::uint32_t height, Clock::time_point now) {
    const std::size_t code = drawn_++ % count;
    pictures_[code] = {now, false};
    const std::uint32_t cell = std::max(1u, std::min(width, height) / cells), side = cells * cell;
    const std::uint32_t left = width > side ? (width - side) / 2 : 0, top = height > side ? (height - side) / 2 : 0;
    for (std::uint32_t y = 0; y < height; ++y) {
        std::uint8_t *const row = out.bgr + y * out.stride;
        std::memset(row, 255, std::size_t{3} * width);
        if (y < top || y >= top + side)
            continue;
        for (std::uint32_t x = 0; x < cells; ++x) {
            const std::uint32_t begin = std::min(width, left + x * cell), end = std::min(width, begin + cell);
            if (!is_white(tags[code], x, (y - top) / cell))
                std::memset(row + std::size_t{3} * begin, 0, std::size_t{3} * (end - begin));
        }
    }
}

std::optional<std::chrono::nanoseconds> TimeCodes::see(std::span<const arhost_observation> seen,
                                                       Clock::time_point now) {
    const auto is_code = [](const arhost_observation &one) { return one.id >= 0 && one.id < count; };
    const auto found = std::ranges::find_if(seen, is_code);
    // If a picture shows two codes, the exposure began before the second code replaced the first.
    if (found == seen.end() || std::ranges::count_if(seen, is_code) != 1)
        return {};
    const auto code = static_cast<std::size_t>(found->id);
    last_seen_ = now;
    if (std::exchange(pictures_[code].is_seen, true))
        return {};
    return now - pictures_[code].drawn;
}

bool TimeCodes::is_overdue(std::chrono::nanoseconds limit, Clock::time_point now) {
    if (now - last_seen_ < limit)
        return false;
    last_seen_ = now;
    return true;
}

} // namespace arhost::latency
