// SPDX-License-Identifier: Apache-2.0
//
// The launcher: arhost-launcher, a small single-threaded process, is the parent of all workers. It starts them on
// request and reports how they exited. The kernel kills the workers when the launcher dies (PR_SET_PDEATHSIG refers
// to the thread that forked), and the launcher exits when the host exits, so a killed host leaves no process behind.
// If the launcher is killed or does not respond, the host replaces it, any number of times.
#pragma once

#include "base/unique_fd.hpp"
#include "ipc/channel.hpp"
#include "supervise/exit.hpp"
#include "supervise/isolation.hpp"

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
    ipc::Channel channel;    // descriptor 3 of the worker
    base::UniqueFd doorbell; // descriptor 4 of the worker
    base::UniqueFd output;   // stdout and stderr of the worker
};

struct Reply;

// Starts workers. Implemented by Launcher, and by replacements in core/inprocess and tests.
class Starter {
public:
    virtual ~Starter() = default;

    // Throws std::runtime_error if no process can be started.
    virtual Spawned spawn(const std::filesystem::path &program, Isolation isolation, const LogFunction &log) = 0;

    // Waits for the exit status of a process that has exited already (its pidfd is readable).
    virtual Exit wait_exit(pid_t pid) = 0;
};

// Create only one Launcher per process, on the thread that lives longest: this thread becomes the parent of the
// launcher, and of the orphans of a killed launcher, which the Launcher kills.
class Launcher final : public Starter {
public:
    // `program` is arhost-launcher; the first spawn starts it. Throws std::runtime_error if it cannot be executed.
    // `timeout`: maximum time for each response of the launcher, and for its exit.
    explicit Launcher(std::filesystem::path program, std::chrono::milliseconds timeout = std::chrono::seconds(4));
    ~Launcher() override;
    Launcher(const Launcher &) = delete;
    Launcher &operator=(const Launcher &) = delete;

    Spawned spawn(const std::filesystem::path &program, Isolation isolation, const LogFunction &log) override;
    Exit wait_exit(pid_t pid) override;

private:
    std::string start_error(int error) const;
    void start();
    // Returns nullopt if the launcher has died or does not respond.
    std::optional<Reply> receive_reply(std::vector<base::UniqueFd> &fds);
    void discard(); // kills the launcher and all its workers
    void record(const Exit &exit);

    std::filesystem::path program_;
    std::chrono::milliseconds timeout_;
    std::set<pid_t> unrelated_children_; // children that existed before; they are not workers
    base::UniqueFd socket_;              // empty if no launcher is running
    pid_t pid_ = 0;
    bool is_lost_ = false;     // the launcher was discarded and is not yet replaced
    bool has_orphans_ = false; // processes of a discarded launcher have not ended yet
    std::set<pid_t> alive_;    // workers of the current launcher
    std::deque<Exit> exits_;
};

} // namespace arhost::supervise
