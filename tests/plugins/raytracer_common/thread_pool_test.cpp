// SPDX-License-Identifier: Apache-2.0
#include "raytracer_common/thread_pool.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <limits>
#include <vector>

namespace arhost::raytracer_common {
namespace {

TEST(ThreadPool, ProcessesEachItemOncePerCall) {
    for (unsigned threads : {1u, 2u, 5u}) {
        ThreadPool pool(threads);
        EXPECT_EQ(pool.thread_count(), threads);
        std::vector<int> done(997, 0); // one thread writes each element; all are read after the round
        for (int round = 1; round <= 200; ++round) {
            pool.for_each(done.size(), [&](std::size_t i, std::size_t) { ++done[i]; });
            for (int count : done)
                ASSERT_EQ(count, round);
        }
    }
}

TEST(ThreadPool, ZeroMeansOneThreadPerProcessor) {
    EXPECT_EQ(ThreadPool(0).thread_count(), std::max(1u, std::thread::hardware_concurrency()));
}

TEST(ThreadPool, ReturnsImmediatelyWithoutItems) {
    ThreadPool(3).for_each(0, [](std::size_t, std::size_t) { FAIL(); });
}

TEST(ThreadPool, FlushesDenormalsOnlyWhileProcessing) {
    volatile float tiny = std::numeric_limits<float>::min();
    std::atomic<int> flushed{0};
    ThreadPool(2).for_each(50, [&](std::size_t, std::size_t) { flushed += tiny * 0.5f == 0; });
#if defined(__SSE2__)
    EXPECT_EQ(flushed, 50);
#endif
    EXPECT_GT(tiny * 0.5f, 0);
}

} // namespace
} // namespace arhost::raytracer_common
