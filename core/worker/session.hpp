// SPDX-License-Identifier: Apache-2.0
//
// What a worker does from its start to its end: it opens one plugin and serves it, or loads one scene.
#pragma once

#include "worker/link.hpp"

namespace arhost::worker {

// Returns the process's exit status.
int work(Link &link);

} // namespace arhost::worker
