// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <arhost/arhost.h>

#include <string>

namespace arhost::record {

// Appends the record of a frame as one line of JSON, including the line end. The README of sink_poses lists the keys.
void append_line(std::string &text, const arhost_record &record);
// Appends the same text without the closing brace and the line end, so that more members can follow.
void append_members(std::string &text, const arhost_record &record);

} // namespace arhost::record
