// SPDX-License-Identifier: Apache-2.0
//
// A single-producer single-consumer lock-free ring of small entries between two processes that do not
// trust each other. Each side writes only memory of its own: the producer the entries and `published`,
// the consumer `consumed`; so either can be mapped read-only by the other.
//
// Positions count up for ever; an entry's place is position mod capacity. Each side keeps its own
// position in private memory and publishes a copy, so a peer that scribbles over its page can lie about
// its own progress only, and a lie is noticed: the distance between the two positions is 0 to capacity.
#pragma once

#include <atomic>
#include <cstdint>
#include <type_traits>

namespace arhost::ipc {

template <class Entry, std::uint32_t capacity> struct ProducerSide {
    static_assert((capacity & (capacity - 1)) == 0, "a power of two, so that positions may wrap around");
    static_assert(std::is_trivially_copyable_v<Entry>);
    static_assert(std::atomic<std::uint64_t>::is_always_lock_free);
    alignas(64) std::atomic<std::uint64_t> published; // entries ever written
    alignas(64) Entry entries[capacity];
};

struct ConsumerSide {
    alignas(64) std::atomic<std::uint64_t> consumed; // entries ever taken
};

enum class RingResult {
    done,
    wait,  // full (push) or empty (pop)
    breach // the peer's position is impossible: it broke the contract
};

template <class Entry, std::uint32_t capacity> class Producer {
public:
    Producer(ProducerSide<Entry, capacity> &mine, const ConsumerSide &theirs) : mine_(&mine), theirs_(&theirs) {}

    RingResult push(const Entry &entry) {
        // SYNC POINT with Consumer::pop (its release store of `consumed`): the consumer has copied the
        // entry out before its place is written again.
        const std::uint64_t used = position_ - theirs_->consumed.load(std::memory_order_acquire);
        if (used > capacity)
            return RingResult::breach;
        if (used == capacity)
            return RingResult::wait;
        mine_->entries[position_ % capacity] = entry;
        ++position_;
        // SYNC POINT with Consumer::pop (its acquire load of `published`): publishes the entry, and the
        // slot's pixels written before push was called, before the position that makes them reachable.
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

    // `entry` is a copy: what the peer does to its page afterwards does not matter.
    RingResult pop(Entry &entry) {
        // SYNC POINT with Producer::push (its release store of `published`): the entry, and the pixels of
        // the slot that it names, are visible once the position is.
        const std::uint64_t waiting = theirs_->published.load(std::memory_order_acquire) - position_;
        if (waiting > capacity)
            return RingResult::breach;
        if (waiting == 0)
            return RingResult::wait;
        entry = theirs_->entries[position_ % capacity];
        ++position_;
        // SYNC POINT with Producer::push (its acquire load of `consumed`): the copy is complete before
        // the place is given back.
        mine_->consumed.store(position_, std::memory_order_release);
        return RingResult::done;
    }

private:
    const ProducerSide<Entry, capacity> *theirs_;
    ConsumerSide *mine_;
    std::uint64_t position_ = 0;
};

} // namespace arhost::ipc
