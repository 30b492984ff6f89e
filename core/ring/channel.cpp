// SPDX-License-Identifier: Apache-2.0
#include "ring/channel.hpp"

#include <cstring>
#include <poll.h>
#include <sys/socket.h>

namespace arhost::ring {

std::pair<Channel, Channel> Channel::make_pair() {
    int ends[2];
    if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0)
        throw_errno("socketpair for a control channel");
    for (const int end : ends) {
        const int size = 2 * max_message_size;
        ::setsockopt(end, SOL_SOCKET, SO_SNDBUF, &size, sizeof size);
    }
    return {Channel(UniqueFd(ends[0])), Channel(UniqueFd(ends[1]))};
}

bool Channel::send(const Json &body, std::initializer_list<int> fds, bool wait) const {
    // Bytes that are no UTF-8 (a plugin's log) are replaced, not refused.
    std::string text = body.dump(-1, ' ', false, Json::error_handler_t::replace);
    if (text.size() > max_message_size || fds.size() > max_fds)
        throw std::length_error("a control message of " + std::to_string(text.size()) + " bytes is too long");
    iovec part{text.data(), text.size()};
    msghdr header{};
    header.msg_iov = &part;
    header.msg_iovlen = 1;
    alignas(cmsghdr) char ancillary[CMSG_SPACE(sizeof(int) * max_fds)] = {};
    if (fds.size() > 0) {
        header.msg_control = ancillary;
        header.msg_controllen = CMSG_SPACE(sizeof(int) * fds.size());
        cmsghdr *control = CMSG_FIRSTHDR(&header);
        control->cmsg_level = SOL_SOCKET;
        control->cmsg_type = SCM_RIGHTS;
        control->cmsg_len = CMSG_LEN(sizeof(int) * fds.size());
        std::memcpy(CMSG_DATA(control), fds.begin(), sizeof(int) * fds.size());
    }
    for (;;) {
        if (::sendmsg(fd_.get(), &header, MSG_NOSIGNAL | (wait ? 0 : MSG_DONTWAIT)) >= 0)
            return true;
        if (errno != EINTR)
            return false;
    }
}

ReceiveState Channel::receive(Message &message, int timeout_ms) const {
    message = {};
    pollfd ready{fd_.get(), POLLIN, 0};
    if (timeout_ms != 0) {
        const int polled = ::poll(&ready, 1, timeout_ms);
        if (polled == 0 || (polled < 0 && errno == EINTR))
            return ReceiveState::none;
    }
    std::vector<char> text(max_message_size);
    iovec part{text.data(), text.size()};
    msghdr header{};
    header.msg_iov = &part;
    header.msg_iovlen = 1;
    alignas(cmsghdr) char ancillary[CMSG_SPACE(sizeof(int) * max_fds)] = {};
    header.msg_control = ancillary;
    header.msg_controllen = sizeof ancillary;
    const ssize_t size = ::recvmsg(fd_.get(), &header, MSG_DONTWAIT | MSG_CMSG_CLOEXEC);
    if (size < 0)
        return errno == EAGAIN || errno == EINTR ? ReceiveState::none : ReceiveState::closed;
    for (cmsghdr *control = CMSG_FIRSTHDR(&header); control; control = CMSG_NXTHDR(&header, control)) {
        if (control->cmsg_level != SOL_SOCKET || control->cmsg_type != SCM_RIGHTS)
            continue;
        const std::size_t count = (control->cmsg_len - CMSG_LEN(0)) / sizeof(int);
        for (std::size_t i = 0; i < count; ++i) {
            int fd = -1;
            std::memcpy(&fd, CMSG_DATA(control) + i * sizeof(int), sizeof fd);
            message.fds.emplace_back(fd);
        }
    }
    if (size == 0)
        return ReceiveState::closed;
    if (header.msg_flags & (MSG_TRUNC | MSG_CTRUNC))
        return ReceiveState::breach;
    message.body = Json::parse(text.data(), text.data() + size, nullptr, false);
    if (!message.body.is_object() || !message.body.contains("type") || !message.body["type"].is_string())
        return ReceiveState::breach;
    return ReceiveState::message;
}

} // namespace arhost::ring
