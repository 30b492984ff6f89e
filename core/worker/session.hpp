// SPDX-License-Identifier: Apache-2.0
//
// What a worker does from its start to its end: it opens one plugin and serves it, or loads one scene.
#pragma once

#include "worker/link.hpp"

namespace arhost::worker {

// What a plugin frees after a frame it wants again with the next one: giving it back to the system in between costs
// trackers a quarter of their time, in page faults. (glibc raises its thresholds by itself only in processes that
// have freed something large.) To be called once, before there are threads.
void keep_freed_memory();

// Returns the process's exit status.
int work(Link &link);

} // namespace arhost::worker
