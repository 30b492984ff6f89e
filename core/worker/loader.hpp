// SPDX-License-Identifier: Apache-2.0
//
// Reads a file of the user into shared memory. A worker either does this or runs a plugin.
#pragma once

#include "worker/link.hpp"

namespace arhost::worker {

// Both send the memory to the host, and return the exit status of the process.
int load_scene(Link &link, const ipc::messages::Load &load);     // into an arena
int read_log(Link &link, const ipc::messages::ReadLog &request); // of a session, in its packed form

} // namespace arhost::worker
