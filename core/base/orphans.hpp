// SPDX-License-Identifier: Apache-2.0
//
// Kills orphans: processes that a plugin has started and that outlive its worker.
#pragma once

#include <set>
#include <sys/types.h>

namespace arhost::base {

// Returns the child processes of the calling thread.
std::set<pid_t> children();

// Kills all children of the calling thread except `kept`. Returns the number of killed processes. If the calling
// process is a subreaper (PR_SET_CHILD_SUBREAPER), the orphans of a dead worker become its children. The children of
// an orphan become children of the calling process only after the orphan has died, so call this function repeatedly.
int kill_orphans(const std::set<pid_t> &kept);

// Calls kill_orphans until no orphan is left, but for at most half a second, because a process may hang in the
// kernel. Returns whether none is left.
bool end_orphans(const std::set<pid_t> &kept);

} // namespace arhost::base
