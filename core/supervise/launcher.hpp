// SPDX-License-Identifier: Apache-2.0
//
// The launcher: arhost-launcher, a small single-threaded process, is the parent of all workers. It starts them on
// request and reports how they exited. Workers die with it (PR_SET_PDEATHSIG follows the thread that forked), and it
// exits with the host, so a killed host leaves no process behind. The host replaces a launcher that was killed or
// does not respond, any number of times.
#pragma once

#include "base/unique_fd.hpp"
#include "ipc/channel.hpp"
#include "supervise/exit.hpp"

#include <arhost/plugin.h>

#include <chrono>
#include <deque>
#include <filesystem>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace arhost::supervise {

using LogFunction =
    std::function<void(arhost_severity severity, const std::string &component, const std::string &text)>;

// A newly started worker process.
struct Spawned {
    pid_t pid = 0;
    base::UniqueFd pidfd;    // readable once it has exited
    ipc::Channel channel;    // its descriptor 3
    base::UniqueFd doorbell; // its descriptor 4
    base::UniqueFd output;   // its stdout and stderr
};

struct Reply;

// Starts workers: the launcher, or a replacement (core/inprocess, tests).
class Starter {
public:
    virtual ~Starter() = default;

    // Throws std::runtime_error if no process can be started.
    virtual Spawned spawn(const std::filesystem::path &program, const LogFunction &log) = 0;

    // Waits for the exit status of a process that has exited already (its pidfd is readable).
    virtual Exit wait_exit(pid_t pid) = 0;
};

// Create one per process, on the thread that lives longest: that thread becomes the parent of the launcher and of the
// orphans of a killed launcher, which it kills.
class Launcher final : public Starter {
public:
    // `program` is arhost-launcher; the first spawn starts it. Throws std::runtime_error if it cannot be executed.
    // `timeout` limits each response and the final exit.
    explicit Launcher(std::filesystem::path program, std::chrono::milliseconds timeout = std::chrono::seconds(4));
    ~Launcher() override;
    Launcher(const Launcher &) = delete;
    Launcher &operator=(const Launcher &) = delete;

    Spawned spawn(const std::filesystem::path &program, const LogFunction &log) override;
    Exit wait_exit(pid_t pid) override;

private:
    std::string start_error(int error) const;
    void start();
    std::optional<Reply> receive_reply(std::vector<base::UniqueFd> &fds); // nullopt: no launcher or no response
    void discard();                                                       // the launcher and all its workers
    void record(const Exit &exit);

    std::filesystem::path program_;
    std::chrono::milliseconds timeout_;
    std::set<pid_t> unrelated_children_; // inherited by exec, not workers
    base::UniqueFd socket_;              // closed: no launcher is running
    pid_t pid_ = 0;
    bool is_lost_ = false;  // and not yet replaced
    std::set<pid_t> alive_; // the launcher's children
    std::deque<Exit> exits_;
};

} // namespace arhost::supervise
