// SPDX-License-Identifier: Apache-2.0
//
// What a plugin tells by the extension of arhost/devices.h.
#pragma once

#include "ipc/channel.hpp"

#include <arhost/arhost.h>

namespace arhost::worker {

// Asks the plugin, and adds to `answer` what ipc::devices_from_json reads; nothing where it has no such extension.
// Throws std::runtime_error, with a sentence for the user, where it breaks the extension's contract.
arhost_status list_devices(const arhost_plugin &plugin, const arhost_host &host, ipc::Json &answer);

} // namespace arhost::worker
