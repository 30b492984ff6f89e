// SPDX-License-Identifier: Apache-2.0
//
// Manages the slots of a shared-memory region. Only the host assigns slots. A slot is free again when its leases are
// destroyed, even if the worker has died.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

namespace arhost::supervise {
struct Region;
}

namespace arhost::host {

class SlotPool;

// Represents use of one slot. The slot is released when all its leases are destroyed.
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

    Lease share() const; // another lease of the same slot
    explicit operator bool() const { return pool_ != nullptr; }
    std::uint32_t index() const { return index_; }
    const std::shared_ptr<const supervise::Region> &region() const;
    std::span<std::byte> bytes() const;

private:
    std::shared_ptr<SlotPool> pool_;
    std::uint32_t index_ = 0;
};

// The slots of one shared-memory region. A restarted component gets a new region and a new pool. The old region stays
// mapped until the last frame that holds a lease of the old pool is done.
class SlotPool : public std::enable_shared_from_this<SlotPool> {
public:
    explicit SlotPool(std::shared_ptr<const supervise::Region> region);
    explicit SlotPool(std::size_t count) : leases_(count) {} // slots without memory

    bool has_free() const;
    std::optional<Lease> acquire();

private:
    friend class Lease;
    std::shared_ptr<const supervise::Region> region_;
    std::vector<std::uint32_t> leases_; // number of leases of each slot
};

} // namespace arhost::host
