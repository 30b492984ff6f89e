// SPDX-License-Identifier: Apache-2.0
#include "supervise/process.hpp"

#include <csignal>
#include <cstring>
#include <fcntl.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <utility>

namespace arhost::supervise {
namespace {

using namespace ipc;

// Sends a signal to a worker. Returns false if the worker is a thread (arhost-inprocess).
bool signal_process(const base::UniqueFd &pidfd, int signal) {
    return ::syscall(SYS_pidfd_send_signal, pidfd.get(), signal, nullptr, 0) == 0 || errno != EBADF;
}

} // namespace

Isolation isolation_of(const sandbox::Policy &policy) {
    Isolation isolation{
        policy.mode != sandbox::Mode::none, sandbox::memory_limit(policy), policy.standard_output, {}};
    policy.usb_device.copy(isolation.usb_device.data(), isolation.usb_device.size() - 1); // the rest remains 0
    return isolation;
}

Process::Process(Context &context, WorkerBudget &budget, Callbacks callbacks, const Json &first, Isolation isolation)
    : context_(context), budget_(budget), callbacks_(std::move(callbacks)),
      spawned_(context.launcher.spawn(context.worker_program, isolation, context.log)),
      host_memory_(SharedMemory::create("arhost-host-page", sizeof(HostPage))),
      worker_memory_(SharedMemory::create("arhost-worker-page", sizeof(WorkerPage))),
      host_page_(host_memory_.map(Access::read_write)), worker_page_(worker_memory_.map(Access::read_only)),
      commands_(host_page_.as<HostPage>().commands, worker_page_.as<WorkerPage>().commands),
      results_(worker_page_.as<WorkerPage>().results, host_page_.as<HostPage>().results) {
    host_memory_.seal_future_writes(); // the worker can map this page only read-only
    Reactor &reactor = context_.reactor;
    channel_watch_ = reactor.watch(spawned_.channel.fd(), [this] {
        WorkerBudget &of_component = budget_; // stays valid if a message destroys this object
        const auto begin = WorkerBudget::Clock::now();
        receive_messages(16);
        of_component.exclude(WorkerBudget::Clock::now() - begin);
    });
    doorbell_watch_ = reactor.watch(spawned_.doorbell.get(), [this] { on_doorbell(); });
    watch_output();
    death_watch_ = reactor.watch(spawned_.pidfd.get(), [this] { on_death(); });
    send_json(first, {host_memory_.fd(), worker_memory_.fd()});
}

Process::~Process() {
    if (death_watch_.active())
        signal_process(spawned_.pidfd, SIGKILL);
}

void Process::send_json(const Json &body, const std::vector<int> &fds) {
    if (spawned_.channel.send(body, fds, false))
        return;
    // If the queue is full, the worker has stopped receiving. Other errors mean that the worker is dead, which the
    // pidfd reports.
    if (errno == EAGAIN)
        end("does not read its control messages");
    else if (errno == ETOOMANYREFS)
        end("its shared memory cannot be sent: this user's processes have too many file descriptors in flight "
            "(ETOOMANYREFS)");
}

void Process::send_json_ordered(const Json &body, const std::vector<int> &fds) {
    send_json(body, fds);
    Command command{};
    command.kind = CommandKind::control;
    submit(command);
}

void Process::submit(const Command &command) {
    if (const RingResult result = commands_.push(command); result != RingResult::done)
        return end(result == RingResult::wait ? "does not read its commands"
                                              : "protocol violation: its command ring is inconsistent");
    wake(host_page_.as<HostPage>().wake);
}

void Process::request_cancel() {
    host_page_.as<HostPage>().cancelled.store(1, std::memory_order_relaxed); // relaxed: no other data depends on it
    wake(host_page_.as<HostPage>().wake);
}

void Process::end(const std::string &reason) {
    if (!end_reason_.empty())
        return;
    end_reason_ = reason.substr(0, messages::max_text); // it may contain text that the worker chose
    if (!signal_process(spawned_.pidfd, SIGABRT)) { // the worker is a thread, which ends when its channel is closed
        ::shutdown(spawned_.channel.fd(), SHUT_RDWR);
        wake(host_page_.as<HostPage>().wake);
    }
    kill_deadline_ =
        context_.reactor.at(context_.reactor.now() + std::chrono::milliseconds(100), [this] { kill_now(); });
}

void Process::kill_now() {
    signal_process(spawned_.pidfd, SIGKILL);
}

double Process::cpu_seconds() const {
    clockid_t clock;
    timespec time{};
    if (::clock_getcpuclockid(spawned_.pid, &clock) != 0 || ::clock_gettime(clock, &time) != 0)
        return 0;
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

// Receives at most `max_messages`, and no more after 256 KiB, so that a flood of messages cannot delay the frames.
void Process::receive_messages(int max_messages) {
    std::size_t bytes = 0;
    for (int i = 0; i < max_messages && bytes < (256 << 10); ++i) {
        Message message;
        switch (spawned_.channel.receive(message, 0)) {
        case ReceiveState::none:
            return;
        case ReceiveState::closed:
            channel_watch_.cancel();
            // A worker that closed its channel but does not exit within 1 s is killed.
            if (!ending())
                kill_deadline_ = context_.reactor.at(context_.reactor.now() + std::chrono::seconds(1),
                                                     [this] { end("closed its control channel"); });
            return;
        case ReceiveState::malformed:
            return end("protocol violation: malformed message");
        case ReceiveState::message:
            break;
        }
        bytes += message.size;
        if (!budget_.spend(message.size)) {
            channel_watch_.cancel();
            return end("protocol violation: it floods its control channel with messages");
        }
        if (!message.fds.empty() && !is<messages::Loaded>(message)) {
            // Freeing the descriptors costs the host's time in the kernel.
            channel_watch_.cancel();
            return end("protocol violation: it sent file descriptors");
        }
        try {
            if (is<messages::Log>(message)) {
                const auto [severity, text] = parse<messages::Log>(message);
                log(severity, text);
            } else {
                ready_ = ready_ || is<messages::Ready>(message);
                if (is<messages::Failed>(message) && held_error_ == parse<messages::Failed>(message).text)
                    held_error_.reset();
                else if (ready_)
                    print_held_error();
                callbacks_.message(message);
            }
        } catch (const ProtocolViolation &violation) {
            return end(std::string("protocol violation: ") + violation.what());
        } catch (const std::exception &error) {
            return end(std::string("its message cannot be handled: ") + error.what());
        }
    }
}

void Process::log(arhost_severity severity, const std::string &text) {
    append_to_tail(text);
    print_held_error();
    if (severity == ARHOST_SEVERITY_ERROR && !ready_)
        held_error_ = text;
    else
        budget_.log(severity, text);
}

void Process::print_held_error() {
    if (const auto text = std::exchange(held_error_, std::nullopt))
        budget_.log(ARHOST_SEVERITY_ERROR, *text);
}

void Process::on_doorbell() {
    const int rings = drain_doorbell(spawned_.doorbell.get());
    if (rings < 0) {
        doorbell_watch_.cancel();
        return;
    }
    rings_ += static_cast<std::uint64_t>(rings);
    receive_results();
    if (rings_ > results_received_ + 8192)
        end("protocol violation: it floods its doorbell");
}

void Process::receive_results() {
    for (std::uint32_t i = 0; i < ring_capacity; ++i) {
        Result result;
        switch (results_.pop(result)) {
        case RingResult::wait:
            return;
        case RingResult::violation:
            return end("protocol violation: its result ring is inconsistent");
        case RingResult::done:
            ++results_received_;
            callbacks_.result(result);
        }
    }
}

// Logs at most 16 KiB per 10 ms. Discards what a worker prints beyond that, because its writes would otherwise block
// until the pipe has room, which would delay its frames.
void Process::watch_output() {
    using std::chrono::milliseconds;
    output_watch_ = context_.reactor.watch(spawned_.output.get(), [this] {
        const auto now = context_.reactor.now();
        if (now >= next_output_) {
            read_output(16 << 10);
            next_output_ = now + milliseconds(10);
        }
        if (!output_watch_.active())
            return;
        const bool is_flood = discard_flood();
        output_watch_.cancel();
        output_pause_ = context_.reactor.at(is_flood ? now + milliseconds(1) : next_output_, [this] {
            try {
                watch_output();
            } catch (const std::system_error &error) { // the user's limit of epoll watches is reached
                end(std::string("its output cannot be read: ") + error.what());
            }
        });
    });
}

// If more than half of the pipe's original size is unread, discards it except for its end, which may tell why the
// worker crashes, and returns true. A larger pipe lets a worker that floods it continue until the next call. Moving
// pages to /dev/null copies nothing.
bool Process::discard_flood() {
    constexpr int flood_bytes = 32 << 10, kept_bytes = 4096, larger_pipe_bytes = 1 << 20;
    int unread = 0;
    if (::ioctl(spawned_.output.get(), FIONREAD, &unread) != 0 || unread < flood_bytes)
        return false;
    if (!null_) {
        null_.reset(::open("/dev/null", O_WRONLY | O_CLOEXEC));
        if (!null_)
            return false; // too many open files: the pipe remains full, so the worker waits
        (void)::fcntl(spawned_.output.get(), F_SETPIPE_SZ, larger_pipe_bytes); // fails at the user's limit
        budget_.log(ARHOST_SEVERITY_WARNING,
                    "it prints more than arhost logs, 1.6 MB/s; arhost discards the rest. Let it print less, for "
                    "example once per second instead of in each frame");
    }
    const ssize_t count = ::splice(spawned_.output.get(), nullptr, null_.get(), nullptr,
                                   static_cast<std::size_t>(unread - kept_bytes), SPLICE_F_NONBLOCK);
    if (count <= 0)
        return false;
    discarded_bytes_ += static_cast<std::uint64_t>(count);
    partial_line_.clear();
    return true;
}

void Process::read_output(std::size_t max_bytes) {
    char bytes[4096];
    for (std::size_t total = 0; total < max_bytes; total += sizeof bytes) {
        const ssize_t count = ::read(spawned_.output.get(), bytes, sizeof bytes);
        if (count <= 0) {
            if (count == 0)
                output_watch_.cancel();
            return;
        }
        for (ssize_t i = 0; i < count; ++i) {
            if (bytes[i] != '\n' && partial_line_.size() < 1000) {
                partial_line_ += bytes[i];
                continue;
            }
            if (!partial_line_.empty())
                log(ARHOST_SEVERITY_DEBUG, partial_line_);
            partial_line_.clear();
        }
    }
}

void Process::append_to_tail(const std::string &line) {
    constexpr std::size_t max_line = 400;
    tail_.push_back(line.substr(0, max_line));
    if (tail_.size() > 20)
        tail_.pop_front();
}

void Process::on_death() {
    // Receives what the worker sent before it exited. The buffers of socket and pipe limit the amount.
    if (channel_watch_.active())
        receive_messages(100'000);
    receive_results();
    if (output_watch_.active() || output_pause_.active())
        read_output(1 << 20);
    if (!partial_line_.empty())
        append_to_tail(partial_line_);
    if (discarded_bytes_ > 0)
        budget_.log(ARHOST_SEVERITY_INFO,
                    "discarded " + std::to_string(discarded_bytes_ / 1'000'000) + " MB of what it printed");
    print_held_error();
    const Exit exit = context_.launcher.wait_exit(spawned_.pid);
    Death death;
    death.cpu_seconds = exit.cpu_seconds;
    death.by_host = ending();
    death.signal = WIFSIGNALED(exit.wait_status) ? WTERMSIG(exit.wait_status) : 0;
    death.clean = WIFEXITED(exit.wait_status) && WEXITSTATUS(exit.wait_status) == 0;
    // SYNC with Link::mark: a relaxed load suffices, because the writer has exited.
    const auto call = static_cast<Call>(worker_page_.as<WorkerPage>().call.load(std::memory_order_relaxed));
    if (ending())
        death.how = std::string("ended by arhost ") + to_text(call);
    else if (WIFSIGNALED(exit.wait_status))
        death.how = "killed by signal " + std::to_string(WTERMSIG(exit.wait_status)) + " (" +
                    ::strsignal(WTERMSIG(exit.wait_status)) + ") " + to_text(call);
    else
        death.how = "exited with status " + std::to_string(WEXITSTATUS(exit.wait_status)) + " " + to_text(call);
    if (exit.exceeded_memory)
        death.how += ": it used more memory than its control group allows (see 'memory_mb')";
    if (!end_reason_.empty())
        death.how = end_reason_ + "; " + death.how;
    for (const std::string &line : tail_)
        death.log_tail += line + "\n";
    channel_watch_.cancel();
    doorbell_watch_.cancel();
    output_watch_.cancel();
    output_pause_.cancel();
    death_watch_.cancel();
    kill_deadline_.cancel();
    const auto died = std::move(callbacks_.died); // moved out, because the callback may destroy this object
    died(death);
}

} // namespace arhost::supervise
