// SPDX-License-Identifier: Apache-2.0
#include "worker/counters.hpp"

#include <stdexcept>

namespace arhost::worker {
namespace {

struct CounterListing {
    model::Counters counters;
    bool is_invalid = false;
};

void add_counter(void *context, const char *name, std::uint64_t value) noexcept {
    CounterListing &listing = *static_cast<CounterListing *>(context);
    try {
        if (!name || !listing.counters.try_emplace(name, value).second)
            listing.is_invalid = true;
    } catch (...) { // no exception may propagate into the plugin
        listing.is_invalid = true;
    }
}

} // namespace

model::Counters list_counters(const arhost_plugin &plugin, arhost_instance *instance) {
    const auto *extension = static_cast<const arhost_counters *>(plugin.get_extension(ARHOST_COUNTERS_EXTENSION));
    if (!extension)
        return {};
    if (extension->struct_size < sizeof *extension || !extension->list)
        throw std::runtime_error("the extension " ARHOST_COUNTERS_EXTENSION " is too short, or its 'list' is NULL");
    CounterListing listing;
    extension->list(instance, add_counter, &listing);
    if (listing.is_invalid || !model::are_valid(listing.counters))
        throw std::runtime_error("contract violation: the counters of its extension " ARHOST_COUNTERS_EXTENSION
                                 " are repeated, too many, or have invalid names");
    return std::move(listing.counters);
}

} // namespace arhost::worker
