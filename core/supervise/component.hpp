// SPDX-License-Identifier: Apache-2.0
//
// A supervised plugin: starts a worker, enforces its deadlines, restarts it if it dies or hangs, and disables it if
// it keeps failing. The host submits commands to the component. The component reports results and lost commands.
#pragma once

#include "ipc/messages.hpp"
#include "sandbox/sandbox.hpp"
#include "supervise/process.hpp"
#include "supervise/restart_policy.hpp"

#include <random>

namespace arhost::supervise {

// Shared memory with slots that one process writes and others read.
struct Region {
    ipc::SharedMemory memory;
    ipc::SlotLayout layout;
    ipc::Mapping mapping; // mapping in this process
};
using RegionPointer = std::shared_ptr<const Region>;

struct Crash {
    std::string plugin; // id of the plugin, or its file name if it died before Hello
    std::string how, log_tail;
    std::uint64_t frame; // the frame that was being processed, or no_frame
    static constexpr std::uint64_t no_frame = ~std::uint64_t(0);
    // Number of crashes kept per component; limits the statistics and the memory of the host.
    static constexpr std::size_t max_kept = 20;
};

//   idle ─start─▶ starting ─ready, memory attached─▶ running ─stop, nothing in flight─▶ stopped
//                  ▲  │ died                           │ died
//                  │  ▼                                ▼
//                  └─ waiting ◀────────────────────────┘     too many failures or a configuration error:
//                                                            the fallback starts, or disabled
class Component {
public:
    enum class State { idle, starting, running, waiting, disabled, stopped };

    struct Create {
        ipc::messages::Create message;
        std::vector<int> fds; // as described at messages::Create
    };

    // All callbacks except `hello` and `ready` are called after the state has changed.
    struct Callbacks {
        // Called when the plugin has been opened. Returns the parameters of its instance; throws std::runtime_error
        // if the configuration does not match the plugin. `candidate`: index in the list of plugins.
        std::function<Create(const model::PluginDescription &, std::size_t candidate)> hello;
        // Called when the plugin has started. Returns the layout of its output slots (count 0: no slots); throws if
        // the values in `ready` are unsuitable.
        std::function<ipc::SlotLayout(const ipc::messages::Ready &ready)> ready;
        std::function<void()> running; // called when the component accepts commands
        std::function<void(const ipc::Command &, const ipc::Result &)> result;
        // Called when the process has died. `unanswered`: the commands without a result, oldest first; the worker was
        // executing the first one.
        std::function<void(const std::vector<ipc::Command> &unanswered)> lost;
        // Called when the component will not be restarted.
        std::function<void(const std::string &reason, bool is_configuration_error)> disabled;
        std::function<void(arhost_status, const std::string &text)> stopped; // after stop()
        std::function<void()> end_requested; // a sink has ended while it was idle; only called for sinks
        std::function<void(const ipc::messages::Request &)> request; // a sink has sent a command
    };

    // `plugins`: the shared object of the plugin, followed by its fallbacks. `sandbox` applies to all of them.
    Component(Context &context, std::string name, std::vector<std::filesystem::path> plugins,
              const base::Limits &limits, sandbox::Policy sandbox, Callbacks callbacks);
    Component(const Component &) = delete;
    Component &operator=(const Component &) = delete;

    void start();
    // Stops the component asynchronously: waits for the commands in flight, calls the plugin's `stop` and waits until
    // the process has exited. A dead process is restarted first, because the plugin may have to complete files.
    void stop();
    void kill(); // kills the process at once; it is not restarted
    // Asks the plugin to return from the current call soon. After this, a call that waits does not extend its
    // deadline.
    void cancel_call();
    // Whether a sink has reported progress in the current call. It then waits for another program that does not take
    // the frame.
    bool waits() const { return waits_; }
    // Why a live source has no camera at present; "" if it has one.
    const std::string &missing_device() const { return missing_device_; }
    // Terminates the process, which is then restarted.
    void end_process(const std::string &reason);
    // Terminates the process, which is not restarted, because it would fail again.
    void disable(const std::string &reason);

    // Whether commands may be submitted. While the process is being terminated, they may not, though results may
    // still arrive.
    bool running() const { return state_ == State::running && !process_->ending(); }
    State state() const { return state_; }
    const std::string &name() const { return name_; }
    const std::filesystem::path &plugin() const { return plugins_[candidate_]; }
    std::size_t candidate() const { return candidate_; } // index of plugin() in the list of plugins
    const model::PluginDescription &description() const { return description_; }
    const base::Limits &limits() const { return limits_; }
    pid_t pid() const { return process_ ? process_->pid() : 0; }

    // The output slots of the current process; null until the state is `running`.
    const RegionPointer &output() const { return output_; }
    // The number of regions with output slots of dead processes that are still in use.
    std::size_t earlier_outputs() const;

