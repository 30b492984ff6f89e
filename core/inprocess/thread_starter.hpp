// SPDX-License-Identifier: Apache-2.0
//
// Starts workers as threads of this process. The host handles them like processes, except that they cannot be killed.
#pragma once

#include "supervise/launcher.hpp"

#include <condition_variable>
#include <mutex>
#include <thread>
#include <vector>

namespace arhost::inprocess {

class ThreadStarter final : public supervise::Starter {
public:
    ThreadStarter() = default;
    ~ThreadStarter() override; // joins all threads
    ThreadStarter(const ThreadStarter &) = delete;
    ThreadStarter &operator=(const ThreadStarter &) = delete;

    // Ignores its parameters.
    supervise::Spawned spawn(const std::filesystem::path &program, supervise::Isolation isolation,
                             const supervise::LogFunction &log) override;
    supervise::Exit wait_exit(pid_t pid) override;

private:
    std::mutex mutex_;
    std::condition_variable ended_;
    std::deque<supervise::Exit> exits_;
    std::vector<std::thread> threads_;
};

} // namespace arhost::inprocess
