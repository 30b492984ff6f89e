// SPDX-License-Identifier: Apache-2.0
#include "sandbox/layers.hpp"

#include <fstream>
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

namespace arhost::sandbox {
namespace {

// Returns 0, the errno of unshare, or 128 + the errno of the mapping of the user.
int enter() {
    const uid_t user = ::geteuid();
    const gid_t group = ::getegid();
    if (::unshare(CLONE_NEWUSER) != 0)
        return errno;
    const auto write = [](const char *file, const std::string &text) {
        return static_cast<bool>(std::ofstream(file) << text << std::flush);
    };
    const bool is_mapped = write("/proc/self/setgroups", "deny") && // required before a group can be mapped
                           write("/proc/self/uid_map", std::to_string(user) + " " + std::to_string(user) + " 1") &&
                           write("/proc/self/gid_map", std::to_string(group) + " " + std::to_string(group) + " 1");
    return is_mapped ? 0 : 128 + errno;
}

bool setting_is(const char *file, int value) {
    int found = value - 1;
    return std::ifstream(file) >> found && found == value;
}

std::string reason(int result) {
    if (result >= 128)
        return std::string("the user cannot be mapped (") + std::strerror(result - 128) + ")";
    if (setting_is("/proc/sys/user/max_user_namespaces", 0) || result == ENOSPC)
        return "the limit of user namespaces is reached; raise the sysctl user.max_user_namespaces";
    if (setting_is("/proc/sys/kernel/unprivileged_userns_clone", 0))
        return "disabled; set the sysctl kernel.unprivileged_userns_clone to 1";
    if (result == EPERM)
        return "forbidden, for example by the container that arhost runs in";
    return std::string("not in this kernel (") + std::strerror(result) + ")";
}

} // namespace

std::string enter_user_namespace() {
    // Tries it in a child process first: some systems allow the namespace but not the mapping, and a process cannot
    // leave the namespace again.
    const pid_t child = ::fork();
    if (child == 0)
        ::_exit(enter());
    int status = 0;
    if (child < 0 || ::waitpid(child, &status, 0) != child || !WIFEXITED(status))
        return error_text("no process could try it");
    const int result = WEXITSTATUS(status) != 0 ? WEXITSTATUS(status) : enter();
    return result == 0 ? "" : reason(result);
}

} // namespace arhost::sandbox
