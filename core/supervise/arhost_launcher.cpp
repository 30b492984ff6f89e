// SPDX-License-Identifier: Apache-2.0
//
// arhost-launcher: started by the host (supervise/launcher.hpp) with a socket to the host as descriptor 3. Starts
// workers, reports how they exited, and kills the processes that they leave behind.
#include "base/exec.hpp"
#include "base/orphans.hpp"
#include "supervise/launcher_protocol.hpp"

#include <array>
#include <csignal>
#include <cstdio>
#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/signalfd.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>

namespace {

using namespace arhost::supervise;
using arhost::base::kill_orphans;
using arhost::base::UniqueFd;

// Runs in the child after fork. Executes arhost-worker, with the control channel as descriptor 3 and the doorbell as
// descriptor 4.
[[noreturn]] void exec_worker(const char *program, const std::vector<UniqueFd> &fds, pid_t launcher) {
    // A separate process group, so that a kill of the group reaches the processes that the worker forks, and Ctrl-C
    // in the terminal reaches only the host.
    ::setpgid(0, 0);
    ::signal(SIGINT, SIG_IGN);
    ::signal(SIGTERM, SIG_DFL);
    ::signal(SIGHUP, SIG_IGN);
    ::signal(SIGPIPE, SIG_IGN); // writes to a closed pipe return EPIPE instead
    const int null = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
    char *const argv[] = {const_cast<char *>(program), nullptr};
    const int output = fds[2].get();
    arhost::base::exec_child(program, argv, std::array{null, output, output, fds[0].get(), fds[1].get()}, launcher);
    const char message[] = "arhost-worker cannot be executed; is it installed in the same folder as arhost?\n";
    (void)!::write(STDERR_FILENO, message, sizeof message - 1);
    ::_exit(127);
}

void spawn(int socket, const Request &request, const std::vector<UniqueFd> &fds, std::set<pid_t> &spawned) {
    const pid_t launcher = ::getpid();
    const pid_t pid = ::fork();
    if (pid == 0)
        exec_worker(request.program, fds, launcher);
    Reply reply{};
    if (pid < 0) {
        reply.kind = Reply::failed;
        reply.error = errno;
        send_struct(socket, reply);
        return;
    }
    // The pid cannot be reused before this call, because the child remains a zombie until this process reaps it.
    const UniqueFd pidfd(static_cast<int>(::syscall(SYS_pidfd_open, pid, 0)));
    reply.exit.pid = pid;
    if (!pidfd) { // for example, the container forbids pidfd_open, or no descriptor is free
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

// Called after the host has exited. Kills the workers and their children, and exits. Uses _exit, because the leak
// check of a sanitizer would stop this process at a normal exit, which conflicts with the SIGCONT that a waiting host
// sends.
[[noreturn]] void end_all(const std::set<pid_t> &spawned) {
    for (const pid_t worker : spawned)
        ::kill(-worker, SIGKILL);
    for (int i = 0; i < 500; ++i) { // gives up after half a second, because a process may hang in the kernel
        kill_orphans({});
        pid_t reaped;
        while ((reaped = ::waitpid(-1, nullptr, WNOHANG)) > 0) {
        }
        if (reaped < 0)
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
            continue;                     // an orphan of a worker
        ::kill(-reply.exit.pid, SIGKILL); // kill_orphans kills children that have left the group
        reply.exit.cpu_seconds = cpu_seconds(usage);
        send_struct(socket, reply);
    }
}

} // namespace

int main() {
    int type = 0;
    socklen_t size = sizeof type;
    if (::getsockopt(launcher_fd, SOL_SOCKET, SO_TYPE, &type, &size) != 0 || type != SOCK_SEQPACKET) {
        std::fprintf(stderr, "arhost-launcher is started by arhost, not by hand: arhost --config FILE\n");
        return 2;
    }
    ::fcntl(launcher_fd, F_SETFD, FD_CLOEXEC);
    ::syscall(SYS_close_range, launcher_fd + 1u, ~0u, 0u);
    // When the host exits, its end of the socket is closed, which makes this process clean up. The parent-death
    // signal is SIGCONT instead of SIGKILL, because a stopped launcher must continue in order to clean up.
    ::prctl(PR_SET_PDEATHSIG, SIGCONT);
    ::prctl(PR_SET_CHILD_SUBREAPER, 1); // makes the orphans of workers children of this process
    ::signal(SIGINT, SIG_IGN);
    ::signal(SIGTERM, SIG_IGN);
    ::signal(SIGHUP, SIG_IGN);
    ::signal(SIGCHLD, SIG_DFL); // if ignored (inherited), the exit statuses of children would be lost
    sigset_t child;
    ::sigemptyset(&child);
    ::sigaddset(&child, SIGCHLD);
    ::sigprocmask(SIG_BLOCK, &child, nullptr);
    const UniqueFd signals(::signalfd(-1, &child, SFD_CLOEXEC | SFD_NONBLOCK));
    std::set<pid_t> spawned;
    for (;;) {
        pollfd ready[2] = {{launcher_fd, POLLIN, 0}, {signals.get(), POLLIN, 0}};
        if (::poll(ready, 2, -1) < 0)
            continue;
        if (ready[1].revents) {
            signalfd_siginfo info;
            while (::read(signals.get(), &info, sizeof info) > 0) {
            }
            reap(launcher_fd, spawned);
        }
        if (ready[0].revents) {
            Request request;
            std::vector<UniqueFd> fds;
            if (!receive_struct(launcher_fd, request, fds) || fds.size() != 3)
                end_all(spawned);
            spawn(launcher_fd, request, fds, spawned);
        }
    }
}
