// SPDX-License-Identifier: Apache-2.0
#include "worker/devices.hpp"

#include <cstddef>
#include <exception>
#include <stdexcept>

namespace arhost::worker {
namespace {

struct Listing {
    devices::DeviceList list;
    std::exception_ptr fault; // contract violation
};

void add_device(void *context, const arhost_device *device) noexcept {
    Listing &listing = *static_cast<Listing *>(context);
    if (listing.fault)
        return;
    try {
        if (listing.list.devices.size() < ARHOST_MAX_DEVICES)
            listing.list.devices.push_back(devices::describe(device));
        else
            ++listing.list.left_out;
    } catch (...) { // no exception may propagate into the plugin
        listing.fault = std::current_exception();
    }
}

} // namespace

arhost_status list_devices(const arhost_plugin &plugin, const arhost_host &host,
                           std::optional<devices::DeviceList> &list) {
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
        std::rethrow_exception(listing.fault);
    list = std::move(listing.list);
    return status;
}

} // namespace arhost::worker
