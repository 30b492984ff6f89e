// SPDX-License-Identifier: Apache-2.0
//
// Processes that a plugin started and that outlived its worker.
#pragma once

#include <set>
#include <sys/types.h>

namespace arhost::base {

std::set<pid_t> children(); // of this thread

// Kills every child of this thread except `kept`; returns their number. A subreaper (PR_SET_CHILD_SUBREAPER) inherits
// a worker's orphans; grandchildren become its children only when their parent is dead, so with a later call.
int kill_orphans(const std::set<pid_t> &kept);

// Repeats until there are none, for at most half a second: a process may hang in the kernel.
void end_orphans(const std::set<pid_t> &kept);

} // namespace arhost::base
