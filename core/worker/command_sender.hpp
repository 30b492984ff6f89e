// SPDX-License-Identifier: Apache-2.0
//
// Implements arhost.host.control/1 (arhost/control.h): sends a sink's commands to the host and delivers the answers.
#pragma once

#include "worker/link.hpp"

#include <arhost/control.h>

#include <map>
#include <mutex>

namespace arhost::worker {

class CommandSender {
public:
    explicit CommandSender(Link &link) : link_(link) {}

    void enable(); // the plugin is started
    // Same as arhost_control.send. May be called on any thread.
    arhost_status send(const char *command, arhost_take_answer take, void *context);
    // Calls the function that waits for the answer. Must be called on the worker's main thread.
    void deliver(const ipc::messages::Answer &answer);

private:
    struct Pending {
        arhost_take_answer take;
        void *context;
    };
    Link &link_;
    std::mutex mutex_; // protects the members below
    bool enabled_ = false;
    std::uint64_t next_id_ = 1;
    std::map<std::uint64_t, Pending> pending_; // key: id of the command
};

} // namespace arhost::worker
