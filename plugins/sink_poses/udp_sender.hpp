// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <arhost-cpp/plugin.hpp>

#include <set>
#include <string>
#include <string_view>

namespace arhost::poses {

// Sends datagrams to one receiver. Never waits: what the network does not take at once is lost.
class UdpSender {
public:
    // `receiver`: HOST:PORT, with brackets around an IPv6 address. Throws Failure.
    UdpSender(const Host &host, const std::string &receiver);
    ~UdpSender();
    UdpSender(const UdpSender &) = delete;
    UdpSender &operator=(const UdpSender &) = delete;

    void send(std::string_view datagram);

private:
    Host host_;
    std::string receiver_, address_; // as configured; numeric
    int fd_ = -1;
    std::set<int> reported_errors_; // of send
};

} // namespace arhost::poses
