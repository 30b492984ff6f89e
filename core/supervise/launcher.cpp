// SPDX-License-Identifier: Apache-2.0
#include "supervise/launcher.hpp"

#include "base/orphans.hpp"
#include "ipc/wake.hpp"
#include "supervise/launcher_protocol.hpp"

#include <csignal>
#include <cstring>
#include <fcntl.h>
#include <optional>
#include <poll.h>
#include <spawn.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <tuple>
#include <unistd.h>

namespace arhost::supervise {
namespace {

using base::UniqueFd;

using Clock = std::chrono::steady_clock;

constexpr int max_attempts = 5;

} // namespace

Launcher::Launcher(std::filesystem::path program, std::chrono::milliseconds timeout)
    : program_(std::move(program)), timeout_(timeout), unrelated_children_(base::children()) {
    if (::access(program_.c_str(), X_OK) != 0)
        throw std::runtime_error(start_error(errno));
    ::prctl(PR_SET_CHILD_SUBREAPER, 1); // makes the orphans of a killed launcher children of this process
}

std::string Launcher::start_error(int error) const {
    return program_.string() + " cannot be started: " + std::strerror(error) +
           "; is it installed in the same folder as arhost?";
}

// Uses posix_spawn instead of fork, because this process may have threads, whose locks would stay locked in the
// child.
void Launcher::start() {
    int ends[2];
    if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0)
        base::throw_errno("socketpair for the launcher");
    UniqueFd host_end(ends[0]);
    const UniqueFd launcher_end(ends[1]);
    posix_spawn_file_actions_t actions;
    ::posix_spawn_file_actions_init(&actions);
    ::posix_spawn_file_actions_adddup2(&actions, launcher_end.get(), launcher_fd);
    posix_spawnattr_t attributes;
    ::posix_spawnattr_init(&attributes);
    // A separate process group, so that the launcher survives a signal to the host's group and can kill the workers.
    ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
    ::posix_spawnattr_setpgroup(&attributes, 0);
    std::string path = program_;
    char *const arguments[] = {path.data(), nullptr};
    const int error = ::posix_spawn(&pid_, path.c_str(), &actions, &attributes, arguments, environ);
    ::posix_spawnattr_destroy(&attributes);
    ::posix_spawn_file_actions_destroy(&actions);
    if (error != 0)
        throw std::runtime_error(start_error(error));
    socket_ = std::move(host_end);
}

// Waits for a reply. Sends SIGCONT first and meanwhile, because a stopped launcher must not block the host.
std::optional<Reply> Launcher::receive_reply(std::vector<UniqueFd> &fds) {
    const auto deadline = Clock::now() + timeout_;
    pollfd ready{socket_.get(), POLLIN, 0};
    // Polls once more after the deadline, because this process itself may have been stopped.
    for (bool is_late = false;; is_late = Clock::now() > deadline) {
        ::kill(pid_, SIGCONT);
        const int count = ::poll(&ready, 1, is_late ? 0 : 50);
        if (count > 0)
            break;
        if (count < 0 && errno != EINTR)
            base::throw_errno("poll of the launcher");
        if (is_late)
            return std::nullopt;
    }
    Reply reply;
    if (!receive_struct(socket_.get(), reply, fds))
        return std::nullopt;
    return reply;
}

void Launcher::discard() {
    ::kill(pid_, SIGKILL); // the launcher may have closed its socket without exiting
    // Waits for the launcher to exit, but gives up after half a second: the launcher may hang in the kernel, or a
    // debugger may not have collected its exit status.
    for (int i = 0; i < 500 && ::waitpid(pid_, nullptr, WNOHANG) == 0; ++i)
        ::usleep(1000);
    std::vector<UniqueFd> fds;
    // Receives the launcher's last reports. Does not wait for the end of file, because the launcher's end of the
    // socket may also be open in processes that are killed only below.
    for (Reply reply; socket_ && receive_struct(socket_.get(), reply, fds, MSG_DONTWAIT);)
        if (reply.kind == Reply::exited)
            record(reply.exit);
    socket_.reset();
    is_lost_ = true;
    alive_.clear();
    has_orphans_ = !base::end_orphans(unrelated_children_); // kills the processes that its workers have forked
}

