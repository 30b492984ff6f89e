// SPDX-License-Identifier: Apache-2.0
//
// The launcher: a small single-threaded process, arhost-launcher, that is the parent of all workers. It starts them
// on request and reports how they ended. Workers die with it (PR_SET_PDEATHSIG follows the thread that forked), and
// it ends with the host, so a host that is killed leaves nothing behind. One that somebody kills, or that does not
// answer, is replaced, as often as it takes.
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

// A process that has just been started.
struct Spawned {
    pid_t pid = 0;
    base::UniqueFd pidfd;    // readable once it is dead
    ipc::Channel channel;    // its descriptor 3
    base::UniqueFd doorbell; // its descriptor 4
    base::UniqueFd output;   // what it writes to stdout and stderr
};

struct Reply;

// What starts workers: the launcher, or whatever stands in for it (core/inprocess).
class Starter {
public:
    virtual ~Starter() = default;

    // Throws std::runtime_error where no process can be had.
    virtual Spawned spawn(const std::filesystem::path &program, const LogFunction &log) = 0;

    // How a process that is dead already (its pidfd is readable) ended. Waits until that is known.
    virtual Exit wait_exit(pid_t pid) = 0;
};

// To be used from the thread that lives longest, and one for all of a process: the launcher is that thread's child,
// and so is what the workers of a killed one leave behind, which is ended.
class Launcher final : public Starter {
public:
    // `program`: arhost-launcher, which is started together with the first worker. Throws std::runtime_error where it
    // can't be executed. `timeout`: what it has to answer, and at the end to finish.
    explicit Launcher(std::filesystem::path program, std::chrono::milliseconds timeout = std::chrono::seconds(4));
    ~Launcher() override;
    Launcher(const Launcher &) = delete;
    Launcher &operator=(const Launcher &) = delete;

    Spawned spawn(const std::filesystem::path &program, const LogFunction &log) override;
    Exit wait_exit(pid_t pid) override;

private:
    std::string cannot_start(int error) const;
    void start();
    std::optional<Reply> receive_reply(std::vector<base::UniqueFd> &fds); // none: it is gone, or as good as
    void lose();                                                          // it is gone, and its workers with it
    void note(const Exit &exit);

    std::filesystem::path program_;
    std::chrono::milliseconds timeout_;
    std::set<pid_t> not_of_workers_; // children of who became this program by exec
    base::UniqueFd socket_;          // none: no launcher is at work
    pid_t pid_ = 0;
    bool is_lost_ = false;  // and not yet replaced
    std::set<pid_t> alive_; // its children
    std::deque<Exit> exits_;
};

} // namespace arhost::supervise
