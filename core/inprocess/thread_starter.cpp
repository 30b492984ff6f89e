// SPDX-License-Identifier: Apache-2.0
#include "inprocess/thread_starter.hpp"

#include "ipc/wake.hpp"
#include "worker/session.hpp"

#include <algorithm>
#include <fcntl.h>
#include <sys/eventfd.h>
#include <time.h>
#include <unistd.h>

namespace arhost::inprocess {
namespace {

constexpr pid_t first_pid = 1 << 22; // above the maximum pid of Linux, so that kill(2) cannot affect a process

double cpu_seconds_of_thread() {
    timespec time{};
    ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

} // namespace

ThreadStarter::~ThreadStarter() {
    for (std::thread &thread : threads_)
        thread.join();
}

supervise::Spawned ThreadStarter::spawn(const std::filesystem::path &, supervise::Isolation,
                                        const supervise::LogFunction &) {
    supervise::Spawned spawned;
    ipc::Channel theirs;
    std::tie(spawned.channel, theirs) = ipc::Channel::make_pair();
    ipc::DoorbellPair doorbell = ipc::make_doorbell();
    spawned.doorbell = std::move(doorbell.host);
    // The worker uses stdout and stderr of this process, so the write end of its output pipe is closed at once.
    int pipe_ends[2];
    if (::pipe2(pipe_ends, O_CLOEXEC | O_NONBLOCK) != 0)
        base::throw_errno("pipe for a worker's output");
    spawned.output.reset(pipe_ends[0]);
    ::close(pipe_ends[1]);
    // This eventfd replaces a pidfd: it is readable when the worker has ended, but cannot be used to send signals.
    spawned.pidfd = base::checked(::eventfd(0, EFD_CLOEXEC), "eventfd");
    base::UniqueFd death(base::checked(::dup(spawned.pidfd.get()), "dup"));

    const std::lock_guard lock(mutex_);
    const pid_t pid = spawned.pid = first_pid + static_cast<pid_t>(threads_.size());
    threads_.emplace_back([this, pid, death = std::move(death),
                           link = worker::Link(std::move(theirs), std::move(doorbell.worker))]() mutable {
        const int status = worker::run(link);
        const std::lock_guard ending(mutex_);
        exits_.push_back({pid, status << 8, cpu_seconds_of_thread()}); // as returned by wait(2)
        ended_.notify_all();
        ::eventfd_write(death.get(), 1);
    });
    return spawned;
}

supervise::Exit ThreadStarter::wait_exit(pid_t pid) {
    std::unique_lock lock(mutex_);
    for (;;) {
        const auto found =
            std::find_if(exits_.begin(), exits_.end(), [&](const auto &exit) { return exit.pid == pid; });
        if (found != exits_.end()) {
            const supervise::Exit exit = *found;
            exits_.erase(found);
            return exit;
        }
        ended_.wait(lock);
    }
}

} // namespace arhost::inprocess
