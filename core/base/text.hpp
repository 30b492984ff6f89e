// SPDX-License-Identifier: Apache-2.0
//
// Untrusted text, made safe to print.
#pragma once

#include <string>
#include <string_view>

namespace arhost::base {

bool is_utf8(std::string_view text);

// Replaces invalid UTF-8 by U+FFFD.
std::string valid_utf8(std::string_view text);

// One line of valid UTF-8 that cannot control a terminal and is valid in XML 1.0: control characters, line breaks,
// bidirectional marks, U+FFFE and U+FFFF become spaces. Text longer than `max_size` bytes is truncated and ends in
// "…".
std::string printable(std::string_view text, std::size_t max_size = std::string_view::npos);

} // namespace arhost::base
