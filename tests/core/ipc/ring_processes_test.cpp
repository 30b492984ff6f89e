// SPDX-License-Identifier: Apache-2.0
//
// Two processes on one link, the worker stopped and killed at random points: whatever it leaves behind,
// the host goes on with a new one, and no frame is lost, torn or out of order.
#include "ipc/memory.hpp"
#include "ipc/protocol.hpp"

#include <gtest/gtest.h>

#include <csignal>
#include <deque>
#include <poll.h>
#include <random>
#include <sys/wait.h>

using namespace arhost::ipc;
using namespace std::chrono_literals;

namespace {

constexpr std::size_t words = 4096;
constexpr SlotLayout layout{words * sizeof(std::uint64_t), 4};

// The worker: writes the sequence number all over the slot that it is told.
[[noreturn]] void serve(const SharedMemory &host_memory, const SharedMemory &worker_memory,
                        const SharedMemory &pixels, int doorbell) {
    const Mapping host = host_memory.map(Access::read_only), mine = worker_memory.map(Access::read_write),
                  slots = pixels.map(Access::read_write);
    CommandConsumer commands(host.as<HostPage>().commands, mine.as<WorkerPage>().commands);
    ResultProducer results(mine.as<WorkerPage>().results, host.as<HostPage>().results);
    for (;;) {
        const std::uint32_t seen = wake_count(host.as<HostPage>().wake);
        Command command;
        if (commands.pop(command) != RingResult::done) {
            wait_for_wake(host.as<HostPage>().wake, seen, 1s);
            continue;
        }
        auto *slot = reinterpret_cast<volatile std::uint64_t *>(layout.slot(slots, command.slot).data());
        for (std::size_t i = 0; i < words; ++i)
            slot[i] = command.sequence;
        Result result{};
        result.ticket = command.sequence;
        results.push(result);
        ring_doorbell(doorbell);
    }
}

struct Life {
    SharedMemory host_memory = SharedMemory::create("host", sizeof(HostPage));
    SharedMemory worker_memory = SharedMemory::create("worker", sizeof(WorkerPage));
    SharedMemory pixels = SharedMemory::create("pixels", layout.byte_size());
    Mapping host = host_memory.map(Access::read_write), worker = worker_memory.map(Access::read_only),
            slots = pixels.map(Access::read_only);
    DoorbellPair bell = make_doorbell();
    CommandProducer commands{host.as<HostPage>().commands, worker.as<WorkerPage>().commands};
    ResultConsumer results{worker.as<WorkerPage>().results, host.as<HostPage>().results};
    std::deque<std::uint64_t> in_flight;
    pid_t pid = 0;

    Life() {
        host_memory.seal_future_writes();
        pid = ::fork();
        if (pid == 0)
            serve(host_memory, worker_memory, pixels, bell.worker.get());
    }
    ~Life() {
        ::kill(pid, SIGKILL);
        ::waitpid(pid, nullptr, 0);
    }
};

} // namespace

TEST(RingProcesses, LoseNothingWhenTheWorkerIsKilledAndStoppedAtRandom) {
    constexpr std::uint64_t frames = 6'000;
    std::minstd_rand random(20261121);
    auto life = std::make_unique<Life>();
    std::uint64_t next_to_submit = 0, next_expected = 0;
    int lives = 1, stops = 0;
    std::uint64_t next_fault = 5;
    while (next_expected < frames) {
        while (next_to_submit < frames && life->in_flight.size() < layout.count) {
            Command command{};
            command.kind = CommandKind::read;
            command.slot = static_cast<std::uint32_t>(next_to_submit % layout.count);
            command.sequence = next_to_submit;
            ASSERT_EQ(life->commands.push(command), RingResult::done);
            wake(life->host.as<HostPage>().wake);
            life->in_flight.push_back(next_to_submit++);
        }
        if (next_expected >= next_fault) {
            next_fault = next_expected + 1 + random() % 60;
            ::usleep(static_cast<useconds_t>(random() % 200)); // somewhere in its work
            if (random() % 2) {
                ::kill(life->pid, SIGSTOP);
                ::usleep(static_cast<useconds_t>(random() % 500));
                ::kill(life->pid, SIGCONT);
                ++stops;
            } else {
                ::kill(life->pid, SIGKILL);
            }
        }
        pollfd ready{life->bell.host.get(), POLLIN, 0};
        ::poll(&ready, 1, 20);
        drain_doorbell(life->bell.host.get());
        Result result;
        RingResult popped;
        while ((popped = life->results.pop(result)) == RingResult::done) {
            ASSERT_EQ(result.ticket, next_expected) << "lost, twice or out of order";
            const auto *slot = reinterpret_cast<const volatile std::uint64_t *>(
                layout.slot(life->slots, static_cast<std::uint32_t>(next_expected % layout.count)).data());
            for (std::size_t i = 0; i < words; ++i)
                ASSERT_EQ(slot[i], next_expected) << "torn";
            life->in_flight.pop_front();
            ++next_expected;
        }
        ASSERT_EQ(popped, RingResult::wait);
        if (::waitpid(life->pid, nullptr, WNOHANG) == life->pid) {
            // It may have finished frames between the last pop and its death.
            while (life->results.pop(result) == RingResult::done) {
                ASSERT_EQ(result.ticket, next_expected++);
                life->in_flight.pop_front();
            }
            if (!life->in_flight.empty())
                next_to_submit = life->in_flight.front();
            life = std::make_unique<Life>();
            ++lives;
        }
    }
    EXPECT_GT(lives, 20);
    EXPECT_GT(stops, 20);
}
