// SPDX-License-Identifier: Apache-2.0
#include "udp_sender.hpp"

#include <netdb.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <memory>

namespace arhost::poses {
namespace {

struct FreeAddresses {
    void operator()(addrinfo *addresses) const { ::freeaddrinfo(addresses); }
};

bool is_port(std::string_view text) {
    std::uint16_t port = 0;
    const char *const end = text.data() + text.size();
    const auto [last, error] = std::from_chars(text.data(), end, port);
    return error == std::errc() && last == end && port > 0;
}

Failure failure(const std::string &why, arhost_status status = ARHOST_STATUS_ERROR_CONFIGURATION) {
    return Failure(status, "udp: " + why);
}

int open_socket(int family) {
    const int fd = ::socket(family, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd >= 0)
        return fd;
    const bool is_refused = errno == EPERM || errno == EACCES || errno == EAFNOSUPPORT;
    throw failure("cannot open a socket: " + std::string(std::strerror(errno)) +
                  (is_refused ? "; this output needs 'allow: [network]'" : ""));
}

std::string numeric(const addrinfo &address) {
    char host[NI_MAXHOST] = "", port[NI_MAXSERV] = "";
    ::getnameinfo(address.ai_addr, address.ai_addrlen, host, sizeof host, port, sizeof port,
                  NI_NUMERICHOST | NI_NUMERICSERV);
    return (address.ai_family == AF_INET6 ? "[" + std::string(host) + "]" : host) + ":" + port;
}

} // namespace

UdpSender::UdpSender(const Host &host, const std::string &receiver) : host_(host), receiver_(receiver) {
    const std::size_t colon = receiver.rfind(':');
    std::string name = receiver.substr(0, colon);
    if (name.starts_with('[') && name.ends_with(']'))
        name = name.substr(1, name.size() - 2);
    if (colon == std::string::npos || name.empty())
        throw failure("'" + receiver + "' must be HOST:PORT, as in 127.0.0.1:9000");
    if (const std::string_view port = std::string_view(receiver).substr(colon + 1); !is_port(port))
        throw failure("'" + receiver + "': the port '" + std::string(port) + "' must be a number from 1 to 65535");
    ::close(open_socket(AF_INET)); // without the permission, names would seem to be unreachable
    addrinfo hints{}, *found = nullptr;
    hints.ai_socktype = SOCK_DGRAM;
    hints.ai_flags = AI_NUMERICSERV;
    const int error = ::getaddrinfo(name.c_str(), receiver.c_str() + colon + 1, &hints, &found);
    const std::unique_ptr<addrinfo, FreeAddresses> addresses(found);
    if (error != 0)
        throw failure("cannot find '" + receiver + "': " + ::gai_strerror(error),
                      error == EAI_AGAIN ? ARHOST_STATUS_ERROR_IO : ARHOST_STATUS_ERROR_CONFIGURATION);
    address_ = numeric(*found);
    fd_ = open_socket(found->ai_family);
    if (::connect(fd_, found->ai_addr, found->ai_addrlen) != 0) {
        const std::string reason = std::strerror(errno);
        ::close(fd_);
        throw failure("cannot send to '" + receiver + "' (" + address_ + "): " + reason);
    }
}

UdpSender::~UdpSender() {
    ::close(fd_);
}

void UdpSender::send(std::string_view datagram) {
    if (::send(fd_, datagram.data(), datagram.size(), MSG_NOSIGNAL) >= 0 || errno == EAGAIN)
        return;
    const int error = errno;
    if (!reported_errors_.insert(error).second)
        return;
    if (error == ECONNREFUSED) // of an earlier datagram
        host_.warn("no program receives datagrams at " + address_ + " ('udp: " + receiver_ +
                   "'); start it, or set 'udp' to its address");
    else
        host_.warn("cannot send " + std::to_string(datagram.size()) + " bytes to '" + receiver_ + "' (" + address_ +
                   "): " + std::strerror(error));
}

} // namespace arhost::poses
