// SPDX-License-Identifier: Apache-2.0
//
// The control channel between the host and a worker: JSON messages with file descriptors over a Unix socket that
// preserves message boundaries. It carries the infrequent messages of messages.hpp; the
// commands and results of frames go through the rings (protocol.hpp).
#pragma once

#include "base/unique_fd.hpp"

#include <nlohmann/json_fwd.hpp>

#include <utility>
#include <vector>

namespace arhost::ipc {

using Json = nlohmann::json;

struct Message; // message.hpp

enum class ReceiveState {
    message,
    none, // no message within the timeout
    closed,
    malformed // the message is too large, is not a JSON object, or has no "type"
};

// One end of a control channel. Each call specifies whether it blocks: the implementation uses MSG_DONTWAIT instead
// of O_NONBLOCK.
class Channel {
public:
    static constexpr std::size_t max_message_size = 128 * 1024;

    Channel() = default;
    explicit Channel(base::UniqueFd fd) : fd_(std::move(fd)) {}
    static std::pair<Channel, Channel> make_pair();

    // Returns false if the peer has closed its end, or if `wait` is false and the queue of the peer is full (errno is
    // EAGAIN in this case).
    bool send(const Json &body, const std::vector<int> &fds = {}, bool wait = true) const;

    // Receives a message. Waits for up to `timeout_ms`; 0: does not wait; -1: waits without limit.
    ReceiveState receive(Message &message, int timeout_ms) const;

    int fd() const { return fd_.get(); }
    void close() { fd_.reset(); }

private:
    base::UniqueFd fd_;
};

} // namespace arhost::ipc
