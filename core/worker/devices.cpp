// SPDX-License-Identifier: Apache-2.0
#include "worker/devices.hpp"

#include <cstddef>
#include <stdexcept>

namespace arhost::worker {
namespace {

struct Listing {
    ipc::DeviceList list;
    const char *fault = nullptr; // contract violation
};

void add_device(void *context, const arhost_device *device) noexcept {
    Listing &listing = *static_cast<Listing *>(context);
    constexpr std::size_t min_size = offsetof(arhost_device, abilities) + sizeof(arhost_device::abilities);
    if (!device)
        listing.fault = "it reported a device that is NULL";
    else if (device->struct_size < min_size)
        listing.fault = "it reported a device whose struct_size is too small";
    else if (!device->name)
        listing.fault = "it reported a device without a name";
    else if (listing.list.devices.size() < ipc::max_devices)
        listing.list.devices.push_back(ipc::describe(*device));
    else
        ++listing.list.left_out;
}

} // namespace

arhost_status list_devices(const arhost_plugin &plugin, const arhost_host &host,
                           std::optional<ipc::DeviceList> &list) {
    const auto *extension = static_cast<const arhost_devices *>(plugin.get_extension(ARHOST_DEVICES_EXTENSION));
    if (!extension)
        return ARHOST_STATUS_OK;
    constexpr std::size_t min_size = offsetof(arhost_devices, list) + sizeof(arhost_devices::list);
    if (extension->struct_size < min_size)
        throw std::runtime_error("the struct_size of its extension " ARHOST_DEVICES_EXTENSION " is too small");
    if (!extension->list)
        throw std::runtime_error("the function 'list' of its extension " ARHOST_DEVICES_EXTENSION " is NULL");
    Listing listing;
    const arhost_status status = extension->list(&host, add_device, &listing);
    if (listing.fault)
        throw std::runtime_error(listing.fault);
    list = std::move(listing.list);
    return status;
}

} // namespace arhost::worker
