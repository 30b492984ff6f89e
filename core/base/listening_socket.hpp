// SPDX-License-Identifier: Apache-2.0
//
// Listening sockets of outputs, and the Unix sockets with which other programs find a running arhost.
#pragma once

#include "base/unique_fd.hpp"

#include <filesystem>
#include <string>

namespace arhost::base {

// Returns the Unix socket with this name: $XDG_RUNTIME_DIR/arhost/NAME.sock, or /tmp/arhost-UID/NAME.sock if the
// variable is not set.
std::filesystem::path named_socket(const std::string &name);

// Returns why `address` is invalid, or "". Three forms are valid: a name of letters, digits, "-" and "_" that is not
// a number; the absolute path of a Unix socket; "127.0.0.1:8080", "[::1]:8080" or "localhost:8080". The port 0 means
// any free port.
std::string problem_with_address(const std::string &address);

// A non-blocking stream socket that listens at an address.
class ListeningSocket {
public:
    // A Unix socket has mode 0600; its folder is created with mode 0700. Throws std::runtime_error with a message for
    // the user if the address is invalid or in use. Replaces the socket file of a program that has ended.
    explicit ListeningSocket(const std::string &address);
    ~ListeningSocket(); // deletes the socket file
    ListeningSocket(ListeningSocket &&) = default;
    ListeningSocket &operator=(ListeningSocket &&) = delete;

    int fd() const { return fd_.get(); }
    const std::string &address() const { return address_; } // contains the path of a named socket and the actual port

private:
    void listen_at_path(const std::filesystem::path &path);
    void listen_at_port();

    UniqueFd fd_;
    std::string address_;
    std::filesystem::path file_; // "" for TCP
};

// Connects to a Unix socket. Throws std::system_error.
UniqueFd connect_to(const std::filesystem::path &socket);

} // namespace arhost::base
