// SPDX-License-Identifier: Apache-2.0
#include "supervise/launcher.hpp"

#include "ring/fd_passing.hpp"
#include "ring/wake.hpp"

#include <climits>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <fstream>
#include <optional>
#include <poll.h>
#include <set>
#include <sys/prctl.h>
#include <sys/signalfd.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <tuple>

namespace arhost::supervise {
namespace {

using ring::UniqueFd;

// What the two sides send each other: plain structs, since both are this program.
struct Request {
    char program[PATH_MAX]; // with descriptors: control, doorbell, output
};
struct Reply {
    enum Kind : int { spawned, failed, exited } kind;
    int error; // errno of `failed`
    Exit exit; // `spawned`: only pid, and its pidfd comes along
};

template <class Struct> bool send_struct(int socket, const Struct &data, std::initializer_list<int> fds = {}) {
    return ring::send_with_fds(socket, std::as_bytes(std::span(&data, 1)), fds) == sizeof data;
}
template <class Struct> bool receive_struct(int socket, Struct &data, std::vector<UniqueFd> &fds) {
    return ring::receive_with_fds(socket, std::as_writable_bytes(std::span(&data, 1)), fds).size == sizeof data;
}

// In the child: descriptors 3 and 4 as arhost-worker expects them, all others but the standard ones shut.
[[noreturn]] void become(const char *program, const std::vector<UniqueFd> &fds, pid_t launcher) {
    // A group of its own: what it forks ends with it, and the terminal's Ctrl-C, which the host alone
    // interprets, does not reach it.
    ::setpgid(0, 0);
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() != launcher) // it died before the line above
        ::_exit(127);
    sigset_t none;
    ::sigemptyset(&none);
    ::sigprocmask(SIG_SETMASK, &none, nullptr);
    ::signal(SIGINT, SIG_IGN);
    ::signal(SIGTERM, SIG_DFL);
    ::signal(SIGHUP, SIG_IGN);
    ::signal(SIGPIPE, SIG_IGN); // and SIGXFSZ, which the host ignores too: a full disk is an error value
    const rlimit no_core{0, 0};
    ::setrlimit(RLIMIT_CORE, &no_core);
    // First out of the way of 3 and 4, then into place; dup2 clears close-on-exec.
    const int control = ::fcntl(fds[0].get(), F_DUPFD_CLOEXEC, 10);
    const int doorbell = ::fcntl(fds[1].get(), F_DUPFD_CLOEXEC, 10);
    ::dup2(fds[2].get(), STDOUT_FILENO);
    ::dup2(fds[2].get(), STDERR_FILENO);
    ::dup2(control, 3);
    ::dup2(doorbell, 4);
    ::syscall(SYS_close_range, 5u, ~0u, 0u);
    const int null = ::open("/dev/null", O_RDONLY);
    ::dup2(null, STDIN_FILENO);
    ::close(null);
    ::execl(program, program, static_cast<char *>(nullptr));
    const char message[] = "arhost-worker can't be executed; is it installed beside arhost?\n";
    (void)!::write(STDERR_FILENO, message, sizeof message - 1);
    ::_exit(127);
}

void spawn_for(int socket, const Request &request, const std::vector<UniqueFd> &fds, std::set<pid_t> &spawned) {
    const pid_t launcher = ::getpid();
    const pid_t pid = ::fork();
    if (pid == 0)
        become(request.program, fds, launcher);
    Reply reply{};
    if (pid < 0) {
        reply.kind = Reply::failed;
        reply.error = errno;
        send_struct(socket, reply);
        return;
    }
    // No race: the child stays a zombie until this process reaps it.
    const UniqueFd pidfd(static_cast<int>(::syscall(SYS_pidfd_open, pid, 0)));
    reply.exit.pid = pid;
    if (!pidfd) { // a container that does not allow it, or no descriptor left
        reply.kind = Reply::failed;
        reply.error = errno;
        ::kill(pid, SIGKILL);
        send_struct(socket, reply);
        return;
    }
    reply.kind = Reply::spawned;
    spawned.insert(pid);
    send_struct(socket, reply, {pidfd.get()});
}

// Kills every child that is not to be kept, and tells how many there were: a launcher is a subreaper, so what a
// worker leaves behind comes here, and what that has left behind with the next call.
int kill_orphans(const std::set<pid_t> &kept) {
    int count = 0;
    std::ifstream children("/proc/thread-self/children");
    for (pid_t child; children >> child;) {
        siginfo_t info{}; // a number of another pid namespace's /proc is no child of ours
        if (!kept.contains(child) &&
            ::waitid(P_PID, static_cast<id_t>(child), &info, WEXITED | WNOHANG | WNOWAIT) == 0) {
            ::kill(child, SIGKILL);
            ::waitpid(child, nullptr, WNOHANG); // or with a later call
            ++count;
        }
    }
    return count;
}

// The host is gone: so are the workers in a moment, and so must be what they have started.
[[noreturn]] void end_all(const std::set<pid_t> &spawned) {
    for (const pid_t worker : spawned)
        ::kill(-worker, SIGKILL);
    for (int i = 0; i < 500; ++i) { // a process that hangs in the kernel is not waited for
        kill_orphans({});
        pid_t gone;
        while ((gone = ::waitpid(-1, nullptr, WNOHANG)) > 0) {
        }
        if (gone < 0)
            break;
        ::usleep(1000);
    }
    ::_exit(0);
}

void reap(int socket, std::set<pid_t> &spawned) {
    for (;;) {
        Reply reply{};
        rusage usage{};
        reply.kind = Reply::exited;
        reply.exit.pid = ::wait4(-1, &reply.exit.wait_status, WNOHANG, &usage);
        if (reply.exit.pid <= 0)
            return (void)kill_orphans(spawned);
        if (spawned.erase(reply.exit.pid) == 0)
            continue;                     // the orphan of a worker
        ::kill(-reply.exit.pid, SIGKILL); // what it has forked; kill_orphans finds what has left its group
        reply.exit.cpu_seconds = cpu_seconds(usage);
        send_struct(socket, reply);
    }
}

[[noreturn]] void launcher_main(int socket) {
    ::prctl(PR_SET_NAME, "arhost-launcher");
    ::setpgid(0, 0); // who kills the host's whole group leaves this to end the rest
    ::prctl(PR_SET_CHILD_SUBREAPER, 1);
    std::set<pid_t> spawned;
    // No PR_SET_PDEATHSIG: the socket tells when the host is gone, and then there is something left to do.
    ::signal(SIGINT, SIG_IGN);
    ::signal(SIGTERM, SIG_IGN);
    ::signal(SIGHUP, SIG_IGN);
    sigset_t child;
    ::sigemptyset(&child);
    ::sigaddset(&child, SIGCHLD);
    ::sigprocmask(SIG_BLOCK, &child, nullptr);
    const UniqueFd signals(::signalfd(-1, &child, SFD_CLOEXEC | SFD_NONBLOCK));
    for (;;) {
        pollfd ready[2] = {{socket, POLLIN, 0}, {signals.get(), POLLIN, 0}};
        if (::poll(ready, 2, -1) < 0)
            continue;
        if (ready[1].revents) {
            signalfd_siginfo info;
            while (::read(signals.get(), &info, sizeof info) > 0) {
            }
            reap(socket, spawned);
        }
        if (ready[0].revents) {
            Request request;
            std::vector<UniqueFd> fds;
            if (!receive_struct(socket, request, fds) || fds.size() != 3)
                end_all(spawned);
            spawn_for(socket, request, fds, spawned);
        }
    }
}

// The launcher's next word; none: it is gone. One that somebody has stopped is made to go on: the host must not
// stand still.
std::optional<Reply> receive_reply(int socket, pid_t launcher, std::vector<UniqueFd> &fds) {
    pollfd ready{socket, POLLIN, 0};
    for (int count; (count = ::poll(&ready, 1, 50)) <= 0;) {
        if (count < 0 && errno != EINTR)
            ring::throw_errno("poll of the launcher");
        ::kill(launcher, SIGCONT);
    }
    Reply reply;
    if (!receive_struct(socket, reply, fds))
        return std::nullopt;
    return reply;
}

} // namespace

