// SPDX-License-Identifier: Apache-2.0
//
// The control channel between the host and a worker: JSON messages with file descriptors, over a Unix
// socket that keeps message borders. For what happens a few times in a worker's life (hello, create,
// attach, log); frames go through the rings.
#pragma once

#include "base/unique_fd.hpp"

#include <nlohmann/json.hpp>

#include <optional>
#include <utility>
#include <vector>

namespace arhost::ipc {

using Json = nlohmann::json;

struct Message {
    Json body; // an object; "type" says which
    std::vector<base::UniqueFd> fds;
};

enum class ReceiveState { message, none, closed, breach };

// Blocking and non-blocking use is chosen by call, not by a flag of the socket, which the peer's end
// does not share.
class Channel {
public:
    static constexpr std::size_t max_message_size = 128 * 1024;

    Channel() = default;
    explicit Channel(base::UniqueFd fd) : fd_(std::move(fd)) {}
    static std::pair<Channel, Channel> make_pair();

    // False where the peer is gone or, without `wait`, its queue is full.
    bool send(const Json &body, std::initializer_list<int> fds = {}, bool wait = true) const;

    // Waits up to `timeout_ms` (0: not, -1: for ever). `breach`: too large, no JSON object, no "type".
    ReceiveState receive(Message &message, int timeout_ms) const;

    int fd() const { return fd_.get(); }
    void close() { fd_.reset(); }

private:
    base::UniqueFd fd_;
};

} // namespace arhost::ipc
