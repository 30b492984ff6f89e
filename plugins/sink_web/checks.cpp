// SPDX-License-Identifier: Apache-2.0
#include "checks.hpp"

#include <algorithm>
#include <arpa/inet.h>
#include <cctype>
#include <cstring>
#include <netinet/in.h>
#include <sys/socket.h>
#include <vector>

namespace arhost::web {
namespace {

bool equal_ignoring_case(std::string_view a, std::string_view b) {
    return std::ranges::equal(a, b,
                              [](unsigned char x, unsigned char y) { return std::tolower(x) == std::tolower(y); });
}

// Returns the host without its port, or "" if the text is malformed.
std::string without_port(std::string_view host) {
    const std::size_t bracket = host.starts_with('[') ? host.find(']') : 0;
    if (bracket == std::string_view::npos)
        return "";
    const std::size_t colon = host.find(':', bracket);
    if (colon == std::string_view::npos)
        return std::string(host);
    const std::string_view port = host.substr(colon + 1);
    if (port.empty() || !std::ranges::all_of(port, [](unsigned char c) { return std::isdigit(c) != 0; }))
        return "";
    return std::string(host.substr(0, colon));
}

bool is_ip_address(const std::string &text) {
    in6_addr address{};
    if (text.starts_with('[') && text.ends_with(']'))
        return ::inet_pton(AF_INET6, text.substr(1, text.size() - 2).c_str(), &address) == 1;
    return ::inet_pton(AF_INET, text.c_str(), &address) == 1;
}

// Returns the names in a comma-separated list.
std::vector<std::string_view> names_of(std::string_view list) {
    std::vector<std::string_view> names;
    for (std::size_t begin = 0; begin <= list.size();) {
        const std::size_t end = std::min(list.find(',', begin), list.size());
        std::string_view name = list.substr(begin, end - begin);
        while (name.starts_with(' '))
            name.remove_prefix(1);
        while (name.ends_with(' '))
            name.remove_suffix(1);
        if (!name.empty())
            names.push_back(name);
        begin = end + 1;
    }
    return names;
}

} // namespace

bool is_local(int socket) {
    sockaddr_storage address{};
    socklen_t size = sizeof address;
    if (::getsockname(socket, reinterpret_cast<sockaddr *>(&address), &size) != 0)
        return false;
    if (address.ss_family == AF_INET) {
        sockaddr_in v4{};
        std::memcpy(&v4, &address, sizeof v4);
        return ntohl(v4.sin_addr.s_addr) >> 24 == 127;
    }
    if (address.ss_family == AF_INET6) {
        sockaddr_in6 v6{};
        std::memcpy(&v6, &address, sizeof v6);
        return IN6_IS_ADDR_LOOPBACK(&v6.sin6_addr);
    }
    return address.ss_family == AF_UNIX;
}

bool is_own_host(std::string_view host, std::string_view hosts) {
    const std::string name = without_port(host);
    if (name.empty())
        return false;
    return is_ip_address(name) || equal_ignoring_case(name, "localhost") ||
           std::ranges::any_of(names_of(hosts),
                               [&](std::string_view allowed) { return equal_ignoring_case(name, allowed); });
}

std::string url_of(const std::string &address, std::string_view hosts) {
    const std::size_t colon = address.rfind(':');
    const std::string host = address.substr(0, colon);
    if (host != "0.0.0.0" && host != "[::]")
        return "http://" + address + "/";
    const std::vector<std::string_view> names = names_of(hosts);
    return "http://" + (names.empty() ? "localhost" : std::string(names.front())) + address.substr(colon) + "/";
}

bool is_own_origin(std::string_view origin, std::string_view host) {
    for (const std::string_view scheme : {"http://", "https://"})
        if (origin.starts_with(scheme))
            return equal_ignoring_case(origin.substr(scheme.size()), host);
    return false;
}

bool has_token(std::string_view authorization, std::string_view token) {
    constexpr std::string_view scheme = "Bearer ";
    if (authorization.size() < scheme.size() || !equal_ignoring_case(authorization.substr(0, scheme.size()), scheme))
        return false;
    authorization.remove_prefix(scheme.size());
    volatile unsigned char difference = authorization.size() != token.size();
    for (std::size_t i = 0; i < std::min(authorization.size(), token.size()); ++i)
        difference = static_cast<unsigned char>(difference | (authorization[i] ^ token[i]));
    return difference == 0;
}

} // namespace arhost::web
