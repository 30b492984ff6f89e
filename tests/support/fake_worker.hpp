// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "ipc/wake.hpp"
#include "supervise/launcher.hpp"

#include <functional>
#include <sys/eventfd.h>
#include <tuple>
#include <unistd.h>

namespace arhost::test {

// Starts no process: the test sends the messages that a compromised worker could send.
struct FakeWorker final : supervise::Starter {
    std::function<void()> on_spawn = [] {};
    ipc::Channel channel; // the worker's end
    int wait_status = 0;  // as returned by wait(2)

    void die() const { ::eventfd_write(death_.get(), 1); }

    supervise::Spawned spawn(const std::filesystem::path &, supervise::Isolation,
                             const supervise::LogFunction &) override {
        supervise::Spawned spawned;
        std::tie(spawned.channel, channel) = ipc::Channel::make_pair();
        spawned.doorbell = ipc::make_doorbell().host;
        spawned.output = base::UniqueFd(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)); // never becomes readable
        spawned.pidfd = base::UniqueFd(::eventfd(0, EFD_CLOEXEC)); // not a pidfd, so sending signals to it fails
        spawned.pid = 1 << 22;                                     // greater than any pid that Linux assigns
        death_ = base::UniqueFd(::dup(spawned.pidfd.get()));
        on_spawn();
        return spawned;
    }
    supervise::Exit wait_exit(pid_t pid) override { return {pid, wait_status, 0}; }

private:
    base::UniqueFd death_;
};

} // namespace arhost::test
