// SPDX-License-Identifier: Apache-2.0
//
// Sends and receives messages with file descriptors over a Unix socket.
#pragma once

#include "base/unique_fd.hpp"

#include <cstddef>
#include <span>
#include <vector>

namespace arhost::ipc {

constexpr std::size_t max_passed_fds = 4;

// Sends one message. Like sendmsg(2), returns the number of bytes sent, or -1 with errno. Never raises SIGPIPE;
// retries on EINTR.
ssize_t send_with_fds(int socket, std::span<const std::byte> bytes, const std::vector<int> &fds, int flags = 0);

struct Received {
    ssize_t size;   // return value of recvmsg(2): 0 at end of file, -1 with errno on error
    bool truncated; // some bytes or descriptors did not fit
};
// Receives one message. Appends its descriptors, which are close-on-exec, to `fds`.
Received receive_with_fds(int socket, std::span<std::byte> bytes, std::vector<base::UniqueFd> &fds, int flags = 0);

} // namespace arhost::ipc
