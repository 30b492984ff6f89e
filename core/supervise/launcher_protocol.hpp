// SPDX-License-Identifier: Apache-2.0
//
// The messages between the host and arhost-launcher: plain structs, because both come from the same build.
#pragma once

#include "ipc/fd_passing.hpp"
#include "supervise/exit.hpp"
#include "supervise/isolation.hpp"

#include <climits>

namespace arhost::supervise {

struct Request {
    char program[PATH_MAX]; // accompanied by the descriptors of control channel, doorbell and output
    Isolation isolation;
};

struct Reply {
    enum Kind : int { spawned, failed, exited } kind;
    int error; // errno; only for `failed`
    Exit exit; // for `spawned`, only the pid is set, and the pidfd accompanies the reply
};

// The launcher's end of the socket.
constexpr int launcher_fd = 3;

template <class Struct> bool send_struct(int socket, const Struct &data, std::initializer_list<int> fds = {}) {
    return ipc::send_with_fds(socket, std::as_bytes(std::span(&data, 1)), fds) == sizeof data;
}
template <class Struct>
bool receive_struct(int socket, Struct &data, std::vector<base::UniqueFd> &fds, int flags = 0) {
    return ipc::receive_with_fds(socket, std::as_writable_bytes(std::span(&data, 1)), fds, flags).size == sizeof data;
}

} // namespace arhost::supervise