Launcher::~Launcher() {
    if (!socket_)
        return;
    socket_.reset();
    const auto deadline = Clock::now() + timeout_;
    while (::waitpid(pid_, nullptr, WNOHANG) == 0) {
        if (Clock::now() > deadline) {
            discard();
            return;
        }
        ::kill(pid_, SIGCONT); // it may be stopped
        ::usleep(1000);
    }
}

Spawned Launcher::spawn(const std::filesystem::path &program, Isolation isolation, const LogFunction &log) {
    Request request{};
    request.isolation = isolation;
    if (program.native().size() >= sizeof request.program)
        throw std::runtime_error("the path of arhost-worker is too long");
    std::strcpy(request.program, program.c_str());

    if (has_orphans_) {
        std::set<pid_t> kept = unrelated_children_;
        kept.insert(pid_);
        has_orphans_ = base::kill_orphans(kept) > 0;
    }
    for (int attempts = 0; attempts < max_attempts; ++attempts) {
        if (is_lost_)
            log(ARHOST_SEVERITY_WARNING, "arhost",
                "the launcher has died, and all workers with it; starting a new one");
        if (!socket_)
            start();
        is_lost_ = false;
        Spawned spawned;
        ipc::Channel mine, theirs;
        std::tie(mine, theirs) = ipc::Channel::make_pair();
        ipc::DoorbellPair doorbell = ipc::make_doorbell();
        int pipe_ends[2];
        if (::pipe2(pipe_ends, O_CLOEXEC) != 0)
            base::throw_errno("pipe for a worker's output");
        spawned.output.reset(pipe_ends[0]);
        const UniqueFd output_end(pipe_ends[1]);
        ::fcntl(spawned.output.get(), F_SETFL, O_NONBLOCK);

        std::vector<UniqueFd> fds;
        const bool sent = send_struct(socket_.get(), request, {theirs.fd(), doorbell.worker.get(), output_end.get()});
        if (!sent && errno != EPIPE && errno != ECONNRESET) // the cause is a resource limit, not a dead launcher
            base::throw_errno("no process can be started");
        std::optional<Reply> reply;
        while (sent && (reply = receive_reply(fds)) && reply->kind == Reply::exited)
            record(reply->exit);
        if (!reply) {
            discard();
            continue;
        }
        const bool has_failed = reply->kind == Reply::failed;
        if (has_failed || fds.size() != 1 || !fds[0]) // no fds[0]: too many open files
            throw std::runtime_error(std::string("no process can be started: ") +
                                     std::strerror(has_failed ? reply->error : EMFILE));
        alive_.insert(reply->exit.pid);
        spawned.pid = reply->exit.pid;
        spawned.pidfd = std::move(fds[0]);
        spawned.channel = std::move(mine);
        spawned.doorbell = std::move(doorbell.host);
        return spawned;
    }
    throw std::runtime_error("no process can be started: " + program_.string() + " was started " +
                             std::to_string(max_attempts) + " times and exited or did not respond each time");
}

void Launcher::record(const Exit &exit) {
    alive_.erase(exit.pid);
    exits_.push_back(exit);
}

Exit Launcher::wait_exit(pid_t pid) {
    for (;;) {
        for (auto it = exits_.begin(); it != exits_.end(); ++it)
            if (it->pid == pid) {
                const Exit found = *it;
                exits_.erase(it);
                return found;
            }
        if (!alive_.contains(pid)) // the process was killed together with its launcher
            return {pid, SIGKILL, 0};
        std::vector<UniqueFd> fds;
        if (const auto reply = receive_reply(fds))
            record(reply->exit);
        else
            discard();
    }
}

} // namespace arhost::supervise
