// SPDX-License-Identifier: Apache-2.0
#include "worker/devices.hpp"

#include "ipc/json_abi.hpp"

#include <cstddef>
#include <stdexcept>
#include <string>

namespace arhost::worker {
namespace {

using namespace ipc;

// As much as one message holds, however many there are.
struct Taken {
    Json devices = Json::array();
    std::uint64_t left_out = 0;
    bool broken = false;
};

void take(void *context, const arhost_device *device) noexcept {
    Taken &taken = *static_cast<Taken *>(context);
    constexpr std::size_t whole = offsetof(arhost_device, abilities) + sizeof(arhost_device::abilities);
    if (!device || device->struct_size < whole || !device->name)
        taken.broken = true;
    else if (taken.devices.size() < max_devices)
        taken.devices.push_back(to_json(*device));
    else
        ++taken.left_out;
}

} // namespace

arhost_status list_devices(const arhost_plugin &plugin, const arhost_host &host, Json &answer) {
    const auto *extension = static_cast<const arhost_devices *>(plugin.get_extension(ARHOST_DEVICES_EXTENSION));
    if (!extension)
        return ARHOST_STATUS_OK;
    constexpr std::size_t whole = offsetof(arhost_devices, list) + sizeof(arhost_devices::list);
    if (extension->struct_size < whole || !extension->list)
        throw std::runtime_error("its extension " ARHOST_DEVICES_EXTENSION " is too short, or has no 'list'");
    Taken taken;
    const arhost_status status = extension->list(&host, take, &taken);
    if (taken.broken)
        throw std::runtime_error("it told of a device that has no name, or is too short");
    answer["devices"] = std::move(taken.devices);
    answer["left_out"] = taken.left_out;
    return status;
}

} // namespace arhost::worker
