// SPDX-License-Identifier: Apache-2.0
#include "host/slots.hpp"

#include "supervise/component.hpp"

#include <algorithm>

namespace arhost::host {

Lease::~Lease() {
    if (pool_)
        pool_->in_use_[index_] = false;
}

const supervise::RegionPointer &Lease::region() const {
    return pool_->region_;
}

std::span<std::byte> Lease::bytes() const {
    return region()->layout.slot(region()->mapping, index_);
}

SlotPool::SlotPool(supervise::RegionPointer region) : region_(std::move(region)), in_use_(region_->layout.count) {}

bool SlotPool::has_free() const {
    return std::ranges::find(in_use_, false) != in_use_.end();
}

std::optional<Lease> SlotPool::acquire() {
    const auto free = std::ranges::find(in_use_, false);
    if (free == in_use_.end())
        return std::nullopt;
    *free = true;
    return Lease(shared_from_this(), static_cast<std::uint32_t>(free - in_use_.begin()));
}

} // namespace arhost::host
