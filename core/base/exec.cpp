// SPDX-License-Identifier: Apache-2.0
#include "base/exec.hpp"

#include <csignal>
#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace arhost::base {

void exec_child(const char *program, char *const argv[], std::span<const int> fds, pid_t parent) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() != parent) // `parent` exited before the call of prctl
        return;
    sigset_t none;
    ::sigemptyset(&none);
    ::sigprocmask(SIG_SETMASK, &none, nullptr);
    const rlimit no_core{0, 0};
    ::setrlimit(RLIMIT_CORE, &no_core);
    // Duplicates all descriptors to numbers from 10 on and from there to 0, 1, 2, …, so dup2 does not overwrite a
    // descriptor that is still needed. dup2 also clears close-on-exec.
    constexpr int first_free = 10, max_fds = 8;
    int high[max_fds] = {};
    if (fds.size() > max_fds)
        return;
    for (std::size_t i = 0; i < fds.size(); ++i)
        if ((high[i] = ::fcntl(fds[i], F_DUPFD_CLOEXEC, first_free)) < 0)
            return;
    for (std::size_t i = 0; i < fds.size(); ++i)
        if (::dup2(high[i], static_cast<int>(i)) < 0)
            return;
    if (::syscall(SYS_close_range, static_cast<unsigned>(fds.size()), ~0u, 0u) == 0)
        ::execv(program, argv);
}

} // namespace arhost::base
