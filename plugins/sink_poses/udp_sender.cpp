// SPDX-License-Identifier: Apache-2.0
#include "udp_sender.hpp"

#include <netdb.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <memory>
#include <utility>

namespace arhost::poses {
namespace {

constexpr const char *needs_network = "; this output needs 'allow: [network]'";

struct FreeAddresses {
    void operator()(addrinfo *addresses) const { ::freeaddrinfo(addresses); }
};

} // namespace

UdpSender::UdpSender(const Host &host, const std::string &receiver) : host_(host), receiver_(receiver) {
    const auto fail = [&](const std::string &why) {
        return Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "udp: " + why);
    };
    const std::size_t colon = receiver.rfind(':');
    std::string name = receiver.substr(0, colon);
    if (name.starts_with('[') && name.ends_with(']'))
        name = name.substr(1, name.size() - 2);
    if (colon == std::string::npos || name.empty())
        throw fail("'" + receiver + "' must be HOST:PORT, as in 127.0.0.1:9000");
    addrinfo hints{}, *found = nullptr;
    hints.ai_socktype = SOCK_DGRAM;
    hints.ai_flags = AI_NUMERICSERV;
    const int error = ::getaddrinfo(name.c_str(), receiver.c_str() + colon + 1, &hints, &found);
    const std::unique_ptr<addrinfo, FreeAddresses> addresses(found);
    if (error != 0)
        throw fail("cannot find '" + receiver + "': " + ::gai_strerror(error) + needs_network);
    fd_ = ::socket(found->ai_family, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd_ < 0 || ::connect(fd_, found->ai_addr, found->ai_addrlen) != 0) {
        const std::string reason = std::strerror(errno);
        if (fd_ >= 0)
            ::close(fd_);
        throw fail("cannot send to '" + receiver + "': " + reason + needs_network);
    }
}

UdpSender::~UdpSender() {
    ::close(fd_);
}

void UdpSender::send(std::string_view datagram) {
    if (::send(fd_, datagram.data(), datagram.size(), MSG_NOSIGNAL) >= 0 || errno == EAGAIN ||
        errno == ECONNREFUSED) // an earlier datagram has found no receiver
        return;
    if (!std::exchange(has_warned_, true))
        host_.warn("cannot send " + std::to_string(datagram.size()) + " bytes to '" + receiver_ +
                   "': " + std::strerror(errno));
}

} // namespace arhost::poses
