// SPDX-License-Identifier: Apache-2.0
//
// Reads the log of a session, frames.jsonl, as the plugin sink_session writes it (docs/sessions.md).
#pragma once

#include "session/log.hpp"

#include <filesystem>
#include <functional>

namespace arhost::session {

// Reads the frames that the video contains completely. The video has `video_bytes` bytes. Omits a last line that is
// incomplete. If anything else is damaged, throws yaml::Error, whose message names file, line and column. Calls
// `progress` before each line.
Log read_log(const std::filesystem::path &file, std::uint64_t video_bytes, const std::function<void()> &progress);

} // namespace arhost::session
