// SPDX-License-Identifier: Apache-2.0
//
// One message with file descriptors over a Unix socket.
#pragma once

#include "base/unique_fd.hpp"

#include <cstddef>
#include <initializer_list>
#include <span>
#include <vector>

namespace arhost::ipc {

constexpr std::size_t max_passed_fds = 4;

// As sendmsg(2): the bytes sent, or -1 with errno. Never raises SIGPIPE; repeats when interrupted.
ssize_t send_with_fds(int socket, std::span<const std::byte> bytes, std::initializer_list<int> fds, int flags = 0);

struct Received {
    ssize_t size;   // as of recvmsg(2): 0 at the end, -1 with errno
    bool truncated; // bytes or descriptors did not fit
};
// `fds` gets what came along, close-on-exec.
Received receive_with_fds(int socket, std::span<std::byte> bytes, std::vector<base::UniqueFd> &fds, int flags = 0);

} // namespace arhost::ipc
