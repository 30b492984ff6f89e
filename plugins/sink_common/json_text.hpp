// SPDX-License-Identifier: Apache-2.0
//
// Writes and reads files with one JSON object per line and one line per frame.
#pragma once

#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace arhost::json_text {

// Appends the shortest digits that read back as the same number.
template <class Number> void append_number(std::string &text, Number number) {
    char digits[32]; // a double needs up to 24
    text.append(digits, std::to_chars(digits, digits + sizeof digits, number).ptr);
}

// Appends a number. Infinities and NaN, which JSON cannot express, become null.
inline void append(std::string &text, double number) {
    if (std::isfinite(number))
        append_number(text, number);
    else
        text += "null";
}

inline void append(std::string &text, std::span<const double> numbers) {
    text += '[';
    for (std::size_t i = 0; i < numbers.size(); ++i) {
        text += i > 0 ? ", " : "";
        append(text, numbers[i]);
    }
    text += ']';
}

// Each line begins with this text, followed by the frame number and a comma.
inline constexpr std::string_view frame_start = "{\"frame\": ";

// Returns the frame number of a line, which may be truncated. Returns std::nullopt if the number itself is truncated
// or missing.
inline std::optional<std::uint64_t> frame_of_line(std::string_view line) {
    if (!line.starts_with(frame_start))
        return std::nullopt;
    line.remove_prefix(frame_start.size());
    std::uint64_t frame = 0;
    const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), frame);
    if (error != std::errc() || end == line.data() + line.size() || *end != ',')
        return std::nullopt;
    return frame;
}

} // namespace arhost::json_text
