// SPDX-License-Identifier: Apache-2.0
//
// Loads a scene into an arena. A worker either does this or runs a plugin.
#pragma once

#include "worker/link.hpp"

namespace arhost::worker {

// Loads the scene, sends its arena to the host, and returns the exit status of the process.
int load_scene(Link &link, const ipc::messages::Load &load);

} // namespace arhost::worker
