// SPDX-License-Identifier: Apache-2.0
//
// A worker that loads a scene into an arena instead of serving a plugin.
#pragma once

#include "worker/link.hpp"

namespace arhost::worker {

// Returns the process's exit status.
int load_scene(Link &link, const ipc::messages::Load &load);

} // namespace arhost::worker
