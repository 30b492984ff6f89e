// SPDX-License-Identifier: Apache-2.0
//
// Executes a program in a forked child that will run untrusted code.
#pragma once

#include <span>
#include <sys/types.h>

namespace arhost::base {

// Call in the child after fork; async-signal-safe. The kernel kills the program when `parent` dies. The program
// starts with no blocked signals and no core dumps; its only descriptors are `fds`, numbered 0, 1, 2, …. Returns only
// on failure.
void exec_child(const char *program, char *const argv[], std::span<const int> fds, pid_t parent);

} // namespace arhost::base
