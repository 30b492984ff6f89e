// SPDX-License-Identifier: Apache-2.0
//
// Ownership of a region's slots. Only the host assigns slots; destroying the leases releases the slots of a dead
// worker.
#pragma once

#include "supervise/component.hpp"

#include <memory>
#include <optional>
#include <vector>

namespace arhost::host {

class SlotPool;

// Represents exclusive use of one slot. Releases the slot on destruction.
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

// The slots of one shared-memory region. A restarted component gets a new region and a new pool; the leases of the
// old pool keep the old region mapped until its last frame is done.
class SlotPool : public std::enable_shared_from_this<SlotPool> {
public:
    explicit SlotPool(supervise::RegionPointer region) : region_(std::move(region)), in_use_(region_->layout.count) {}

    std::optional<Lease> acquire() {
        for (std::uint32_t i = 0; i < in_use_.size(); ++i)
            if (!in_use_[i]) {
                in_use_[i] = true;
                return Lease(shared_from_this(), i);
            }
        return std::nullopt;
    }

private:
    friend class Lease;
    supervise::RegionPointer region_;
    std::vector<bool> in_use_;
};

inline Lease::~Lease() {
    if (pool_)
        pool_->in_use_[index_] = false;
}
inline const supervise::RegionPointer &Lease::region() const {
    return pool_->region_;
}

} // namespace arhost::host
