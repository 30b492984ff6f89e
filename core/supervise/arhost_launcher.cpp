// SPDX-License-Identifier: Apache-2.0
//
// arhost-launcher: started by the host (supervise/launcher.hpp) with a socket to the host as descriptor 3. Starts
// workers, reports how they exited, kills the processes that they leave behind, and returns their USB devices to the
// kernel's drivers.
//
// Each isolated worker is PID 2 of its own PID namespace, so that it can receive all signals. (The kernel discards
// signals to PID 1 from its own namespace.)
#include "base/exec.hpp"
#include "base/orphans.hpp"
#include "base/usb_device.hpp"
#include "sandbox/sandbox.hpp"
#include "supervise/control_group.hpp"
#include "supervise/launcher_protocol.hpp"

#include <array>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <fcntl.h>
#include <linux/capability.h>
#include <map>
#include <optional>
#include <poll.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/signalfd.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>

namespace {

using namespace arhost::supervise;
using arhost::base::kill_orphans;
using arhost::base::UniqueFd;

// The first process of a worker's PID namespace, PID 1. The destructor ends it, and the kernel then kills all other
// processes in the namespace.
struct Init {
    pid_t pid = -1;
    UniqueFd lifeline; // PID 1 exits when this end of the pipe is closed, also if the launcher is killed
};

struct Worker {
    std::optional<Init> init; // nullopt: the worker has no PID namespace
    ControlGroup group;
    arhost::base::UsbIdentity usb_device; // empty: none
};
using Workers = std::map<pid_t, Worker>; // those that have not exited
using Helpers = std::set<pid_t>;         // processes that return USB devices

[[noreturn]] void run_init(int pipe) {
    ::prctl(PR_SET_NAME, "arhost-init");
    ::prctl(PR_SET_PDEATHSIG, SIGKILL); // a stopped process does not see the end of the pipe
    ::signal(SIGCHLD, SIG_IGN);         // the kernel reaps orphans
    ::dup2(pipe, 0);
    if (::syscall(SYS_close_range, 1u, ~0u, 0u) != 0)
        ::_exit(1); // the namespace would survive if this process kept another end of the pipe open
    char byte;
    while (::read(0, &byte, 1) < 0 && errno == EINTR) {
    }
    ::_exit(0);
}

// Makes the next program that this process executes keep CAP_SYS_ADMIN in its user namespace, which it needs to enter
// its sandbox.
void keep_capability() {
    if (::geteuid() == 0)
        return;
    __user_cap_header_struct header{_LINUX_CAPABILITY_VERSION_3, 0};
    __user_cap_data_struct data[2] = {};
    ::syscall(SYS_capget, &header, data);
    data[0].inheritable |= 1u << CAP_SYS_ADMIN;
    ::syscall(SYS_capset, &header, data);
    ::prctl(PR_CAP_AMBIENT, PR_CAP_AMBIENT_RAISE, CAP_SYS_ADMIN, 0, 0);
}

// Runs in the child after fork. Executes arhost-worker, with the control channel as descriptor 3 and the doorbell
// (ipc::DoorbellPair) as descriptor 4. Fails if getppid(2) does not return `parent`, because the parent has then
// ended.
[[noreturn]] void exec_worker(const Request &request, const std::vector<UniqueFd> &fds, pid_t parent) {
    // A separate session, so that the worker has no controlling terminal, a kill of the process group reaches the
    // processes that the worker forks, and Ctrl-C in the terminal reaches only the host.
    ::setsid();
    ::signal(SIGINT, SIG_IGN);
    ::signal(SIGTERM, SIG_DFL);
    ::signal(SIGHUP, SIG_IGN);
    ::signal(SIGPIPE, SIG_IGN); // writes to a closed pipe return EPIPE instead
    const int null = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
    char *const argv[] = {const_cast<char *>(request.program), nullptr};
    const int output = fds[2].get(), standard_output = request.isolation.standard_output ? STDOUT_FILENO : output;
    arhost::base::exec_child(request.program, argv,
                             std::array{null, standard_output, output, fds[0].get(), fds[1].get()}, parent);
    ::dprintf(STDERR_FILENO, "arhost-worker cannot be executed: %s; is it installed in the same folder as arhost?\n",
              std::strerror(errno));
    ::_exit(127);
}

// Like fork(2), but the parent of the child is the parent of this process.
pid_t fork_sibling() {
    return static_cast<pid_t>(::syscall(SYS_clone, CLONE_PARENT | SIGCHLD, 0, 0, 0, 0));
}

// Starts a worker as PID 2 of a new PID namespace, as a child of this process. A helper process creates the
// namespace: without privileges, this requires a user namespace, which a process cannot leave again. Returns -1 if
// the namespaces are unavailable.
pid_t fork_isolated(const Request &request, const std::vector<UniqueFd> &fds, Worker &worker) {
    int life[2], result[2];
    if (::pipe2(life, O_CLOEXEC) != 0)
        return -1;
    const UniqueFd init_end(life[0]);
    UniqueFd lifeline(life[1]);
    if (::pipe2(result, O_CLOEXEC) != 0)
        return -1;
    const UniqueFd result_end(result[0]);
    UniqueFd helper_end(result[1]);
    const pid_t helper = ::fork();
    if (helper == 0) {
        worker.group.join();
        pid_t pids[2] = {-1, -1}; // of PID 1 and the worker
        if (::unshare(CLONE_NEWPID) == 0 ||
            (arhost::sandbox::enter_user_namespace().empty() && ::unshare(CLONE_NEWPID) == 0)) {
            if ((pids[0] = fork_sibling()) == 0)
                run_init(init_end.get());
            if (pids[0] > 0 && (pids[1] = fork_sibling()) == 0) {
                keep_capability();
                exec_worker(request, fds, 0); // 0: the parent is outside of the namespace
            }
        }
        (void)!::write(helper_end.get(), pids, sizeof pids);
        ::_exit(0);
    }
    helper_end.reset();
    pid_t pids[2] = {-1, -1};
    (void)!::read(result_end.get(), pids, sizeof pids);
    if (helper > 0)
        ::waitpid(helper, nullptr, 0);
    if (pids[1] > 0)
        worker.init = Init{pids[0], std::move(lifeline)};
    return pids[1];
}

void spawn(int socket, const Request &request, const std::vector<UniqueFd> &fds, Workers &workers,
           ControlGroups &groups) {
    const pid_t launcher = ::getpid();
    Worker worker;
    worker.usb_device = request.isolation.usb_device.data();
    if (request.isolation.enabled)
        worker.group = groups.create(request.isolation.memory_bytes);
    pid_t pid = request.isolation.enabled ? fork_isolated(request, fds, worker) : -1;
    if (pid < 0)
        pid = ::fork();
    if (pid == 0) {
        worker.group.join();
        exec_worker(request, fds, launcher);
    }
    Reply reply{};
    if (pid < 0) {
        reply.kind = Reply::failed;
        reply.error = errno;
        groups.end(worker.group);
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
        groups.end(worker.group);
        send_struct(socket, reply);
        return;
    }
    reply.kind = Reply::spawned;
    workers.emplace(pid, std::move(worker));
    send_struct(socket, reply, {pidfd.get()});
}

// Returns a USB device to the kernel's drivers, in case its worker was killed before it could do so. Starts a process
// for this, because drivers may take seconds.
void return_usb_device(const arhost::base::UsbIdentity &identity, Helpers &helpers) {
    const auto device = identity.empty() ? std::nullopt : arhost::base::find_usb_device(identity);
    if (!device || device->driver_less.empty())
        return;
    const pid_t pid = ::fork();
    if (pid == 0) {
        ::syscall(SYS_close_range, static_cast<unsigned>(launcher_fd), ~0u, 0u);
        arhost::base::bind_usb_drivers(*device);
        ::_exit(0);
    }
    if (pid > 0)
        helpers.insert(pid);
}

// Called after the host has exited. Kills the workers and their children, and exits. Calls _exit, because at a normal
// exit the leak check of a sanitizer would stop this process, which conflicts with the SIGCONT that a waiting host
// sends.
[[noreturn]] void end_all(const Workers &workers, ControlGroups &groups) {
    for (const auto &[pid, worker] : workers) {
        ::kill(-pid, SIGKILL);
        groups.end(worker.group);
    }
    for (int i = 0; i < 500; ++i) { // gives up after half a second, because a worker may hang in the kernel
        kill_orphans({});
        pid_t reaped;
        while ((reaped = ::waitpid(-1, nullptr, WNOHANG)) > 0) {
        }
        if (reaped < 0)
            break;
        ::usleep(1000);
    }
    for (const auto &[pid, worker] : workers)
        if (const auto device =
                worker.usb_device.empty() ? std::nullopt : arhost::base::find_usb_device(worker.usb_device))
            arhost::base::bind_usb_drivers(*device);
    groups.remove_ended();
    groups.restore();
    ::_exit(0);
}

// Kills children that are neither workers nor the first process of a worker's namespace nor helpers.
void kill_other_children(const Workers &workers, const Helpers &helpers) {
    std::set<pid_t> kept = helpers;
    for (const auto &[pid, worker] : workers) {
        kept.insert(pid);
        if (worker.init)
            kept.insert(worker.init->pid);
    }
    kill_orphans(kept);
}

void reap(int socket, Workers &workers, Helpers &helpers, ControlGroups &groups) {
    groups.remove_ended();
    for (;;) {
        siginfo_t info{};
        if (::waitid(P_ALL, 0, &info, WEXITED | WNOHANG | WNOWAIT) != 0 || info.si_pid == 0)
            return kill_other_children(workers, helpers);
        const auto ended = workers.extract(info.si_pid);
        // The id of a worker's process group cannot be reused before the worker is reaped. kill_other_children kills
        // children that have left the group.
        if (ended)
            ::kill(-info.si_pid, SIGKILL);
        Reply reply{};
        rusage usage{};
        reply.kind = Reply::exited;
        reply.exit.pid = ::wait4(info.si_pid, &reply.exit.wait_status, 0, &usage);
        helpers.erase(info.si_pid);
        if (!ended)
            continue; // a helper, an orphan of a worker, or the first process of a namespace
        return_usb_device(ended.mapped().usb_device, helpers);
        reply.exit.exceeded_memory = ended.mapped().group.exceeded_memory();
        groups.end(ended.mapped().group);
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
    const UniqueFd signals = arhost::base::checked(::signalfd(-1, &child, SFD_CLOEXEC | SFD_NONBLOCK), "signalfd");
    Workers workers;
    Helpers helpers;
    ControlGroups groups;
    for (;;) {
        pollfd ready[2] = {{launcher_fd, POLLIN, 0}, {signals.get(), POLLIN, 0}};
        if (::poll(ready, 2, -1) < 0)
            continue;
        if (ready[1].revents) {
            signalfd_siginfo info;
            while (::read(signals.get(), &info, sizeof info) > 0) {
            }
            reap(launcher_fd, workers, helpers, groups);
        }
        if (ready[0].revents) {
            Request request;
            std::vector<UniqueFd> fds;
            if (!receive_struct(launcher_fd, request, fds) || fds.size() != 3)
                end_all(workers, groups);
            spawn(launcher_fd, request, fds, workers, groups);
        }
    }
}
