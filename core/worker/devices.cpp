// SPDX-License-Identifier: Apache-2.0
#include "worker/devices.hpp"

#include <cstddef>
#include <stdexcept>

namespace arhost::worker {
namespace {

struct Listing {
    ipc::DeviceList list;
    bool is_invalid = false;
};

void add_device(void *context, const arhost_device *device) noexcept {
    Listing &listing = *static_cast<Listing *>(context);
    constexpr std::size_t min_size = offsetof(arhost_device, abilities) + sizeof(arhost_device::abilities);
    if (!device || device->struct_size < min_size || !device->name)
        listing.is_invalid = true;
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
    if (extension->struct_size < min_size || !extension->list)
        throw std::runtime_error("its extension " ARHOST_DEVICES_EXTENSION " is too short or has no 'list'");
    Listing listing;
    const arhost_status status = extension->list(&host, add_device, &listing);
    if (listing.is_invalid)
        throw std::runtime_error("it reported a device that has no name or whose struct is too short");
    list = std::move(listing.list);
    return status;
}

} // namespace arhost::worker
