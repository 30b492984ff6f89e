// SPDX-License-Identifier: Apache-2.0
//
// Reads the counters of a plugin (arhost/counters.h).
#pragma once

#include "model/plugin_description.hpp"

namespace arhost::worker {

// Returns nothing if the plugin does not have the extension. Throws std::runtime_error if the plugin violates its
// contract.
model::Counters list_counters(const arhost_plugin &plugin, arhost_instance *instance);

} // namespace arhost::worker
