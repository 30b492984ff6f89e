// SPDX-License-Identifier: Apache-2.0
//
// Calls the functions of a plugin, for each kind of plugin.
#pragma once

#include "ipc/messages.hpp"
#include "ipc/protocol.hpp"
#include "worker/link.hpp"

#include <map>
#include <memory>

namespace arhost::worker {

// The shared memory to whose slots the commands refer.
struct Memory {
    struct Region {
        ipc::SlotLayout layout;
        ipc::Mapping mapping;
        std::span<std::byte> slot(std::uint32_t index) const; // throws ipc::ProtocolViolation if out of range
    };
    std::map<std::uint32_t, Region> inputs; // key: generation
    Region output;

    const Region &input(std::uint32_t generation) const; // throws ipc::ProtocolViolation
};

class Service {
public:
    virtual ~Service() = default;
    // Calls the plugin's start with `setup` and fills `ready`. `fds`: the descriptors that
    // accompanied Create.
    virtual arhost_status start(const ipc::messages::Setup &setup, const std::vector<base::UniqueFd> &fds,
                                ipc::messages::Ready &ready) = 0;
    // Calls the plugin's per-frame function.
    virtual arhost_status execute(const ipc::Command &command, const Memory &memory, ipc::Result &result) = 0;
    virtual bool wants_idle() const { return false; }
    virtual arhost_status idle() { return ARHOST_STATUS_OK; }
    virtual arhost_status stop() = 0;
};

// The link and the host must outlive the Service.
std::unique_ptr<Service> make_service(const Link &link, const arhost_host &host, const arhost_plugin &plugin,
                                      arhost_instance *instance);

} // namespace arhost::worker
