// SPDX-License-Identifier: Apache-2.0
#include "supervise/process.hpp"

#include <csignal>
#include <cstring>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <utility>

namespace arhost::supervise {
namespace {

using namespace ipc;

const char *to_text(Call call) {
    switch (call) {
    case Call::none:
        return "between calls";
    case Call::load:
        return "while its library was loaded";
    case Call::negotiate:
        return "in negotiate";
    case Call::create:
        return "in create";
    case Call::start:
        return "in start";
    case Call::per_frame:
        return "in its per-frame call";
    case Call::idle:
        return "in idle";
    case Call::stop:
        return "in stop";
    case Call::destroy:
        return "in destroy";
    case Call::devices:
        return "while it listed its devices";
    }
    return "in an unknown call";
}

// False where it is no process (arhost-inprocess).
bool signal_process(const base::UniqueFd &pidfd, int signal) {
    return ::syscall(SYS_pidfd_send_signal, pidfd.get(), signal, nullptr, 0) == 0 || errno != EBADF;
}

} // namespace

Process::Process(Context &context, std::string name, Events events, const Json &first)
    : context_(context), name_(std::move(name)), events_(std::move(events)),
      spawned_(context.launcher.spawn(context.worker_program, context.log)),
      host_memory_(SharedMemory::create("arhost-host-page", sizeof(HostPage))),
      worker_memory_(SharedMemory::create("arhost-worker-page", sizeof(WorkerPage))),
      host_page_(host_memory_.map(Access::read_write)), worker_page_(worker_memory_.map(Access::read_only)),
      commands_(host_page_.as<HostPage>().commands, worker_page_.as<WorkerPage>().commands),
      results_(worker_page_.as<WorkerPage>().results, host_page_.as<HostPage>().results) {
    host_memory_.seal_future_writes(); // the worker can map it for reading only
    Reactor &reactor = context_.reactor;
    channel_watch_ = reactor.watch(spawned_.channel.fd(), [this] { take_messages(16); });
    doorbell_watch_ = reactor.watch(spawned_.doorbell.get(), [this] { on_doorbell(); });
    output_watch_ = reactor.watch(spawned_.output.get(), [this] { take_output(4096); });
    death_watch_ = reactor.watch(spawned_.pidfd.get(), [this] { on_death(); });
    send(first, {host_memory_.fd(), worker_memory_.fd()});
}

Process::~Process() {
    if (death_watch_.active())
        signal_process(spawned_.pidfd, SIGKILL);
}

void Process::send(const Json &body, std::initializer_list<int> fds) {
    if (spawned_.channel.send(body, fds, false))
        return;
    // A worker whose queue is full has stopped listening; a dead one is noticed by its pidfd.
    if (errno == EAGAIN)
        end("does not take messages");
    else if (errno == ETOOMANYREFS)
        end("can't be given its memory: this user's processes have too many descriptors under way in messages");
}

void Process::send_in_turn(const Json &body, std::initializer_list<int> fds) {
    send(body, fds);
    Command command{};
    command.kind = CommandKind::control;
    submit(command);
}

void Process::submit(const Command &command) {
    if (commands_.push(command) != RingResult::done)
        return end("broke the contract: its command ring is inconsistent");
    wake(host_page_.as<HostPage>().wake);
}

void Process::ask_to_cancel() {
    host_page_.as<HostPage>().cancelled.store(1, std::memory_order_relaxed); // a flag alone, nothing behind it
    wake(host_page_.as<HostPage>().wake);
}

void Process::end(const std::string &reason) {
    if (!end_reason_.empty())
        return;
    end_reason_ = reason;
    if (!signal_process(spawned_.pidfd, SIGABRT)) { // a thread ends when it finds its host gone
        ::shutdown(spawned_.channel.fd(), SHUT_RDWR);
        wake(host_page_.as<HostPage>().wake);
    }
    kill_deadline_ =
        context_.reactor.at(Reactor::Clock::now() + std::chrono::milliseconds(100), [this] { kill_now(); });
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

// A few at a time, so that a flood of messages can't keep the host from its frames.
void Process::take_messages(int most) {
    for (int i = 0; i < most; ++i) {
        Message message;
        switch (spawned_.channel.receive(message, 0)) {
        case ReceiveState::none:
            return;
        case ReceiveState::closed:
            channel_watch_.cancel();
            // Its death follows most times; a worker that only closed its end is useless.
            if (!ending())
                kill_deadline_ = context_.reactor.at(Reactor::Clock::now() + std::chrono::seconds(1),
                                                     [this] { end("closed its control channel"); });
            return;
        case ReceiveState::breach:
            return end("broke the contract: it sent a malformed message");
        case ReceiveState::message:
            break;
        }
        try {
            if (message.body["type"] == "log") {
                const auto severity = message.body.at("severity").get<arhost_severity>();
                log(severity, message.body.at("text").get<std::string>().substr(0, 4000));
            } else {
                events_.message(message);
            }
        } catch (const std::exception &error) {
            return end(std::string("can't be served: ") + error.what());
        }
    }
}

// What the plugin says; it must not drown what others say, nor its chatter its own warnings.
void Process::log(arhost_severity severity, const std::string &text) {
    constexpr int max_a_second = 100;
    remember(text);
    if (const auto now = Reactor::Clock::now(); now >= log_second_ends_) {
        tell_of_lines_left_out();
        log_second_ends_ = now + std::chrono::seconds(1);
    }
    Lines &lines = severity >= ARHOST_SEVERITY_WARNING ? warnings_ : chatter_;
    if (lines.said++ < max_a_second)
        context_.log(severity, name_, text);
    else
        ++lines.left_out;
}

void Process::tell_of_lines_left_out() {
    for (const auto &[lines, severity] :
         {std::pair{&chatter_, ARHOST_SEVERITY_DEBUG}, {&warnings_, ARHOST_SEVERITY_WARNING}}) {
        if (lines->left_out > 0)
            context_.log(severity, name_, std::to_string(lines->left_out) + " more lines within a second left out");
        *lines = {};
    }
}

void Process::on_doorbell() {
    const int rings = drain_doorbell(spawned_.doorbell.get());
    if (rings < 0) {
        doorbell_watch_.cancel();
        return;
    }
    rings_ += static_cast<std::uint64_t>(rings);
    take_results();
    if (rings_ > results_taken_ + 8192)
        end("broke the contract: it floods its doorbell");
}

void Process::take_results() {
    for (std::uint32_t i = 0; i < ring_capacity; ++i) {
        Result result;
        switch (results_.pop(result)) {
        case RingResult::wait:
            return;
        case RingResult::breach:
            return end("broke the contract: its result ring is inconsistent");
        case RingResult::done:
            ++results_taken_;
            events_.result(result);
        }
    }
}

void Process::take_output(std::size_t max_bytes) {
    char bytes[4096];
    for (std::size_t taken = 0; taken < max_bytes; taken += sizeof bytes) {
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
            log(ARHOST_SEVERITY_DEBUG, partial_line_);
            partial_line_.clear();
        }
    }
}

void Process::remember(const std::string &line) {
    tail_.push_back(line);
    if (tail_.size() > 20)
        tail_.pop_front();
}

void Process::on_death() {
    // What it managed to finish counts: messages and results first. The writer is dead, and the sockets'
    // and the pipe's buffers bound what is left.
    if (channel_watch_.active())
        take_messages(100'000);
    take_results();
    if (output_watch_.active())
        take_output(1 << 20);
    if (!partial_line_.empty())
        remember(partial_line_);
    tell_of_lines_left_out();
    const Exit exit = context_.launcher.wait_exit(spawned_.pid);
    Death death;
    death.cpu_seconds = exit.cpu_seconds;
    death.by_host = ending();
    death.signal = WIFSIGNALED(exit.wait_status) ? WTERMSIG(exit.wait_status) : 0;
    death.clean = WIFEXITED(exit.wait_status) && WEXITSTATUS(exit.wait_status) == 0;
    // SYNC: relaxed suffices, the writer is dead and its exit has been waited for.
    const auto call = static_cast<Call>(worker_page_.as<WorkerPage>().call.load(std::memory_order_relaxed));
    if (WIFSIGNALED(exit.wait_status))
        death.how = "killed by signal " + std::to_string(WTERMSIG(exit.wait_status)) + " (" +
                    ::strsignal(WTERMSIG(exit.wait_status)) + ") " + to_text(call);
    else
        death.how = "exited with status " + std::to_string(WEXITSTATUS(exit.wait_status)) + " " + to_text(call);
    if (!end_reason_.empty())
        death.how = end_reason_ + "; " + death.how;
    for (const std::string &line : tail_)
        death.log_tail += line + "\n";
    channel_watch_.cancel();
    doorbell_watch_.cancel();
    output_watch_.cancel();
    death_watch_.cancel();
    kill_deadline_.cancel();
    const auto died = std::move(events_.died); // it may destroy this object
    died(death);
}

} // namespace arhost::supervise
