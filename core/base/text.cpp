// SPDX-License-Identifier: Apache-2.0
#include "base/text.hpp"

#include <algorithm>
#include <iterator>
#include <utf8.h>
#include <vector>

namespace arhost::base {
namespace {

// `c`: one UTF-8 character. Compares bytes, because in UTF-8 their order is that of the code points.
bool is_unsafe(std::string_view c) {
    const auto within = [&](std::string_view first, std::string_view last) { return first <= c && c <= last; };
    return c < " " || within("\x7f", "\u009f") || c == "\u061c" || within("\u200e", "\u200f") ||
           within("\u2028", "\u202e") || within("\u2066", "\u2069") || within("\ufffe", "\uffff");
}

char lower(char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

// Ignores the case of letters.
std::size_t edit_distance(std::string_view a, std::string_view b) {
    std::vector<std::size_t> row(b.size() + 1);
    for (std::size_t j = 0; j <= b.size(); ++j)
        row[j] = j;
    for (std::size_t i = 1; i <= a.size(); ++i) {
        std::size_t diagonal = row[0]++;
        for (std::size_t j = 1; j <= b.size(); ++j) {
            const std::size_t substituted = diagonal + (lower(a[i - 1]) != lower(b[j - 1]));
            diagonal = row[j];
            row[j] = std::min({row[j] + 1, row[j - 1] + 1, substituted});
        }
    }
    return row.back();
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

std::string nearest(std::string_view word, std::span<const std::string_view> candidates) {
    std::string_view best;
    std::size_t best_distance = std::max<std::size_t>(2, word.size() / 3) + 1;
    for (const std::string_view candidate : candidates)
        if (const std::size_t distance = edit_distance(word, candidate); distance < best_distance) {
            best = candidate;
            best_distance = distance;
        }
    return std::string(best);
}

} // namespace arhost::base
