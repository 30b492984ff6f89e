// SPDX-License-Identifier: Apache-2.0
//
// A plugin's shared object: opened, asked for its version, its answer checked.
#pragma once

#include <arhost/arhost.h>

#include <filesystem>

namespace arhost::worker {

// Both throw std::runtime_error with a sentence for the user. The library stays open until the process ends.
const arhost_entry_point &open_library(const std::filesystem::path &file);
const arhost_plugin &negotiate(const std::filesystem::path &file, const arhost_entry_point &entry);

} // namespace arhost::worker
