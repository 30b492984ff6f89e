// SPDX-License-Identifier: Apache-2.0
//
// Two threads exchange slots through rings, for the thread sanitizer: popping an entry makes the data in its slot
// visible, and the producer overwrites a slot only after the consumer has returned it.
#include "ipc/ring.hpp"
#include "ipc/wake.hpp"

#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <thread>

using namespace arhost::ipc;
using namespace std::chrono_literals;

namespace {

constexpr std::uint32_t capacity = 4;
constexpr std::uint64_t frames = 20'000;

struct Entry {
    std::uint64_t sequence;
    std::uint32_t slot;
};

struct Shared {
    ProducerSide<Entry, capacity> full;
    ConsumerSide full_consumed;
    ProducerSide<std::uint32_t, capacity> free;
    ConsumerSide free_consumed;
    WakeWord to_consumer, to_producer;
    std::array<std::array<std::uint64_t, 64>, capacity> slots; // plain memory, so that the sanitizer detects races
};

} // namespace

TEST(RingThreads, HandOverSlotsWithoutARace) {
    const auto shared = std::make_unique<Shared>();
    std::thread producer([&] {
        Producer<Entry, capacity> full(shared->full, shared->full_consumed);
        Consumer<std::uint32_t, capacity> free(shared->free, shared->free_consumed);
        for (std::uint64_t sequence = 0; sequence < frames; ++sequence) {
            std::uint32_t slot = static_cast<std::uint32_t>(sequence);
            for (std::uint32_t seen = 0; sequence >= capacity;) {
                seen = wake_count(shared->to_producer);
                if (free.pop(slot) == RingResult::done)
                    break;
                wait_for_wake(shared->to_producer, seen, 1s);
            }
            shared->slots[slot].fill(sequence);
            while (full.push({sequence, slot}) != RingResult::done) {
            }
            wake(shared->to_consumer);
        }
    });
    Consumer<Entry, capacity> full(shared->full, shared->full_consumed);
    Producer<std::uint32_t, capacity> free(shared->free, shared->free_consumed);
    for (std::uint64_t expected = 0; expected < frames; ++expected) {
        Entry entry{};
        for (;;) {
            const std::uint32_t seen = wake_count(shared->to_consumer);
            if (full.pop(entry) == RingResult::done)
                break;
            wait_for_wake(shared->to_consumer, seen, 1s);
        }
        ASSERT_EQ(entry.sequence, expected);
        for (const std::uint64_t value : shared->slots[entry.slot])
            ASSERT_EQ(value, expected) << "a torn slot";
        ASSERT_EQ(free.push(entry.slot), RingResult::done);
        wake(shared->to_producer);
    }
    producer.join();
}