    std::size_t in_flight() const { return in_flight_.size(); }
    // Sets the ticket and the generations of the command and sends it. First attaches the regions that the worker
    // does not know yet. Detaches inputs to which nothing refers any more.
    void submit(ipc::Command command, const RegionPointer &input = nullptr, const RegionPointer &state = nullptr,
                const RegionPointer &video = nullptr);

    // Answers a command of the sink. Does nothing if the worker that sent the command is no longer running:
    // `restarts` is the number of restarts when the command was sent.
    void answer(const ipc::messages::Answer &answer, std::uint32_t restarts);
    // Changes an option of the running plugin. Calls `done` with "" or with the reason why the option is unchanged.
    // The caller has to pass the new value when a restarted worker creates the plugin.
    void set_option(const model::OptionValue &option, std::function<void(const std::string &error)> done);

    std::uint32_t restarts() const { return restarts_; }
    const std::string &sandbox_level() const { return sandbox_level_; } // as in messages::Hello
    // Logs a line for which the worker is responsible (WorkerBudget::log).
    void log(arhost_severity severity, const std::string &text) { budget_.log(severity, text); }
    // The events that the plugin has counted, in all processes.
    model::Counters counters() const;
    double cpu_seconds() const { return cpu_seconds_of_dead_ + (process_ ? process_->cpu_seconds() : 0); }
    const std::deque<Crash> &crashes() const { return crashes_; } // the last Crash::max_kept

private:
    void spawn();
    std::uint32_t attach(const RegionPointer &input);
    void on_message(ipc::Message &message);
    void on_hello(const ipc::Message &message);
    void on_ready(const ipc::Message &message);
    void on_attached(const ipc::messages::Attached &attached);
    void on_result(const ipc::Result &result);
    void on_died(const Death &death);
    void run();
    void stop_when_idle();
    bool loses_its_device_often();
    void record_crash(Crash crash);
    void restart(const std::string &reason);
    bool may_wait_for_device() const;
    void wait_for_device(const std::string &reason);
    void spawn_after(std::chrono::milliseconds delay);
    void fall_back_or_disable(const std::string &reason, bool is_configuration_error);
    void stopped(arhost_status status, const std::string &text);
    void set_start_deadline();
    void set_stop_deadline();
    void begin_command();
    void set_frame_deadline();
    void set_deadline(ipc::Reactor::Registration &deadline, std::chrono::milliseconds limit, const char *what,
                      const char *details, const char *remedy = ""); // constants: set for each frame
    bool may_wait() const;

    Context &context_;
    std::string name_;
    std::vector<std::filesystem::path> plugins_;
    std::size_t candidate_ = 0;
    base::Limits limits_;
    sandbox::Policy sandbox_;
    Callbacks callbacks_;
    WorkerBudget budget_;
    RestartPolicy restart_policy_;
    std::deque<ipc::Reactor::Clock::time_point> device_losses_; // within the last minute
    State state_ = State::idle;
    enum class Handshake { opening, creating, done }; // waits for Hello; waits for Ready; has received both
    Handshake handshake_ = Handshake::opening;
    bool stop_requested_ = false, stop_sent_ = false, waits_ = false, call_cancelled_ = false;
    bool has_lost_device_ = false; // the current process has reported the loss of its device
    std::string missing_device_;
    std::optional<ipc::messages::Stopped> stop_response_;
    std::string configuration_error_, failure_; // text of Failed, or of an exception of `hello` or `ready`
    model::PluginDescription description_;
    std::unique_ptr<Process> process_;
    std::shared_ptr<Region> pending_output_;
    RegionPointer output_;
    std::vector<std::weak_ptr<const Region>> earlier_outputs_;
    struct AttachedInput {
        std::weak_ptr<const Region> region;
        std::uint32_t generation; // generation number in the worker
    };
    std::vector<AttachedInput> attached_inputs_;
    std::uint32_t next_generation_ = 1;
    std::deque<ipc::Command> in_flight_;
    std::deque<std::function<void(const std::string &)>> unset_options_; // the calls of set_option without a response
    std::string sandbox_level_;
    std::uint64_t next_ticket_ = 1;
    std::uint32_t restarts_ = 0;
    double cpu_seconds_of_dead_ = 0;
    model::Counters counters_, counters_of_dead_; // counters of the current process; sums over the earlier processes
    std::deque<Crash> crashes_;
    std::uint32_t deaths_in_stop_ = 0;
    ipc::Reactor::Registration deadline_, total_deadline_, restart_timer_;
    std::minstd_rand jitter_{std::random_device{}()};
};

// Creates a region that the host writes: it is mapped writable in this process, and read-only in the others.
RegionPointer make_host_region(const char *name, const ipc::SlotLayout &layout);

} // namespace arhost::supervise
