// SPDX-License-Identifier: Apache-2.0
//
// The host's view of one running worker: its messages, results and exit.
#pragma once

#include "ipc/memory.hpp"
#include "ipc/messages.hpp"
#include "ipc/protocol.hpp"
#include "ipc/reactor.hpp"
#include "supervise/launcher.hpp"

#include <deque>
#include <functional>
#include <string>

namespace arhost::supervise {

// Shared by all components of a host.
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
    int signal = 0;       // that killed it; 0: it exited by itself
    double cpu_seconds = 0;
    std::string log_tail; // the last 20 lines logged or printed
};

class Process {
public:
    // Called from the reactor. `died` is called last and once; only there the Process may be destroyed. An exception
    // from `message` ends the process.
    struct Callbacks {
        std::function<void(ipc::Message &)> message; // all except Log
        std::function<void(const ipc::Result &)> result;
        std::function<void(const Death &)> died;
    };

    // Starts a worker and sends it the pages with `first`, the encoded messages::Open or messages::Load.
    Process(Context &context, std::string name, Callbacks callbacks, const ipc::Json &first);
    ~Process(); // kills it
    Process(const Process &) = delete;
    Process &operator=(const Process &) = delete;

    // Before the worker is ready, which then waits for messages only.
    template <class T> void send(const T &message, std::initializer_list<int> fds = {}) {
        send_json(ipc::encode(message), fds);
    }
    // To a ready worker, which receives the message in order with its commands.
    template <class T> void send_ordered(const T &message, std::initializer_list<int> fds = {}) {
        send_json_ordered(ipc::encode(message), fds);
    }
    void submit(const ipc::Command &command);

    void request_cancel(); // the running call sees host->cancelled
    // Sends SIGABRT, and SIGKILL soon after. `reason` appears in Death::how.
    void end(const std::string &reason);
    bool ending() const { return !end_reason_.empty(); }
    void kill_now();

    pid_t pid() const { return spawned_.pid; }
    double cpu_seconds() const; // so far

private:
    void send_json(const ipc::Json &body, std::initializer_list<int> fds);
    void send_json_ordered(const ipc::Json &body, std::initializer_list<int> fds);
    void receive_messages(int max_messages);
    void on_doorbell();
    void read_output(std::size_t max_bytes);
    void on_death();
    void receive_results();
    void log(arhost_severity severity, const std::string &text);
    void report_suppressed_lines();
    void append_to_tail(const std::string &line);

    Context &context_;
    std::string name_;
    Callbacks callbacks_;
    Spawned spawned_;
    ipc::SharedMemory host_memory_, worker_memory_;
    ipc::Mapping host_page_, worker_page_;
    ipc::CommandProducer commands_;
    ipc::ResultConsumer results_;
    std::string end_reason_, partial_line_;
    std::deque<std::string> tail_;
    ipc::Reactor::Clock::time_point log_second_ends_{};
    struct LineCount { // within the current second
        int logged = 0, suppressed = 0;
    };
    LineCount other_lines_, warnings_;
    std::uint64_t rings_ = 0, results_received_ = 0;
    ipc::Reactor::Registration channel_watch_, doorbell_watch_, output_watch_, death_watch_, kill_deadline_;
};

} // namespace arhost::supervise
