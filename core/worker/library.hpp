// SPDX-License-Identifier: Apache-2.0
//
// A plugin's shared object: opened, asked for its version, its answer checked.
#pragma once

#include <arhost/arhost.h>

#include <filesystem>

namespace arhost::worker {

// Stays open until the process ends. Throws std::runtime_error with a sentence for the user.
const arhost_plugin &open_plugin(const std::filesystem::path &file);

} // namespace arhost::worker
