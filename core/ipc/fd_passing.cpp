// SPDX-License-Identifier: Apache-2.0
#include "ipc/fd_passing.hpp"

#include <cstring>
#include <sys/socket.h>

namespace arhost::ipc {

ssize_t send_with_fds(int socket, std::span<const std::byte> bytes, const std::vector<int> &fds, int flags) {
    iovec part{const_cast<std::byte *>(bytes.data()), bytes.size()};
    msghdr header{};
    header.msg_iov = &part;
    header.msg_iovlen = 1;
    alignas(cmsghdr) char ancillary[CMSG_SPACE(sizeof(int) * max_passed_fds)] = {};
    if (!fds.empty()) {
        header.msg_control = ancillary;
        header.msg_controllen = CMSG_SPACE(sizeof(int) * fds.size());
        cmsghdr *control = CMSG_FIRSTHDR(&header);
        control->cmsg_level = SOL_SOCKET;
        control->cmsg_type = SCM_RIGHTS;
        control->cmsg_len = CMSG_LEN(sizeof(int) * fds.size());
        std::memcpy(CMSG_DATA(control), fds.data(), sizeof(int) * fds.size());
    }
    ssize_t sent;
    do
        sent = ::sendmsg(socket, &header, MSG_NOSIGNAL | flags);
    while (sent < 0 && errno == EINTR);
    return sent;
}

Received receive_with_fds(int socket, std::span<std::byte> bytes, std::vector<base::UniqueFd> &fds, int flags) {
    iovec part{bytes.data(), bytes.size()};
    msghdr header{};
    header.msg_iov = &part;
    header.msg_iovlen = 1;
    alignas(cmsghdr) char ancillary[CMSG_SPACE(sizeof(int) * max_passed_fds)] = {};
    header.msg_control = ancillary;
    header.msg_controllen = sizeof ancillary;
    ssize_t size;
    do
        size = ::recvmsg(socket, &header, MSG_CMSG_CLOEXEC | flags);
    while (size < 0 && errno == EINTR);
    if (size < 0)
        return {size, false};
    for (cmsghdr *control = CMSG_FIRSTHDR(&header); control; control = CMSG_NXTHDR(&header, control)) {
        if (control->cmsg_level != SOL_SOCKET || control->cmsg_type != SCM_RIGHTS)
            continue;
        const std::size_t count = (control->cmsg_len - CMSG_LEN(0)) / sizeof(int);
        for (std::size_t i = 0; i < count; ++i) {
            int fd = -1;
            std::memcpy(&fd, CMSG_DATA(control) + i * sizeof(int), sizeof fd);
            fds.emplace_back(fd);
        }
    }
    return {size, (header.msg_flags & (MSG_TRUNC | MSG_CTRUNC)) != 0};
}

} // namespace arhost::ipc
