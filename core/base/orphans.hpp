// SPDX-License-Identifier: Apache-2.0
//
// Processes that a plugin has started and left behind.
#pragma once

#include <set>
#include <sys/types.h>

namespace arhost::base {

// Of this thread.
std::set<pid_t> children();

// Kills every child of this thread that is not to be kept, and tells how many there were. To a subreaper
// (PR_SET_CHILD_SUBREAPER) comes what a worker leaves behind, and what that has left behind with the next call.
int kill_orphans(const std::set<pid_t> &kept);

// Until there are none, or for half a second: one may hang in the kernel.
void end_orphans(const std::set<pid_t> &kept);

} // namespace arhost::base
