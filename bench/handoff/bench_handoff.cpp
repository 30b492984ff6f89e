// SPDX-License-Identifier: Apache-2.0
//
// Measures the one-way latency of a command from the host to a worker, and of the result on its way back. The
// receivers sleep or poll. The baselines, bare futexes and bare eventfds, are measured in the same run. Host and
// worker are two processes.
#include "ipc/memory.hpp"
#include "ipc/protocol.hpp"

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <linux/futex.h>
#include <memory>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>
#include <vector>

using namespace arhost::ipc;
using namespace std::chrono_literals;

namespace {

std::int64_t now_ns() {
    return std::chrono::steady_clock::now().time_since_epoch().count();
}

struct Latencies {
    std::vector<std::int64_t> forward, back; // in ns, one per round
    void print(const char *name) {
        const auto percentile = [](std::vector<std::int64_t> &samples, double fraction) {
            std::sort(samples.begin(), samples.end());
            return static_cast<double>(
                       samples[static_cast<std::size_t>(fraction * static_cast<double>(samples.size() - 1))]) *
                   1e-3;
        };
        std::printf("%-28s  %8.1f %8.1f %8.1f  %8.1f %8.1f %8.1f\n", name, percentile(forward, 0.5),
                    percentile(forward, 0.99), percentile(forward, 0.999), percentile(back, 0.5),
                    percentile(back, 0.99), percentile(back, 0.999));
        std::fflush(stdout);
    }
};

// Measures arhost's link: commands go through a ring and wake the worker with a futex; results return through a ring
// and wake the host with a doorbell.
Latencies link(int rounds, bool polling) {
    const SharedMemory host_memory = SharedMemory::create("host", sizeof(HostPage));
    const SharedMemory worker_memory = SharedMemory::create("worker", sizeof(WorkerPage));
    const Mapping host = host_memory.map(Access::read_write);
    const DoorbellPair bell = make_doorbell();
    const auto spin = polling ? 1s : 0s;
    const pid_t worker = ::fork();
    if (worker == 0) {
        const Mapping reader = host_memory.map(Access::read_only), mine = worker_memory.map(Access::read_write);
        CommandConsumer commands(reader.as<HostPage>().commands, mine.as<WorkerPage>().commands);
        ResultProducer results(mine.as<WorkerPage>().results, reader.as<HostPage>().results);
        for (int i = 0; i < rounds;) {
            const std::uint32_t seen = wake_count(reader.as<HostPage>().wake);
            Command command;
            if (commands.pop(command) != RingResult::done) {
                wait_for_wake(reader.as<HostPage>().wake, seen, 1s, spin);
                continue;
            }
            Result result{};
            result.frame.capture_ns = now_ns() - command.capture_ns; // forward latency
            result.busy_ns = now_ns();
            results.push(result);
            ring_doorbell(bell.worker.get());
            ++i;
        }
        ::_exit(0);
    }
    const Mapping theirs = worker_memory.map(Access::read_only);
    CommandProducer commands(host.as<HostPage>().commands, theirs.as<WorkerPage>().commands);
    ResultConsumer results(theirs.as<WorkerPage>().results, host.as<HostPage>().results);
    Latencies latencies;
    for (int i = 0; i < rounds; ++i) {
        ::usleep(200); // until the worker sleeps
        Command command{};
        command.capture_ns = now_ns();
        commands.push(command);
        wake(host.as<HostPage>().wake);
        Result result;
        while (results.pop(result) != RingResult::done)
            if (!polling) {
                pollfd ready{bell.host.get(), POLLIN, 0};
                ::poll(&ready, 1, 1000);
                drain_doorbell(bell.host.get());
            }
        latencies.back.push_back(now_ns() - result.busy_ns);
        latencies.forward.push_back(result.frame.capture_ns);
        drain_doorbell(bell.host.get());
    }
    ::waitpid(worker, nullptr, 0);
    return latencies;
}

// Measures bare futexes, the fastest way to wake a sleeping process. Each direction has its own futex; both futexes
// and the time stamps are in one shared page.
Latencies futexes(int rounds) {
    struct Page {
        std::atomic<std::uint32_t> requests, responses;
        std::int64_t requested_ns, forward_ns, responded_ns;
    };
    const SharedMemory memory = SharedMemory::create("futexes", 4096);
    const Mapping mapping = memory.map(Access::read_write);
    Page &page = mapping.as<Page>();
    const auto count_and_wake = [](std::atomic<std::uint32_t> &word) {
        word.fetch_add(1);
        ::syscall(SYS_futex, &word, FUTEX_WAKE, 1, nullptr, nullptr, 0);
    };
    const auto wait_until = [](std::atomic<std::uint32_t> &word, std::uint32_t value) {
        for (std::uint32_t seen; (seen = word.load()) != value;)
            ::syscall(SYS_futex, &word, FUTEX_WAIT, seen, nullptr, nullptr, 0);
    };
    const pid_t worker = ::fork();
    if (worker == 0) {
        for (int i = 1; i <= rounds; ++i) {
            wait_until(page.requests, static_cast<std::uint32_t>(i));
            page.forward_ns = now_ns() - page.requested_ns;
            page.responded_ns = now_ns();
            count_and_wake(page.responses);
        }
        ::_exit(0);
    }
    Latencies latencies;
    for (int i = 1; i <= rounds; ++i) {
        ::usleep(200);
        page.requested_ns = now_ns();
        count_and_wake(page.requests);
        wait_until(page.responses, static_cast<std::uint32_t>(i));
        latencies.back.push_back(now_ns() - page.responded_ns);
        latencies.forward.push_back(page.forward_ns);
    }
    ::waitpid(worker, nullptr, 0);
    return latencies;
}

// Measures bare eventfds, one per direction. Unlike a futex, an eventfd can be polled together with other
// descriptors.
Latencies eventfds(int rounds) {
    const SharedMemory memory = SharedMemory::create("times", 4096);
    const Mapping page = memory.map(Access::read_write);
    auto *stamps = reinterpret_cast<volatile std::int64_t *>(page.bytes().data());
    const arhost::base::UniqueFd forward(::eventfd(0, EFD_CLOEXEC)), back(::eventfd(0, EFD_CLOEXEC));
    const std::uint64_t one = 1;
    std::uint64_t count = 0;
    const pid_t worker = ::fork();
    if (worker == 0) {
        for (int i = 0; i < rounds; ++i) {
            if (::read(forward.get(), &count, sizeof count) < 0)
                ::_exit(1);
            stamps[1] = now_ns() - stamps[0];
            stamps[2] = now_ns();
            if (::write(back.get(), &one, sizeof one) < 0)
                ::_exit(1);
        }
        ::_exit(0);
    }
    Latencies latencies;
    for (int i = 0; i < rounds; ++i) {
        ::usleep(200);
        stamps[0] = now_ns();
        if (::write(forward.get(), &one, sizeof one) < 0 || ::read(back.get(), &count, sizeof count) < 0)
            std::abort();
        latencies.back.push_back(now_ns() - stamps[2]);
        latencies.forward.push_back(std::int64_t(stamps[1]));
    }
    ::waitpid(worker, nullptr, 0);
    return latencies;
}

} // namespace

int main(int argc, char **argv) {
    const int rounds = argc > 1 ? std::atoi(argv[1]) : 5000;
    if (rounds < 1) {
        std::fprintf(stderr, "usage: bench-handoff [ROUNDS]\n");
        return 2;
    }
    std::printf("%-28s  %26s  %26s\n", "one-way latency, us", "host to worker", "worker to host");
    std::printf("%-28s  %8s %8s %8s  %8s %8s %8s\n", "", "p50", "p99", "p99.9", "p50", "p99", "p99.9");
    futexes(rounds).print("bare futexes, sleeping");
    eventfds(rounds).print("bare eventfds, sleeping");
    link(rounds, false).print("arhost's link, sleeping");
    link(rounds, true).print("arhost's link, polling");
    return 0;
}
