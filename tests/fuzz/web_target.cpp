// SPDX-License-Identifier: Apache-2.0
//
// The target for what clients send to the web server of sink_web.
#include "targets.hpp"

#include "sink_web/server.hpp"

#include <arhost/control.h>

#include <array>
#include <poll.h>
#include <stdexcept>
#include <string>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

namespace arhost::fuzz {
namespace {

// Answers each command at once.
const arhost_control control{sizeof control, 0,
                             [](const arhost_host *, const char *, arhost_take_answer take, void *context) {
                                 take(context, R"({"ok":true})");
                                 return arhost_status{ARHOST_STATUS_OK};
                             }};
const arhost_host host{.struct_size = sizeof host,
                       .abi_version = ARHOST_ABI_VERSION,
                       .name = "fuzz",
                       .version = "",
                       .context = nullptr,
                       .log = nullptr,
                       .progress = nullptr,
                       .cancelled = nullptr,
                       .get_extension = [](const arhost_host *, const char *) -> const void * { return &control; }};

class TestServer {
public:
    TestServer() : socket_(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)) {
        const sa_family_t family = AF_UNIX; // the kernel chooses an abstract name
        if (::bind(socket_, reinterpret_cast<const sockaddr *>(&family), sizeof family) != 0 ||
            ::getsockname(socket_, reinterpret_cast<sockaddr *>(&address_), &address_size_) != 0 ||
            ::listen(socket_, 16) != 0)
            throw std::runtime_error("no socket for the web server");
        server_.emplace(web::Settings{socket_, "", "lab", 64, 48}, frame_, control_);
    }
    ~TestServer() {
        server_.reset();
        ::close(socket_);
    }
    TestServer(const TestServer &) = delete;
    TestServer &operator=(const TestServer &) = delete;

    // Returns the beginning of the answer. A stream does not end: after `max_wait_ms` without a byte, returns what
    // has arrived.
    std::string answer(Bytes request, int max_wait_ms) {
        server_->tick();
        const int client = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
        if (::connect(client, reinterpret_cast<const sockaddr *>(&address_), address_size_) != 0)
            throw std::runtime_error("the web server accepts no connection");
        // The server may close the connection before it has read everything.
        (void)::send(client, request.data(), request.size(), MSG_NOSIGNAL);
        ::shutdown(client, SHUT_WR);
        std::string answer;
        std::array<char, 4096> block{};
        pollfd ready{client, POLLIN, 0};
        for (ssize_t size;
             ::poll(&ready, 1, max_wait_ms) == 1 && (size = ::read(client, block.data(), block.size())) > 0;)
            if (answer.size() < block.size())
                answer.append(block.data(), static_cast<std::size_t>(size));
        ::close(client);
        return answer;
    }

private:
    int socket_;
    sockaddr_un address_{};
    socklen_t address_size_ = sizeof address_;
    web::NewestFrame frame_{80};
    HostControl control_{Host(&host)};
    std::optional<web::Server> server_;
};

} // namespace

void run_web(Bytes bytes) {
    static TestServer server;
    constexpr std::string_view usual = "GET /openapi.json HTTP/1.1\r\nHost: localhost\r\n\r\n";
    const std::string answer = server.answer(bytes, 20);
    if (!answer.empty() && !answer.starts_with("HTTP/1."))
        throw std::logic_error("the answer is not one of HTTP: " + answer);
    const std::string next =
        server.answer({reinterpret_cast<const std::uint8_t *>(usual.data()), usual.size()}, 10'000);
    if (!next.starts_with("HTTP/1.1 200"))
        throw std::logic_error("the next request fails: " + next);
}

} // namespace arhost::fuzz
