// SPDX-License-Identifier: Apache-2.0
//
// One live worker process as the host sees it: its messages, results and death, and the ways to end it.
#pragma once

#include "ipc/channel.hpp"
#include "ipc/memory.hpp"
#include "ipc/protocol.hpp"
#include "ipc/reactor.hpp"
#include "supervise/launcher.hpp"

#include <deque>
#include <functional>
#include <string>

namespace arhost::supervise {

// What every component of a host shares.
struct Context {
    ipc::Reactor &reactor;
    Starter &launcher;
    std::filesystem::path worker_program;
    LogFunction log;
};

struct Death {
    std::string how;      // "killed by signal 11 (Segmentation fault) in per-frame"
    bool clean = false;   // exit status 0
    bool by_host = false; // the host ended it, for the reason in `how`
    int signal = 0;       // that killed it; 0: it exited
    double cpu_seconds = 0;
    std::string log_tail; // the last lines that it logged or printed
};

class Process {
public:
    // Each is called from the reactor. `died` comes last and once; the Process may be destroyed in it,
    // and in none of the others. An exception out of `message` ends the process.
    struct Events {
        std::function<void(ipc::Message &)> message; // but for log messages
        std::function<void(const ipc::Result &)> result;
        std::function<void(const Death &)> died;
    };

    // Starts a worker and gives it its pages together with `first`, whose body lacks nothing else.
    Process(Context &context, std::string name, Events events, const ipc::Json &first);
    ~Process(); // kills it
    Process(const Process &) = delete;
    Process &operator=(const Process &) = delete;

    // A message of the start-up, which the worker waits for.
    void send(const ipc::Json &body, std::initializer_list<int> fds = {});
    // A message to a worker that serves commands; taken in its turn.
    void send_in_turn(const ipc::Json &body, std::initializer_list<int> fds = {});
    void submit(const ipc::Command &command);

    void ask_to_cancel(); // the running call sees host->cancelled
    // Ends it for a reason that stands in Death::how: SIGABRT, and SIGKILL soon after.
    void end(const std::string &reason);
    bool ending() const { return !end_reason_.empty(); }
    void kill_now();

    pid_t pid() const { return spawned_.pid; }
    double cpu_seconds() const; // so far

private:
    void take_messages(int most);
    void on_doorbell();
    void take_output(std::size_t max_bytes);
    void on_death();
    void take_results();
    void log(arhost_severity severity, const std::string &text);
    void tell_of_lines_left_out();
    void remember(const std::string &line);

    Context &context_;
    std::string name_;
    Events events_;
    Spawned spawned_;
    ipc::SharedMemory host_memory_, worker_memory_;
    ipc::Mapping host_page_, worker_page_;
    ipc::CommandProducer commands_;
    ipc::ResultConsumer results_;
    std::string end_reason_, partial_line_;
    std::deque<std::string> tail_;
    ipc::Reactor::Clock::time_point log_second_ends_{};
    struct Lines { // within the second
        int said = 0, left_out = 0;
    };
    Lines chatter_, warnings_;
    std::uint64_t rings_ = 0, results_taken_ = 0;
    ipc::Reactor::Registration channel_watch_, doorbell_watch_, output_watch_, death_watch_, kill_deadline_;
};

} // namespace arhost::supervise