double cpu_seconds(const rusage &usage) {
    const auto seconds = [](const timeval &t) {
        return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
    };
    return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

Launcher::Launcher() {
    ::prctl(PR_SET_CHILD_SUBREAPER, 1);
    for (int i = 0; i < 2; ++i)
        sides_.push_back(fork_one());
}

Launcher::Side Launcher::fork_one() const {
    int ends[2];
    if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0)
        ring::throw_errno("socketpair for the launcher");
    UniqueFd host_end(ends[0]), launcher_end(ends[1]);
    const pid_t pid = ::fork();
    if (pid < 0)
        ring::throw_errno("fork of the launcher");
    if (pid == 0) {
        host_end.reset();
        for (const Side &other : sides_) // whose launcher is to see when the host is gone
            ::close(other.socket.get());
        launcher_main(launcher_end.get());
    }
    return {std::move(host_end), pid};
}

bool Launcher::go_on_with_the_next() {
    if (sides_.size() < 2)
        return false;
    ::kill(sides_.front().pid, SIGKILL); // should only its socket be shut; its workers die with it
    ::waitpid(sides_.front().pid, nullptr, 0);
    sides_.pop_front();
    // Its workers die with it; what they have forked does not, and is this process's now, the next subreaper.
    std::set<pid_t> launchers;
    for (const Side &side : sides_)
        launchers.insert(side.pid);
    for (int i = 0; i < 500 && kill_orphans(launchers) > 0; ++i) // not for ever: one may hang in the kernel
        ::usleep(1000);
    alive_.clear();
    return true;
}

