// SPDX-License-Identifier: Apache-2.0
//
// Opens a plugin's shared object, negotiates the ABI version and validates the plugin.
#pragma once

#include <arhost/arhost.h>

#include <filesystem>

namespace arhost::worker {

// Both functions throw std::runtime_error with a message for the user. The library stays open until the process
// exits.
const arhost_entry_point &open_library(const std::filesystem::path &file);
const arhost_plugin &negotiate(const std::filesystem::path &file, const arhost_entry_point &entry);

// Returns the size of a started tracker's state. Throws std::runtime_error if it exceeds ARHOST_MAX_STATE.
std::uint64_t state_size_of(const arhost_tracker &tracker, arhost_instance *instance);
// Returns the size of a started ray tracer's state. Throws std::runtime_error if it exceeds ipc::max_raytracer_state.
std::uint64_t state_size_of(const arhost_raytracer &raytracer, arhost_instance *instance);
// Returns what arhost_tracker.aspect returns for a marker; 1 if the tracker has no such function. Throws
// std::runtime_error if the number is invalid.
double aspect_of(const arhost_tracker &tracker, arhost_instance *instance, std::uint32_t marker);

} // namespace arhost::worker
