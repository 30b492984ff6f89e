// SPDX-License-Identifier: Apache-2.0
//
// The step from fork to exec for untrusted children.
#pragma once

#include <span>
#include <sys/types.h>

namespace arhost::base {

// To be called in a child after fork; async-signal-safe. The program dies with `parent`, blocks no signals, leaves no
// core file, and has `fds` as descriptors 0, 1, 2, … and no others. Returns only if something fails.
void exec_child(const char *program, char *const argv[], std::span<const int> fds, pid_t parent);

} // namespace arhost::base
