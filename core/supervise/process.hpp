// SPDX-License-Identifier: Apache-2.0
//
// The host's view of one running worker: its messages, results and exit.
#pragma once

#include "ipc/memory.hpp"
#include "ipc/messages.hpp"
#include "ipc/protocol.hpp"
#include "ipc/reactor.hpp"
#include "sandbox/sandbox.hpp"
#include "supervise/launcher.hpp"
#include "supervise/worker_budget.hpp"

#include <deque>
#include <functional>
#include <optional>
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
    bool clean = false;   // exited with status 0
    bool by_host = false; // the host terminated the process, for the reason in `how`
    int signal = 0;       // the signal that killed the process; 0: it exited by itself
    double cpu_seconds = 0;
    std::string log_tail; // the last 20 lines that the worker logged or printed
};

// Returns how the launcher isolates a worker with this policy.
Isolation isolation_of(const sandbox::Policy &policy);

class Process {
public:
    // Called from the reactor. `died` is called once, as the last callback, and is the only one that may destroy the
    // Process. If `message` throws, the process is terminated.
    struct Callbacks {
        std::function<void(ipc::Message &)> message; // all messages except Log
        std::function<void(const ipc::Result &)> result;
        std::function<void(const Death &)> died;
    };

    // Starts a worker with `policy` and sends it the pages with `first`, a messages::Open, messages::Load or
    // messages::ReadLog, whose policy it sets. `budget` must outlive the Process.
    template <class T>
    Process(Context &context, WorkerBudget &budget, Callbacks callbacks, T first, const sandbox::Policy &policy)
        : Process(context, budget, std::move(callbacks), with_policy(first, policy), isolation_of(policy)) {}
    ~Process(); // kills the process if it is still running
    Process(const Process &) = delete;
    Process &operator=(const Process &) = delete;

    // For a worker that has not sent Ready yet and therefore waits only for messages.
    template <class T> void send(const T &message, const std::vector<int> &fds = {}) {
        send_json(ipc::encode(message), fds);
    }
    // For a worker that has sent Ready: it receives the message in order relative to the commands.
    template <class T> void send_ordered(const T &message, const std::vector<int> &fds = {}) {
        send_json_ordered(ipc::encode(message), fds);
    }
    void submit(const ipc::Command &command);

    void request_cancel(); // makes host->cancelled return non-zero
    // Terminates the process: sends SIGABRT, and 100 ms later SIGKILL. `reason` appears in Death::how.
    void end(const std::string &reason);
    bool ending() const { return !end_reason_.empty(); }
    void kill_now();

    pid_t pid() const { return spawned_.pid; }
    double cpu_seconds() const; // used so far

private:
    template <class T> static ipc::Json with_policy(T &first, const sandbox::Policy &policy) {
        first.sandbox = sandbox::to_json(policy);
        return ipc::encode(first);
    }
    Process(Context &context, WorkerBudget &budget, Callbacks callbacks, const ipc::Json &first, Isolation isolation);
    void send_json(const ipc::Json &body, const std::vector<int> &fds);
    void send_json_ordered(const ipc::Json &body, const std::vector<int> &fds);
    void receive_messages(int max_messages);
    void on_doorbell();
    void watch_output();
    void read_output(std::size_t max_bytes);
    bool discard_flood();
    void on_death();
    void receive_results();
    void log(arhost_severity severity, const std::string &text);
    void print_held_error();
    void append_to_tail(const std::string &line);

    Context &context_;
    WorkerBudget &budget_;
    Callbacks callbacks_;
    Spawned spawned_;
    ipc::SharedMemory host_memory_, worker_memory_;
    ipc::Mapping host_page_, worker_page_;
    ipc::CommandProducer commands_;
    ipc::ResultConsumer results_;
    std::string end_reason_, partial_line_;
    // The last error that the worker logged before Ready. It is not printed if Failed reports the same text.
    std::optional<std::string> held_error_;
    bool ready_ = false;
    std::deque<std::string> tail_;
    ipc::Reactor::Clock::time_point next_output_{}; // when output may be logged again
    base::UniqueFd null_;                           // where a flood of output goes; opened when needed
    std::uint64_t discarded_bytes_ = 0;
    std::uint64_t rings_ = 0, results_received_ = 0;
    ipc::Reactor::Registration channel_watch_, doorbell_watch_, output_watch_, output_pause_, death_watch_,
        kill_deadline_;
};

} // namespace arhost::supervise
