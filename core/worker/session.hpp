// SPDX-License-Identifier: Apache-2.0
//
// The main function of a worker: opens and serves one plugin, loads one scene, or reads one log.
#pragma once

#include "worker/link.hpp"

namespace arhost::worker {

// Makes malloc keep freed memory instead of returning it to the system. Plugins often free and allocate the same
// amount of memory in each frame; without this function, trackers spend a quarter of their time in page faults. (By
// itself, glibc raises its thresholds only after a process has freed a large block.) Call once, before starting
// threads.
void retain_freed_memory();

// Serves the host until the work is done or an error occurs. Returns the exit status of the process.
int run(Link &link);

} // namespace arhost::worker
