// SPDX-License-Identifier: Apache-2.0
//
// Two processes, host and worker, communicate over rings. The test stops and kills the worker at random times. The
// host must continue with a new worker, and no frame may be lost, torn or out of order.
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

// Runs in the worker process. Fills the slot of each command with the sequence number of the command.
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

struct Connection {
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

    Connection() {
        host_memory.seal_future_writes();
        pid = ::fork();
        if (pid == 0)
            serve(host_memory, worker_memory, pixels, bell.worker.get());
    }
    ~Connection() {
        ::kill(pid, SIGKILL);
        ::waitpid(pid, nullptr, 0);
    }
};

} // namespace

TEST(RingProcesses, LoseNoFrameIfTheWorkerIsKilledOrStoppedAtRandom) {
    constexpr std::uint64_t frames = 6'000;
    std::minstd_rand random(20261121);
    auto connection = std::make_unique<Connection>();
    std::uint64_t next_to_submit = 0, next_expected = 0;
    int connections = 1, stops = 0;
    std::uint64_t next_fault = 5;
    while (next_expected < frames) {
        while (next_to_submit < frames && connection->in_flight.size() < layout.count) {
            Command command{};
            command.kind = CommandKind::read;
            command.slot = static_cast<std::uint32_t>(next_to_submit % layout.count);
            command.sequence = next_to_submit;
            ASSERT_EQ(connection->commands.push(command), RingResult::done);
            wake(connection->host.as<HostPage>().wake);
            connection->in_flight.push_back(next_to_submit++);
        }
        if (next_expected >= next_fault) {
            next_fault = next_expected + 1 + random() % 60;
            ::usleep(static_cast<useconds_t>(random() % 200)); // so that the kill hits different steps
            if (random() % 2) {
                ::kill(connection->pid, SIGSTOP);
                ::usleep(static_cast<useconds_t>(random() % 500));
                ::kill(connection->pid, SIGCONT);
                ++stops;
            } else {
                ::kill(connection->pid, SIGKILL);
            }
        }
        pollfd ready{connection->bell.host.get(), POLLIN, 0};
        ::poll(&ready, 1, 20);
        drain_doorbell(connection->bell.host.get());
        Result result;
        RingResult popped;
        while ((popped = connection->results.pop(result)) == RingResult::done) {
            ASSERT_EQ(result.ticket, next_expected) << "lost, duplicated or out of order";
            const auto *slot = reinterpret_cast<const volatile std::uint64_t *>(
                layout.slot(connection->slots, static_cast<std::uint32_t>(next_expected % layout.count)).data());
            for (std::size_t i = 0; i < words; ++i)
                ASSERT_EQ(slot[i], next_expected) << "torn";
            connection->in_flight.pop_front();
            ++next_expected;
        }
        ASSERT_EQ(popped, RingResult::wait);
        if (::waitpid(connection->pid, nullptr, WNOHANG) == connection->pid) {
            // Receives results that the worker published between the last pop and its death.
            while (connection->results.pop(result) == RingResult::done) {
                ASSERT_EQ(result.ticket, next_expected++);
                connection->in_flight.pop_front();
            }
            if (!connection->in_flight.empty())
                next_to_submit = connection->in_flight.front();
            connection = std::make_unique<Connection>();
            ++connections;
        }
    }
    EXPECT_GT(connections, 20);
    EXPECT_GT(stops, 20);
}
