// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <arhost/arhost.h>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace arhost::poses {

// Appends all that is known of a frame as one line of JSON, its line end included. README.md lists the
// keys. Numbers are the shortest that read back as the same double; what is not finite is null.
void append_line(std::string &text, const arhost_record &record);

// The frame's number in a line that append_line made, whole or not past it; nothing in any other.
std::optional<std::uint64_t> frame_of_line(std::string_view line);

} // namespace arhost::poses
