// SPDX-License-Identifier: Apache-2.0
#include "host/slots.hpp"

#include "supervise/component.hpp"

#include <algorithm>

namespace arhost::host {

Lease::~Lease() {
    if (pool_)
        --pool_->leases_[index_];
}

Lease Lease::share() const {
    ++pool_->leases_[index_];
    return {pool_, index_};
}

const supervise::RegionPointer &Lease::region() const {
    return pool_->region_;
}

std::span<std::byte> Lease::bytes() const {
    return region()->layout.slot(region()->mapping, index_);
}

SlotPool::SlotPool(supervise::RegionPointer region) : region_(std::move(region)), leases_(region_->layout.count) {}

bool SlotPool::has_free() const {
    return std::ranges::find(leases_, 0u) != leases_.end();
}

std::optional<Lease> SlotPool::acquire() {
    const auto free = std::ranges::find(leases_, 0u);
    if (free == leases_.end())
        return std::nullopt;
    *free = 1;
    return Lease(shared_from_this(), static_cast<std::uint32_t>(free - leases_.begin()));
}

} // namespace arhost::host
