// SPDX-License-Identifier: Apache-2.0
//
// Interruptible writes to descriptors that may block forever, such as an unread pipe or a stopped terminal.
#pragma once

#include "base/unique_fd.hpp"

#include <stdexcept>
#include <string>
#include <string_view>

namespace arhost::base {

// Thrown if a signal arrived.
struct Interrupted : std::runtime_error {
    Interrupted(int signal, const std::string &what) : std::runtime_error(what), signal(signal) {}
    int signal;
};

// Writes all `bytes` to `fd`. `signals`: a signalfd whose signals interrupt the write, or -1. Throws Interrupted or
// std::system_error.
void write_all(int fd, std::string_view bytes, int signals = -1);

// Flushes stdout. If any output was lost, for example because the disk is full, prints an error and returns false. If
// the reader has closed the pipe, ends the process without a message, as SIGPIPE would.
bool flush_stdout();

// Blocks SIGINT, SIGTERM and SIGHUP, except those that the parent process ignores (nohup), and returns a signalfd for
// them.
UniqueFd watch_signals();

// Reads the next pending signal from the signalfd `signals`. Returns 0 at once if there is none.
int take_signal(int signals);

// Ends the process as if `signal` had not been blocked by watch_signals().
[[noreturn]] void end_by_signal(int signal);

} // namespace arhost::base
