// SPDX-License-Identifier: Apache-2.0
#include "base/listening_socket.hpp"

#include "base/runtime_folder.hpp"

#include <algorithm>
#include <charconv>
#include <cstring>
#include <memory>
#include <netdb.h>
#include <optional>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

namespace arhost::base {
namespace {

namespace fs = std::filesystem;

constexpr int backlog = 64;

bool is_name(const std::string &text) {
    const bool is_number = std::ranges::all_of(text, [](unsigned char c) { return std::isdigit(c); });
    return !is_number &&
           std::ranges::all_of(text, [](unsigned char c) { return std::isalnum(c) || c == '-' || c == '_'; });
}

struct HostAndPort {
    std::string host, port;
};

std::optional<HostAndPort> split(const std::string &address) {
    const std::size_t colon = address.rfind(':');
    if (colon == std::string::npos)
        return std::nullopt;
    HostAndPort parts{address.substr(0, colon), address.substr(colon + 1)};
    if (parts.host.starts_with('[') && parts.host.ends_with(']'))
        parts.host = parts.host.substr(1, parts.host.size() - 2);
    else if (parts.host.find(':') != std::string::npos)
        return std::nullopt;
    if (parts.host == "localhost")
        parts.host = "127.0.0.1";
    unsigned port = 0;
    const char *end = parts.port.data() + parts.port.size();
    const auto [last, error] = std::from_chars(parts.port.data(), end, port);
    if (error != std::errc() || last != end || port > 65535)
        return std::nullopt;
    return parts;
}

struct FreeAddresses {
    void operator()(addrinfo *addresses) const { ::freeaddrinfo(addresses); }
};
using Addresses = std::unique_ptr<addrinfo, FreeAddresses>;

// Returns null if `host` is not a numeric address.
Addresses resolve(const HostAndPort &where) {
    addrinfo hints{};
    hints.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV | AI_PASSIVE;
    hints.ai_socktype = SOCK_STREAM;
    addrinfo *found = nullptr;
    return Addresses(::getaddrinfo(where.host.c_str(), where.port.c_str(), &hints, &found) == 0 ? found : nullptr);
}

sockaddr_un unix_address(const fs::path &path) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (path.native().size() >= sizeof address.sun_path)
        throw std::runtime_error("the path of the socket '" + path.string() + "' is longer than " +
                                 std::to_string(sizeof address.sun_path - 1) + " bytes; choose a shorter one");
    std::memcpy(address.sun_path, path.c_str(), path.native().size());
    return address;
}

UniqueFd make_socket(int family) {
    return checked(::socket(family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0), "socket");
}

} // namespace

fs::path named_socket(const std::string &name) {
    return runtime_folder() / (name + ".sock");
}

std::string problem_with_address(const std::string &address) {
    if (is_name(address) || address.starts_with('/'))
        return "";
    const auto parts = split(address);
    if (parts && resolve(*parts))
        return "";
    return "must be a name, the absolute path of a Unix socket, or ADDRESS:PORT with a port from 0 to 65535, as in "
           "127.0.0.1:8080";
}

ListeningSocket::ListeningSocket(const std::string &address) : address_(address) {
    if (const std::string problem = problem_with_address(address); !problem.empty())
        throw std::runtime_error("'" + address + "' " + problem);
    if (is_name(address)) {
        make_runtime_folder();
        listen_at_path(named_socket(address));
    } else if (address.starts_with('/')) {
        listen_at_path(address);
    } else {
        listen_at_port();
    }
}

void ListeningSocket::listen_at_path(const fs::path &path) {
    const sockaddr_un where = unix_address(path);
    fd_ = make_socket(AF_UNIX);
    const auto bind = [&] {
        return ::bind(fd_.get(), reinterpret_cast<const sockaddr *>(&where), sizeof where) == 0;
    };
    const mode_t mask = ::umask(0177); // the socket gets mode 0600
    bool bound = bind();
    if (!bound && errno == EADDRINUSE && fs::is_socket(path)) {
        try {
            connect_to(path);
            errno = EADDRINUSE;
        } catch (const std::system_error &error) {
            errno = EADDRINUSE;
            if (error.code().value() == ECONNREFUSED) // the program that listened has ended
                bound = ::unlink(path.c_str()) == 0 && bind();
        }
    }
    const int error = errno;
    ::umask(mask);
    if (!bound)
        throw std::runtime_error("cannot listen at '" + path.string() + "': " + std::strerror(error) +
                                 (error == EADDRINUSE ? ": another run uses it; choose another name" : ""));
    file_ = path;
    address_ = path.string();
    if (::listen(fd_.get(), backlog) != 0)
        throw_errno("cannot listen at '" + path.string() + "'");
}

void ListeningSocket::listen_at_port() {
    const Addresses addresses = resolve(*split(address_));
    fd_ = make_socket(addresses->ai_family);
    const int yes = 1;
    ::setsockopt(fd_.get(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes); // without waiting for old connections
    if (::bind(fd_.get(), addresses->ai_addr, addresses->ai_addrlen) != 0 || ::listen(fd_.get(), backlog) != 0)
        throw std::runtime_error("cannot listen at " + address_ + ": " + std::strerror(errno) +
                                 (errno == EADDRINUSE ? ": another program uses it; choose another port" : ""));
    sockaddr_storage bound{};
    socklen_t size = sizeof bound;
    char host[64], port[8];
    if (::getsockname(fd_.get(), reinterpret_cast<sockaddr *>(&bound), &size) == 0 &&
        ::getnameinfo(reinterpret_cast<const sockaddr *>(&bound), size, host, sizeof host, port, sizeof port,
                      NI_NUMERICHOST | NI_NUMERICSERV) == 0)
        address_ = (bound.ss_family == AF_INET6 ? "[" + std::string(host) + "]:" : std::string(host) + ":") + port;
}

ListeningSocket::~ListeningSocket() {
    if (fd_ && !file_.empty())
        ::unlink(file_.c_str());
}

UniqueFd connect_to(const fs::path &socket) {
    const sockaddr_un where = unix_address(socket);
    UniqueFd fd = checked(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0), "socket");
    if (::connect(fd.get(), reinterpret_cast<const sockaddr *>(&where), sizeof where) != 0)
        throw_errno("cannot connect to '" + socket.string() + "'");
    return fd;
}

} // namespace arhost::base
