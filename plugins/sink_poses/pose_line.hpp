// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <arhost/arhost.h>

#include <string>

namespace arhost::poses {

// Appends the record of a frame as one line of JSON, including the line end. README.md lists the keys.
void append_line(std::string &text, const arhost_record &record);

} // namespace arhost::poses
