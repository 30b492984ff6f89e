// SPDX-License-Identifier: Apache-2.0
//
// A lock-free single-producer single-consumer ring of small entries between two processes that do not trust each
// other. Each side writes only its own memory, so the peer can map this memory read-only: the producer writes the
// entries and `published`, the consumer writes `consumed`.
//
// Positions only increase; an entry's index is position mod capacity. Each side keeps its position in private memory
// and publishes a copy, so a faulty peer can misreport only its own progress. The reader detects this if the distance
// between the two positions is not in the range from 0 to capacity.
#pragma once

#include <atomic>
#include <cstdint>
#include <type_traits>

namespace arhost::ipc {

template <class Entry, std::uint32_t capacity> struct ProducerSide {
    static_assert((capacity & (capacity - 1)) == 0, "must be a power of two, so that positions may wrap around");
    static_assert(std::is_trivially_copyable_v<Entry>);
    static_assert(std::atomic<std::uint64_t>::is_always_lock_free);
    alignas(64) std::atomic<std::uint64_t> published; // number of entries written so far
    alignas(64) Entry entries[capacity];
};

struct ConsumerSide {
    alignas(64) std::atomic<std::uint64_t> consumed; // number of entries read so far
};

enum class RingResult {
    done,
    wait,     // the ring is full (push) or empty (pop)
    violation // the peer's position is impossible
};

template <class Entry, std::uint32_t capacity> class Producer {
public:
    Producer(ProducerSide<Entry, capacity> &mine, const ConsumerSide &theirs) : mine_(&mine), theirs_(&theirs) {}

    RingResult push(const Entry &entry) {
        // SYNC POINT with Consumer::pop (its release store of `consumed`): the consumer has copied an entry before
        // the producer overwrites it.
        const std::uint64_t used = position_ - theirs_->consumed.load(std::memory_order_acquire);
        if (used > capacity)
            return RingResult::violation;
        if (used == capacity)
            return RingResult::wait;
        mine_->entries[position_ % capacity] = entry;
        ++position_;
        // SYNC POINT with Consumer::pop (its acquire load of `published`): the entry, and the pixels that were
        // written to its slot before this call, become visible no later than the position.
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

    // Copies the next entry, so later writes of the peer to it have no effect.
    RingResult pop(Entry &entry) {
        // SYNC POINT with Producer::push (its release store of `published`): if the position is visible, the entry
        // and the pixels of its slot are visible, too.
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