Launcher::~Launcher() {
    for (Side &side : sides_) {
        side.socket.reset();
        while (::waitpid(side.pid, nullptr, WNOHANG) == 0) {
            ::kill(side.pid, SIGCONT); // should somebody have stopped it
            ::usleep(1000);
        }
    }
}

Spawned Launcher::spawn(const std::filesystem::path &program) {
    Request request{};
    if (program.native().size() >= sizeof request.program)
        throw std::runtime_error("the path of arhost-worker is too long");
    std::strcpy(request.program, program.c_str());

    for (;;) {
        Spawned spawned;
        ring::Channel mine, theirs;
        std::tie(mine, theirs) = ring::Channel::make_pair();
        ring::DoorbellPair doorbell = ring::make_doorbell();
        int pipe_ends[2];
        if (::pipe2(pipe_ends, O_CLOEXEC) != 0)
            ring::throw_errno("pipe for a worker's output");
        spawned.output.reset(pipe_ends[0]);
        const UniqueFd output_end(pipe_ends[1]);
        ::fcntl(spawned.output.get(), F_SETFL, O_NONBLOCK);

        std::vector<UniqueFd> fds;
        const Side &side = sides_.front();
        const bool sent =
            send_struct(side.socket.get(), request, {theirs.fd(), doorbell.worker.get(), output_end.get()});
        if (!sent && errno != EPIPE && errno != ECONNRESET) // the machine is short of something, not of a launcher
            ring::throw_errno("no process can be started");
        std::optional<Reply> reply;
        while (sent && (reply = receive_reply(side.socket.get(), side.pid, fds)) && reply->kind == Reply::exited)
            note(reply->exit);
        if (!reply && go_on_with_the_next())
            continue;
        if (!reply)
            throw std::runtime_error("the launcher is gone");
        if (reply->kind == Reply::failed || fds.size() != 1 || !fds[0])
            throw std::runtime_error(std::string("no process can be started: ") + std::strerror(reply->error));
        alive_.insert(reply->exit.pid);
        spawned.pid = reply->exit.pid;
        spawned.pidfd = std::move(fds[0]);
        spawned.channel = std::move(mine);
        spawned.doorbell = std::move(doorbell.host);
        return spawned;
    }
}

void Launcher::note(const Exit &exit) {
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
        if (!alive_.contains(pid)) // it died with its launcher
            return {pid, SIGKILL, 0};
        std::vector<UniqueFd> fds;
        if (const auto reply = receive_reply(sides_.front().socket.get(), sides_.front().pid, fds))
            note(reply->exit);
        else if (!go_on_with_the_next())
            throw std::runtime_error("the launcher is gone");
    }
}

} // namespace arhost::supervise
