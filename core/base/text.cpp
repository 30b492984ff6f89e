// SPDX-License-Identifier: Apache-2.0
#include "base/text.hpp"

#include <iterator>
#include <utf8.h>

namespace arhost::base {
namespace {

// `c`: one UTF-8 character. Compares bytes, because in UTF-8 their order is that of the code points.
bool is_unsafe(std::string_view c) {
    const auto within = [&](std::string_view first, std::string_view last) { return first <= c && c <= last; };
    return c < " " || within("\x7f", "\u009f") || c == "\u061c" || within("\u200e", "\u200f") ||
           within("\u2028", "\u202e") || within("\u2066", "\u2069") || within("\ufffe", "\uffff");
}

} // namespace

bool is_utf8(std::string_view text) {
    return utf8::is_valid(text.begin(), text.end());
}

std::string valid_utf8(std::string_view text) {
    std::string valid;
    utf8::replace_invalid(text.begin(), text.end(), std::back_inserter(valid));
    return valid;
}

std::string printable(std::string_view text, std::size_t max_size) {
    const std::string valid = valid_utf8(text);
    std::string line;
    for (std::size_t at = 0, length = 0; at < valid.size(); at += length) {
        const auto first = static_cast<unsigned char>(valid[at]);
        length = first < 0x80 ? 1 : first < 0xe0 ? 2 : first < 0xf0 ? 3 : 4;
        const std::string_view c = std::string_view(valid).substr(at, length);
        const std::string_view shown = is_unsafe(c) ? " " : c;
        if (line.size() + shown.size() > max_size)
            return line + "…";
        line += shown;
    }
    return line;
}

std::string count_of(std::uint64_t number, std::string_view noun) {
    return std::to_string(number) + " " + std::string(noun) + (number == 1 ? "" : "s");
}

} // namespace arhost::base
