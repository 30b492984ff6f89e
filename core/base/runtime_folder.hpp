// SPDX-License-Identifier: Apache-2.0
//
// The folder of the sockets and locks of this user's runs.
#pragma once

#include <filesystem>

namespace arhost::base {

// Returns $XDG_RUNTIME_DIR/arhost, or /tmp/arhost-UID if the variable is not set to an absolute path.
std::filesystem::path runtime_folder();

// Creates that folder with mode 0700. Throws std::runtime_error if this is impossible, or if other users can replace
// the files in an existing folder.
void make_runtime_folder();

} // namespace arhost::base
