// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <arpa/inet.h>
#include <cstdint>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <stdexcept>
#include <string>
#include <utility>

namespace arhost::test {

struct HttpAnswer {
    int status = 0;
    std::string head, body;
};

// A TCP connection to 127.0.0.1.
class HttpClient {
public:
    // `from`: the last byte of the client's own address, 127.0.0.x.
    explicit HttpClient(std::uint16_t port, int receive_buffer = 0, std::uint32_t from = 1)
        : fd_(::socket(AF_INET, SOCK_STREAM, 0)) {
        const timeval limit{30, 0};
        ::setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
        if (receive_buffer > 0)
            ::setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof receive_buffer);
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK + from - 1);
        ::bind(fd_, reinterpret_cast<const sockaddr *>(&address), sizeof address);
        address.sin_port = htons(port);
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        ::connect(fd_, reinterpret_cast<const sockaddr *>(&address), sizeof address);
    }
    ~HttpClient() {
        if (fd_ >= 0)
            ::close(fd_);
    }
    HttpClient(HttpClient &&other) noexcept
        : fd_(std::exchange(other.fd_, -1)), received_(std::move(other.received_)) {}
    HttpClient &operator=(HttpClient &&) = delete;

    int fd() const { return fd_; }
    void send(const std::string &text) { (void)!::send(fd_, text.data(), text.size(), MSG_NOSIGNAL); }

    // Receives up to and including `end`. Returns what arrived if the server closes the connection earlier.
    std::string receive_to(const std::string &end) {
        std::size_t at = 0;
        while ((at = received_.find(end)) == std::string::npos)
            if (!receive_more())
                return std::exchange(received_, "");
        return take(at + end.size());
    }
    std::string receive(std::size_t size) {
        while (received_.size() < size && receive_more()) {
        }
        return take(std::min(size, received_.size()));
    }
    std::string receive_all() {
        while (receive_more()) {
        }
        return std::exchange(received_, "");
    }
    HttpAnswer receive_answer() {
        HttpAnswer answer;
        answer.head = receive_to("\r\n\r\n");
        if (answer.head.size() > 12)
            answer.status = std::stoi(answer.head.substr(9, 3));
        const std::size_t length = answer.head.find("Content-Length: ");
        if (length != std::string::npos)
            answer.body = receive(std::stoul(answer.head.substr(length + 16)));
        return answer;
    }
    // Receives the next frame of /stream.mjpg, whose chunked transfer coding it removes. Returns "" at the end.
    std::string receive_frame() {
        const std::string length = "Content-Length: ";
        std::size_t begin = std::string::npos, size = 0;
        while ((begin = stream_.find("\r\n\r\n")) == std::string::npos)
            if (!receive_chunk())
                return "";
        size = std::stoul(stream_.substr(stream_.find(length) + length.size()));
        begin += 4;
        while (stream_.size() < begin + size)
            if (!receive_chunk())
                return "";
        const std::string frame = stream_.substr(begin, size);
        stream_.erase(0, begin + size);
        return frame;
    }

private:
    bool receive_chunk() {
        const std::string line = receive_to("\r\n");
        if (line.empty())
            return false;
        const std::size_t size = std::stoul(line, nullptr, 16);
        const std::string chunk = receive(size + 2);
        stream_ += chunk.substr(0, size);
        return size > 0 && chunk.size() == size + 2;
    }
    bool receive_more() {
        char buffer[65536];
        const ssize_t size = ::recv(fd_, buffer, sizeof buffer, 0);
        if (size > 0)
            received_.append(buffer, static_cast<std::size_t>(size));
        return size > 0;
    }
    std::string take(std::size_t size) {
        std::string taken = received_.substr(0, size);
        received_.erase(0, size);
        return taken;
    }

    int fd_;
    std::string received_, stream_;
};

} // namespace arhost::test
