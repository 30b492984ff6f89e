// SPDX-License-Identifier: Apache-2.0
//
// The launcher: a small single-threaded process, forked from the host before it has any thread, that is
// the parent of all workers. It starts them on request and reports how they ended. Workers die with it
// (PR_SET_PDEATHSIG follows the thread that forked), and it ends with the host, so a host that is killed
// leaves nothing behind. A second one stands by, since once the host has threads it can fork no other: should
// somebody kill the first, its workers, which die with it, are started again by the second.
#pragma once

#include "ring/channel.hpp"
#include "ring/unique_fd.hpp"

#include <deque>
#include <filesystem>
#include <set>
#include <sys/resource.h>
#include <sys/types.h>

namespace arhost::supervise {

// A process that has just been started.
struct Spawned {
    pid_t pid = 0;
    ring::UniqueFd pidfd;    // readable once it is dead
    ring::Channel channel;   // its descriptor 3
    ring::UniqueFd doorbell; // its descriptor 4
    ring::UniqueFd output;   // what it writes to stdout and stderr
};

struct Exit {
    pid_t pid;
    int wait_status; // as of wait(2)
    double cpu_seconds;
};

double cpu_seconds(const rusage &usage); // user and system

// What starts workers: the launcher, or whatever stands in for it (core/inprocess).
class Starter {
public:
    virtual ~Starter() = default;

    // Throws std::runtime_error where no process can be had.
    virtual Spawned spawn(const std::filesystem::path &program) = 0;

    // How a process that is dead already (its pidfd is readable) ended. Waits until that is known.
    virtual Exit wait_exit(pid_t pid) = 0;
};

class Launcher final : public Starter {
public:
    // Forks. To be called while the process has one thread.
    Launcher();
    ~Launcher() override;
    Launcher(const Launcher &) = delete;
    Launcher &operator=(const Launcher &) = delete;

    Spawned spawn(const std::filesystem::path &program) override;
    Exit wait_exit(pid_t pid) override;

private:
    struct Side {
        ring::UniqueFd socket;
        pid_t pid = 0;
    };
    Side fork_one() const;
    // False: there is no other.
    bool go_on_with_the_next();
    void note(const Exit &exit);

    std::deque<Side> sides_; // the first is at work
    std::set<pid_t> alive_;  // its children
    std::deque<Exit> exits_;
};

} // namespace arhost::supervise
