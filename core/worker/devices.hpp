// SPDX-License-Identifier: Apache-2.0
//
// Lists a plugin's devices through the extension of arhost/devices.h.
#pragma once

#include "devices/device_list.hpp"

#include <arhost/arhost.h>

namespace arhost::worker {

// Sets `list`, or leaves it unchanged if the plugin does not support the extension. Returns the status of the
// plugin's `list` function, or ARHOST_STATUS_OK without the extension. Throws std::runtime_error with a message for
// the user if the plugin violates the extension's contract.
arhost_status list_devices(const arhost_plugin &plugin, const arhost_host &host,
                           std::optional<devices::DeviceList> &list);

} // namespace arhost::worker
