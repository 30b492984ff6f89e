// SPDX-License-Identifier: Apache-2.0
#include "base/write_all.hpp"

#include <algorithm>
#include <cerrno>
#include <climits>
#include <csignal>
#include <cstdio>
#include <fcntl.h>
#include <poll.h>
#include <sys/signalfd.h>
#include <unistd.h>

namespace arhost::base {

void write_all(int fd, std::string_view bytes, int signals) {
    // A write to a terminal may block although poll reports that it is ready. Therefore reopens the terminal with
    // O_NONBLOCK; setting the flag on `fd` would change it for all processes that share the descriptor.
    const UniqueFd terminal(::isatty(fd) ? ::open(("/proc/self/fd/" + std::to_string(fd)).c_str(),
                                                  O_WRONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC)
                                         : -1);
    if (terminal)
        fd = terminal.get();
    while (!bytes.empty()) {
        pollfd fds[2] = {{fd, POLLOUT, 0}, {signals, POLLIN, 0}};
        if (::poll(fds, 2, -1) < 0 && errno != EINTR)
            throw_errno("poll");
        if (const int signal = take_signal(signals))
            throw Interrupted(signal, "interrupted while writing");
        if (fds[0].revents == 0)
            continue;
        // If poll reports that a pipe is ready, a write of up to PIPE_BUF bytes does not block.
        const ssize_t count = ::write(fd, bytes.data(), std::min<std::size_t>(bytes.size(), PIPE_BUF));
        if (count < 0 && errno != EINTR && errno != EAGAIN)
            throw_errno("write");
        bytes.remove_prefix(static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
    }
}

bool flush_stdout() {
    if (std::fflush(stdout) == 0 && !std::ferror(stdout))
        return true;
    pollfd out{STDOUT_FILENO, POLLOUT, 0};
    if (::poll(&out, 1, 0) > 0 && out.revents & POLLERR)
        end_by_signal(SIGPIPE);
    std::fputs("error: cannot write to standard output\n", stderr);
    return false;
}

UniqueFd watch_signals() {
    sigset_t watched;
    ::sigemptyset(&watched);
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
        struct sigaction now {};
        if (::sigaction(signal, nullptr, &now) == 0 && now.sa_handler != SIG_IGN)
            ::sigaddset(&watched, signal);
    }
    ::sigprocmask(SIG_BLOCK, &watched, nullptr);
    return checked(::signalfd(-1, &watched, SFD_CLOEXEC), "signalfd");
}

int take_signal(int signals) {
    pollfd ready{signals, POLLIN, 0};
    signalfd_siginfo taken{};
    return ::poll(&ready, 1, 0) > 0 && ::read(signals, &taken, sizeof taken) == sizeof taken
               ? static_cast<int>(taken.ssi_signo)
               : 0;
}

void end_by_signal(int signal) {
    std::signal(signal, SIG_DFL);
    std::raise(signal);
    sigset_t pending;
    ::sigemptyset(&pending);
    ::sigaddset(&pending, signal);
    ::sigprocmask(SIG_UNBLOCK, &pending, nullptr);
    std::abort(); // the signal has ended the process
}

} // namespace arhost::base
