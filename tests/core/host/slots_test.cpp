// SPDX-License-Identifier: Apache-2.0
#include "host/slots.hpp"

#include <gtest/gtest.h>

namespace arhost::host {
namespace {

TEST(SlotPool, AssignsEachSlotOnceUntilItIsReleased) {
    const auto pool = std::make_shared<SlotPool>(std::size_t{2});
    std::optional<Lease> first = pool->acquire();
    const std::optional<Lease> second = pool->acquire();
    ASSERT_TRUE(first && second);
    EXPECT_NE(first->index(), second->index());
    EXPECT_FALSE(pool->has_free());
    EXPECT_FALSE(pool->acquire());
    const std::uint32_t released = first->index();
    first.reset();
    EXPECT_EQ(pool->acquire()->index(), released);
}

TEST(SlotPool, ASharedSlotIsFreeWhenTheLastLeaseEnds) {
    const auto pool = std::make_shared<SlotPool>(std::size_t{1});
    Lease image = *pool->acquire(), state = image.share();
    EXPECT_EQ(state.index(), image.index());
    image = Lease();
    EXPECT_FALSE(pool->has_free());
    state = Lease();
    EXPECT_TRUE(pool->has_free());
}

TEST(SlotPool, AMovedLeaseIsReleasedOnce) {
    const auto pool = std::make_shared<SlotPool>(std::size_t{1});
    Lease first = *pool->acquire();
    Lease second = std::move(first);
    EXPECT_FALSE(first);
    const Lease shared = second.share();
    second = Lease();
    EXPECT_FALSE(pool->has_free());
}

} // namespace
} // namespace arhost::host
