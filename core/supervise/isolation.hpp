// SPDX-License-Identifier: Apache-2.0
//
// How arhost-launcher isolates a worker. The worker adds the rest of the sandbox itself (sandbox/sandbox.hpp).
#pragma once

#include "base/usb_device.hpp"

#include <array>
#include <cstdint>

namespace arhost::supervise {

struct Isolation {
    // Starts the worker in a PID namespace and a control group, where the machine supports them. The worker keeps
    // CAP_SYS_ADMIN in its user namespace until it enters its sandbox.
    bool enabled = true;
    std::uint64_t memory_bytes = 0; // limit of the control group; 0: none
    // The worker's standard output is that of the host, which the launcher has inherited.
    bool standard_output = false;
    // base::UsbIdentity of the device to return to the kernel's drivers if the worker is killed; "": none
    std::array<char, base::max_usb_identity + 1> usb_device{};
};

} // namespace arhost::supervise
