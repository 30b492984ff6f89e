// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <arhost/arhost.h>

#include <string>

namespace arhost::poses {

// Appends all that is known of a frame as one line of JSON, its line end included. README.md lists the
// keys. Numbers are the shortest that read back as the same double; what is not finite is null.
void append_line(std::string &text, const arhost_record &record);

} // namespace arhost::poses
