// SPDX-License-Identifier: Apache-2.0
#include "ipc/ring.hpp"

#include <gtest/gtest.h>

#include <memory>

using namespace arhost::ipc;

namespace {

struct Fixture {
    std::unique_ptr<ProducerSide<int, 4>> producer_side = std::make_unique<ProducerSide<int, 4>>();
    std::unique_ptr<ConsumerSide> consumer_side = std::make_unique<ConsumerSide>();
    Producer<int, 4> producer{*producer_side, *consumer_side};
    Consumer<int, 4> consumer{*producer_side, *consumer_side};
};

} // namespace

TEST(Ring, ReturnsEntriesInOrder) {
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

TEST(Ring, HoldsExactlyItsCapacity) {
    Fixture ring;
    for (int i = 0; i < 4; ++i)
        EXPECT_EQ(ring.producer.push(i), RingResult::done);
    EXPECT_EQ(ring.producer.push(4), RingResult::wait);
    int value = 0;
    EXPECT_EQ(ring.consumer.pop(value), RingResult::done);
    EXPECT_EQ(ring.producer.push(4), RingResult::done);
}

TEST(Ring, DetectsAConsumerAheadOfTheProducer) {
    Fixture ring;
    ring.consumer_side->consumed = 1;
    EXPECT_EQ(ring.producer.push(1), RingResult::violation);
}

TEST(Ring, DetectsAConsumerThatMovesBackwards) {
    Fixture ring;
    int value = 0;
    for (int i = 0; i < 6; ++i) {
        EXPECT_EQ(ring.producer.push(i), RingResult::done);
        EXPECT_EQ(ring.consumer.pop(value), RingResult::done);
    }
    ring.consumer_side->consumed = 0;
    EXPECT_EQ(ring.producer.push(1), RingResult::violation);
}

TEST(Ring, DetectsAProducerThatPublishesMoreThanTheCapacity) {
    Fixture ring;
    int value = 0;
    ring.producer_side->published = 5;
    EXPECT_EQ(ring.consumer.pop(value), RingResult::violation);
    ring.producer_side->published = ~std::uint64_t(0); // is behind the consumer's position
    EXPECT_EQ(ring.consumer.pop(value), RingResult::violation);
}
