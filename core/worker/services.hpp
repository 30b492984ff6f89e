// SPDX-License-Identifier: Apache-2.0
//
// How the worker serves each kind of plugin.
#pragma once

#include "ipc/json_abi.hpp"
#include "ipc/protocol.hpp"
#include "worker/link.hpp"

#include <map>
#include <memory>

namespace arhost::worker {

// The memory that commands refer to.
struct Memory {
    struct Region {
        ipc::SlotLayout layout;
        ipc::Mapping mapping;
        std::span<std::byte> slot(std::uint32_t index) const; // throws HostGone where it is out of range
    };
    std::map<std::uint32_t, Region> inputs; // by generation
    Region output;

    const Region &input(std::uint32_t generation) const; // throws HostGone
};

class Service {
public:
    virtual ~Service() = default;
    // The kind's start, with the setup of the host's `create`; what it returns goes into `ready`.
    virtual arhost_status start(const ipc::Message &create, ipc::Json &ready) = 0;
    // One command of the kind's own.
    virtual arhost_status execute(const ipc::Command &command, const Memory &memory, ipc::Result &result) = 0;
    virtual bool wants_idle() const { return false; }
    virtual arhost_status idle() { return ARHOST_STATUS_OK; }
    virtual arhost_status stop() = 0;
};

std::unique_ptr<Service> make_service(const arhost_plugin &plugin, arhost_instance *instance);

} // namespace arhost::worker
