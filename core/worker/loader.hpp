// SPDX-License-Identifier: Apache-2.0
//
// The other thing that a worker can be: the process that loads a scene into an arena.
#pragma once

#include "worker/link.hpp"

namespace arhost::worker {

// Answers {type: load, scene}. Returns the process's exit status.
int load_scene_for(Link &link, const ipc::Message &load);

} // namespace arhost::worker
