// SPDX-License-Identifier: Apache-2.0
//
// A lock-free single-producer single-consumer ring of small entries between two processes that do not trust each
// other. Each side writes only its own memory (the producer the entries and `published`, the consumer `consumed`),
// so the peer can map it read-only.
//
// Positions only increase; an entry's index is position mod capacity. Each side keeps its position in private memory
// and publishes a copy, so a corrupt peer can misreport only its own progress. A distance between the two positions
// outside 0 to capacity reveals that.
#pragma once

#include <atomic>
#include <cstdint>
#include <type_traits>

namespace arhost::ipc {

template <class Entry, std::uint32_t capacity> struct ProducerSide {
    static_assert((capacity & (capacity - 1)) == 0, "must be a power of two, so that positions may wrap around");
    static_assert(std::is_trivially_copyable_v<Entry>);
    static_assert(std::atomic<std::uint64_t>::is_always_lock_free);
    alignas(64) std::atomic<std::uint64_t> published; // count of entries written
    alignas(64) Entry entries[capacity];
};

struct ConsumerSide {
    alignas(64) std::atomic<std::uint64_t> consumed; // count of entries read
};

enum class RingResult {
    done,
    wait,     // full (push) or empty (pop)
    violation // the peer's position is impossible
};

template <class Entry, std::uint32_t capacity> class Producer {
public:
    Producer(ProducerSide<Entry, capacity> &mine, const ConsumerSide &theirs) : mine_(&mine), theirs_(&theirs) {}

    RingResult push(const Entry &entry) {
        // SYNC POINT with Consumer::pop (its release store of `consumed`): the consumer has copied the entry before
        // it is overwritten.
        const std::uint64_t used = position_ - theirs_->consumed.load(std::memory_order_acquire);
        if (used > capacity)
            return RingResult::violation;
        if (used == capacity)
            return RingResult::wait;
        mine_->entries[position_ % capacity] = entry;
        ++position_;
        // SYNC POINT with Consumer::pop (its acquire load of `published`): the entry, and the slot's pixels written
        // before the call, become visible before the position that makes them reachable.
        mine_->published.store(position_, std::memory_order_release);
        return RingResult::done;
    }

private:
    ProducerSide<Entry, capacity> *mine_;
    const ConsumerSide *theirs_;
    std::uint64_t position_ = 0;
};

template <class Entry, std::uint32_t capacity> class Consumer {
public:
    Consumer(const ProducerSide<Entry, capacity> &theirs, ConsumerSide &mine) : theirs_(&theirs), mine_(&mine) {}

    // Copies the entry, so later writes of the peer do not matter.
    RingResult pop(Entry &entry) {
        // SYNC POINT with Producer::push (its release store of `published`): with the position, the entry and the
        // pixels of its slot are visible.
        const std::uint64_t waiting = theirs_->published.load(std::memory_order_acquire) - position_;
        if (waiting > capacity)
            return RingResult::violation;
        if (waiting == 0)
            return RingResult::wait;
        entry = theirs_->entries[position_ % capacity];
        ++position_;
        // SYNC POINT with Producer::push (its acquire load of `consumed`): the copy is complete before the entry may
        // be overwritten.
        mine_->consumed.store(position_, std::memory_order_release);
        return RingResult::done;
    }

private:
    const ProducerSide<Entry, capacity> *theirs_;
    ConsumerSide *mine_;
    std::uint64_t position_ = 0;
};

} // namespace arhost::ipc
