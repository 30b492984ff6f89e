// SPDX-License-Identifier: Apache-2.0
#include "ipc/channel.hpp"

#include "ipc/fd_passing.hpp"
#include "ipc/message.hpp"

#include <algorithm>
#include <poll.h>
#include <sys/socket.h>

namespace arhost::ipc {

std::pair<Channel, Channel> Channel::make_pair() {
    int ends[2];
    if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0)
        base::throw_errno("socketpair for a control channel");
    for (const int end : ends) {
        const int size = 2 * max_message_size;
        ::setsockopt(end, SOL_SOCKET, SO_SNDBUF, &size, sizeof size);
    }
    return {Channel(base::UniqueFd(ends[0])), Channel(base::UniqueFd(ends[1]))};
}

bool Channel::send(const Json &body, const std::vector<int> &fds, bool wait) const {
    // Replaces invalid UTF-8, for example in a plugin's log message, instead of throwing.
    const std::string text = body.dump(-1, ' ', false, Json::error_handler_t::replace);
    if (text.size() > max_message_size || fds.size() > max_passed_fds)
        throw std::length_error("a control message of " + std::to_string(text.size()) + " bytes is too long");
    return send_with_fds(fd_.get(), std::as_bytes(std::span(text)), fds, wait ? 0 : MSG_DONTWAIT) >= 0;
}

ReceiveState Channel::receive(Message &message, int timeout_ms) const {
    message = {};
    pollfd ready{fd_.get(), POLLIN, 0};
    if (timeout_ms != 0) {
        const int polled = ::poll(&ready, 1, timeout_ms);
        if (polled == 0 || (polled < 0 && errno == EINTR))
            return ReceiveState::none;
    }
    const ssize_t waiting = ::recv(fd_.get(), nullptr, 0, MSG_PEEK | MSG_TRUNC | MSG_DONTWAIT);
    if (waiting < 0)
        return errno == EAGAIN ? ReceiveState::none : ReceiveState::closed;
    std::vector<char> text(std::clamp<std::size_t>(static_cast<std::size_t>(waiting), 1, max_message_size));
    const auto [size, truncated] =
        receive_with_fds(fd_.get(), std::as_writable_bytes(std::span(text)), message.fds, MSG_DONTWAIT);
    if (size <= 0)
        return size < 0 && errno == EAGAIN ? ReceiveState::none : ReceiveState::closed;
    message.size = static_cast<std::size_t>(size);
    if (truncated)
        return ReceiveState::malformed;
    message.body = Json::parse(text.data(), text.data() + size, nullptr, false);
    if (!message.body.is_object() || !message.body.contains("type") || !message.body["type"].is_string())
        return ReceiveState::malformed;
    return ReceiveState::message;
}

} // namespace arhost::ipc
