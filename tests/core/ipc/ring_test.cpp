// SPDX-License-Identifier: Apache-2.0
#include "ipc/ring.hpp"

#include <gtest/gtest.h>

#include <memory>

using namespace arhost::ipc;

namespace {

struct Fixture {
    std::unique_ptr<ProducerSide<int, 4>> entries = std::make_unique<ProducerSide<int, 4>>();
    std::unique_ptr<ConsumerSide> taken = std::make_unique<ConsumerSide>();
    Producer<int, 4> producer{*entries, *taken};
    Consumer<int, 4> consumer{*entries, *taken};
};

} // namespace

TEST(Ring, GivesEntriesInTheirOrder) {
    Fixture ring;
    int value = 0;
    EXPECT_EQ(ring.consumer.pop(value), RingResult::wait);
    for (int round = 0; round < 10; ++round) {
        for (int i = 0; i < 3; ++i)
            EXPECT_EQ(ring.producer.push(10 * round + i), RingResult::done);
        for (int i = 0; i < 3; ++i) {
            EXPECT_EQ(ring.consumer.pop(value), RingResult::done);
            EXPECT_EQ(value, 10 * round + i);
        }
    }
}

TEST(Ring, HoldsItsCapacityAndNoMore) {
    Fixture ring;
    for (int i = 0; i < 4; ++i)
        EXPECT_EQ(ring.producer.push(i), RingResult::done);
    EXPECT_EQ(ring.producer.push(4), RingResult::wait);
    int value = 0;
    EXPECT_EQ(ring.consumer.pop(value), RingResult::done);
    EXPECT_EQ(ring.producer.push(4), RingResult::done);
}

TEST(Ring, NoticesAConsumerThatClaimsMoreThanWasPublished) {
    Fixture ring;
    ring.taken->consumed = 1;
    EXPECT_EQ(ring.producer.push(1), RingResult::breach);
}

TEST(Ring, NoticesAConsumerThatGoesBack) {
    Fixture ring;
    int value = 0;
    for (int i = 0; i < 6; ++i) {
        EXPECT_EQ(ring.producer.push(i), RingResult::done);
        EXPECT_EQ(ring.consumer.pop(value), RingResult::done);
    }
    ring.taken->consumed = 0;
    EXPECT_EQ(ring.producer.push(1), RingResult::breach);
}

TEST(Ring, NoticesAProducerThatClaimsMoreThanFits) {
    Fixture ring;
    int value = 0;
    ring.entries->published = 5;
    EXPECT_EQ(ring.consumer.pop(value), RingResult::breach);
    ring.entries->published = ~std::uint64_t(0); // behind the consumer
    EXPECT_EQ(ring.consumer.pop(value), RingResult::breach);
}
