// SPDX-License-Identifier: Apache-2.0
//
// Who holds which slot of a region. Only the host decides that: a worker is told a slot, and a dead
// worker's slots come back by the leases' destruction.
#pragma once

#include "supervise/component.hpp"

#include <memory>
#include <optional>
#include <vector>

namespace arhost::host {

class SlotPool;

// The right to use one slot, until it is destroyed.
class Lease {
public:
    Lease() = default;
    Lease(std::shared_ptr<SlotPool> pool, std::uint32_t index) : pool_(std::move(pool)), index_(index) {}
    ~Lease();
    Lease(Lease &&other) noexcept : pool_(std::move(other.pool_)), index_(other.index_) {}
    Lease &operator=(Lease &&other) noexcept {
        std::swap(pool_, other.pool_);
        std::swap(index_, other.index_);
        return *this;
    }

    explicit operator bool() const { return pool_ != nullptr; }
    std::uint32_t index() const { return index_; }
    const supervise::RegionPointer &region() const;
    std::span<std::byte> bytes() const { return region()->layout.slot(region()->mapping, index_); }

private:
    std::shared_ptr<SlotPool> pool_;
    std::uint32_t index_ = 0;
};

// The slots of one region. A restarted component has a new region and so a new pool; leases of the old
// one keep its memory alive until the last frame in it is done.
class SlotPool : public std::enable_shared_from_this<SlotPool> {
public:
    explicit SlotPool(supervise::RegionPointer region) : region_(std::move(region)), taken_(region_->layout.count) {}

    std::optional<Lease> acquire() {
        for (std::uint32_t i = 0; i < taken_.size(); ++i)
            if (!taken_[i]) {
                taken_[i] = true;
                return Lease(shared_from_this(), i);
            }
        return std::nullopt;
    }

private:
    friend class Lease;
    supervise::RegionPointer region_;
    std::vector<bool> taken_;
};

inline Lease::~Lease() {
    if (pool_)
        pool_->taken_[index_] = false;
}
inline const supervise::RegionPointer &Lease::region() const {
    return pool_->region_;
}

} // namespace arhost::host
