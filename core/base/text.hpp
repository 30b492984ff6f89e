// SPDX-License-Identifier: Apache-2.0
//
// Makes untrusted text safe to print, and composes messages.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace arhost::base {

bool is_utf8(std::string_view text);

// Returns `text` with invalid UTF-8 replaced with U+FFFD.
std::string valid_utf8(std::string_view text);

// Returns `text` as one line of valid UTF-8 that cannot control a terminal and is valid in XML 1.0. Replaces control
// characters, line breaks, bidirectional marks, U+FFFE and U+FFFF with spaces. Truncates the result to `max_size`
// bytes and then appends "…".
std::string printable(std::string_view text, std::size_t max_size = std::string_view::npos);

// Returns a number with a noun: "1 frame", "2 frames".
std::string count_of(std::uint64_t number, std::string_view noun);

// Returns the candidate that is most similar to `word` ("dictionary" for "dictionry"), or "" if none is similar.
std::string nearest(std::string_view word, std::span<const std::string_view> candidates);

} // namespace arhost::base
