// SPDX-License-Identifier: Apache-2.0
//
// What plugins, files and users call themselves, made harmless for who reads it.
#pragma once

#include <string>
#include <string_view>

namespace arhost::base {

bool is_utf8(std::string_view text);

// What is no UTF-8 becomes U+FFFD.
std::string valid_utf8(std::string_view text);

// One line of valid UTF-8 that can't steer a terminal and that XML 1.0 can hold: control characters, line ends,
// marks that turn the direction of writing, U+FFFE and U+FFFF become blanks. What is longer than `max_size` bytes is
// cut off there, and ends in "…".
std::string printable(std::string_view text, std::size_t max_size = std::string_view::npos);

} // namespace arhost::base
