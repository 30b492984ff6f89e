// SPDX-License-Identifier: Apache-2.0
#include "ipc/memory.hpp"
#include "ipc/wake.hpp"
#include "processes.hpp"

#include <gtest/gtest.h>

#include <fcntl.h>
#include <sys/wait.h>

using namespace arhost::ipc;
using namespace std::chrono_literals;

TEST(Wake, ReachesAnotherProcessThroughAReadOnlyMapping) {
    const SharedMemory memory = SharedMemory::create("test", 4096);
    const Mapping writer = memory.map(Access::read_write);
    memory.seal_future_writes();
    const pid_t child = ::fork();
    if (child == 0) {
        const Mapping reader = memory.map(Access::read_only);
        ::_exit(wait_for_wake(reader.as<WakeWord>(), 0, 20s) ? 0 : 1);
    }
    arhost::test::wait_asleep(child);
    wake(writer.as<WakeWord>());
    int status = -1;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    EXPECT_EQ(status, 0);
}

TEST(Wake, IsNotLostIfItPrecedesTheWait) {
    WakeWord word{};
    const std::uint32_t seen = wake_count(word);
    wake(word);
    EXPECT_TRUE(wait_for_wake(word, seen, 20s));
    EXPECT_FALSE(wait_for_wake(word, wake_count(word), 1ms));
}

TEST(Doorbell, CountsRings) {
    const DoorbellPair bell = make_doorbell();
    EXPECT_EQ(drain_doorbell(bell.host.get()), 0);
    for (int i = 0; i < 3; ++i)
        ring_doorbell(bell.worker.get());
    EXPECT_EQ(drain_doorbell(bell.host.get()), 3);
    EXPECT_EQ(drain_doorbell(bell.host.get()), 0);
}

TEST(Doorbell, DoesNotBlockTheHostIfTheWorkerClearsONonblock) {
    const DoorbellPair bell = make_doorbell();
    ::fcntl(bell.worker.get(), F_SETFL, 0); // would clear O_NONBLOCK of both ends if they shared it
    EXPECT_EQ(drain_doorbell(bell.host.get()), 0);
}

TEST(Doorbell, HandlesAFloodOfRings) {
    const DoorbellPair bell = make_doorbell();
    for (int i = 0; i < 1'000'000; ++i)
        ring_doorbell(bell.worker.get()); // does not block the worker either
    EXPECT_LE(drain_doorbell(bell.host.get()), 4096);
}

TEST(Doorbell, ReportsAClosedOtherEnd) {
    DoorbellPair bell = make_doorbell();
    bell.worker.reset();
    EXPECT_EQ(drain_doorbell(bell.host.get()), -1);
}
