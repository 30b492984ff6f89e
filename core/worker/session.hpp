// SPDX-License-Identifier: Apache-2.0
//
// The main function of a worker: opens and serves one plugin, or loads one scene.
#pragma once

#include "worker/link.hpp"

namespace arhost::worker {

// Makes malloc keep freed memory. Plugins free and allocate the same memory with each frame; returning it to the
// system in between costs trackers a quarter of their time in page faults. (glibc raises its thresholds by itself
// only after a process has freed a large block.) Call once, before starting threads.
void retain_freed_memory();

// Returns the process's exit status.
int run(Link &link);

} // namespace arhost::worker
