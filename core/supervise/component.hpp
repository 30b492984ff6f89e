// SPDX-License-Identifier: Apache-2.0
//
// A supervised plugin: a worker process that is started, watched, restarted when it dies or hangs, and
// given up when it can't work. The host sees commands go in, results come out, and what was lost.
#pragma once

#include "ipc/json_abi.hpp"
#include "sandbox/sandbox.hpp"
#include "supervise/process.hpp"
#include "supervise/restart_policy.hpp"

#include <random>

namespace arhost::supervise {

struct Limits {
    std::chrono::milliseconds start{10'000}; // without a word of progress
    std::chrono::milliseconds frame{5'000};  // for one command
    std::chrono::milliseconds stop{30'000};  // without a word of progress
    RestartLimits restart;
};

// Memory of slots that one process writes and others read.
struct Region {
    ipc::SharedMemory memory;
    ipc::SlotLayout layout;
    ipc::Mapping mapping; // this process's view
    std::uint32_t generation = 0;
};
using RegionPointer = std::shared_ptr<const Region>;

//   idle ─start─▶ starting ─ready, memory attached─▶ running ─stop, nothing in flight─▶ stopped
//                  ▲  │ died                           │ died
//                  │  ▼                                ▼
//                  └─ waiting ◀────────────────────────┘     too many failures, or a configuration that
//                                                            can't work: given_up (or the fallback starts)
class Component {
public:
    enum class State { idle, starting, running, waiting, given_up, stopped };

    struct Create {
        ipc::Json body; // options and setup; "type" is added
        std::vector<int> fds;
    };

    // What the host does about it. All but `hello` and `ready` are told after the state has changed.
    struct Hooks {
        // The plugin has been opened: what to create it with. Throws std::runtime_error where the
        // configuration does not fit it.
        std::function<Create(const ipc::PluginDescription &, std::size_t candidate)> hello;
        // It has started. Returns its output slots' layout (count 0: none). Throws where `ready` is bad.
        std::function<ipc::SlotLayout(const ipc::Json &ready)> ready;
        std::function<void()> running; // commands may be submitted
        std::function<void(const ipc::Command &, const ipc::Result &)> result;
        // The process has ended, whatever comes next. The unanswered commands, oldest first; that one
        // was being worked on.
        std::function<void(const std::vector<ipc::Command> &unanswered)> lost;
        // It will not be started again. `by_configuration`: it can't work as it is configured.
        std::function<void(const std::string &reason, bool by_configuration)> given_up;
        std::function<void(arhost_status, const std::string &text)> stopped; // after stop()
        std::function<void()> ended;                                         // a sink's window was closed
    };

    struct Crash {
        std::string plugin; // its id, or its file's name where it had not said that
        std::string how, log_tail;
        std::uint64_t frame; // that it was working on; no_frame where on none
        static constexpr std::uint64_t no_frame = ~std::uint64_t(0);
    };

    // `plugins`: the shared object, and the ones to fall back to when it is given up. `policy` holds for all.
    Component(Context &context, std::string name, std::vector<std::filesystem::path> plugins, const Limits &limits,
              sandbox::Policy policy, Hooks hooks);
    Component(const Component &) = delete;
    Component &operator=(const Component &) = delete;

    void start();
    // Lets it finish what it has, calls its stop, waits for its end. A dead one is started once more for
    // that, since files may be left to finish.
    void stop();
    void kill(); // at once, for good
    void cancel_call();
    // Its process is of no more use, for the reason given: ends it, and a new one follows.
    void end_process(const std::string &reason);

    // Takes commands. A process that is being ended does not, though its last results may still come.
    bool running() const { return state_ == State::running && !process_->ending(); }
    State state() const { return state_; }
    const std::string &name() const { return name_; }
    const std::filesystem::path &plugin() const { return plugins_[candidate_]; }
    const ipc::PluginDescription &description() const { return description_; }
    pid_t pid() const { return process_ ? process_->pid() : 0; }

    // Its output slots of this life; null until it runs.
    const RegionPointer &output() const { return output_; }

    std::size_t in_flight() const { return in_flight_.size(); }
    // Fills the ticket, attaches `input` first where it is new, and forgets inputs that nobody holds.
    void submit(ipc::Command command, const RegionPointer &input = nullptr);

    std::uint32_t restarts() const { return restarts_; }
    double cpu_seconds() const { return cpu_seconds_of_dead_ + (process_ ? process_->cpu_seconds() : 0); }
    const std::deque<Crash> &crashes() const { return crashes_; } // the last hundred

private:
    void spawn();
    void on_message(ipc::Message &message);
    void on_hello(const ipc::Json &body);
    void on_ready(const ipc::Json &body);
    void on_attached(const ipc::Json &body);
    void on_result(const ipc::Result &result);
    void on_died(const Death &death);
    void run();
    void stop_when_idle();
    void crashed(Crash crash);
    void try_again(const std::string &reason);
    void give_up(const std::string &reason, bool by_configuration);
    void stopped(arhost_status status, const std::string &text);
    void watch_start(std::chrono::milliseconds limit, const char *what);
    void watch_frame();

    Context &context_;
    std::string name_;
    std::vector<std::filesystem::path> plugins_;
    std::size_t candidate_ = 0;
    Limits limits_;
    sandbox::Policy sandbox_;
    Hooks hooks_;
    RestartPolicy policy_;
    State state_ = State::idle;
    bool stop_requested_ = false, stop_sent_ = false;
    std::optional<std::pair<arhost_status, std::string>> stop_answer_;
    std::string configuration_error_, failure_; // what the worker gave as its reason
    ipc::PluginDescription description_;
    std::unique_ptr<Process> process_;
    std::shared_ptr<Region> output_being_attached_;
    RegionPointer output_;
    std::map<std::uint32_t, std::weak_ptr<const Region>> attached_inputs_;
    std::uint32_t next_generation_ = 1;
    std::deque<ipc::Command> in_flight_;
    std::uint64_t next_ticket_ = 1;
    std::uint32_t restarts_ = 0;
    double cpu_seconds_of_dead_ = 0;
    std::deque<Crash> crashes_;
    std::uint32_t deaths_in_stop_ = 0;
    ipc::Reactor::Registration deadline_, restart_timer_;
    std::minstd_rand jitter_{std::random_device{}()};
};

// Cuts a region for the host's own writing: mapped writable here, for reading only elsewhere.
RegionPointer make_host_region(const char *name, const ipc::SlotLayout &layout);

} // namespace arhost::supervise
