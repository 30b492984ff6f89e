// SPDX-License-Identifier: Apache-2.0
#include "sandbox/layers.hpp"

#include "base/unique_fd.hpp"

#include <fcntl.h>
#include <fstream>
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

namespace arhost::sandbox {
namespace {

using Step = UserNamespaceFailure::Step;

UserNamespaceFailure try_here() {
    const uid_t user = ::geteuid();
    const gid_t group = ::getegid();
    if (::unshare(CLONE_NEWUSER) != 0)
        return {Step::creation, errno};
    const auto write = [](const char *file, const std::string &text) {
        return static_cast<bool>(std::ofstream(file) << text << std::flush);
    };
    const bool is_mapped = write("/proc/self/setgroups", "deny") && // required before a group can be mapped
                           write("/proc/self/uid_map", std::to_string(user) + " " + std::to_string(user) + " 1") &&
                           write("/proc/self/gid_map", std::to_string(group) + " " + std::to_string(group) + " 1");
    return is_mapped ? UserNamespaceFailure() : UserNamespaceFailure{Step::mapping, errno};
}

UserNamespaceFailure try_in_child() {
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0)
        return {Step::trial, errno};
    const base::UniqueFd read_end(ends[0]);
    base::UniqueFd write_end(ends[1]);
    const pid_t child = ::fork();
    if (child < 0)
        return {Step::trial, errno};
    UserNamespaceFailure failure{Step::trial, 0};
    if (child == 0) {
        failure = try_here();
        (void)!::write(write_end.get(), &failure, sizeof failure);
        ::_exit(0);
    }
    write_end.reset();
    (void)!::read(read_end.get(), &failure, sizeof failure); // reads nothing if the child was killed
    ::waitpid(child, nullptr, 0);
    return failure;
}

} // namespace

std::string to_text(const UserNamespaceFailure &failure, const std::filesystem::path &settings) {
    const auto setting_is = [&](const char *name, int value) {
        int found = value - 1;
        return std::ifstream(settings / name) >> found && found == value;
    };
    const std::string error = failure.error ? std::strerror(failure.error) : "it was killed";
    const bool is_forbidden = failure.error == EPERM || failure.error == EACCES;
    if (failure.step == Step::none)
        return "";
    if (failure.step == Step::trial)
        return "no process could try it (" + error + ")";
    if (is_forbidden && setting_is("kernel/apparmor_restrict_unprivileged_userns", 1))
        return "forbidden by AppArmor; set the sysctl kernel.apparmor_restrict_unprivileged_userns to 0, or add an "
               "AppArmor profile for arhost-launcher and arhost-worker that allows 'userns'";
    if (failure.step == Step::mapping)
        return "the user cannot be mapped (" + error + ")";
    if (setting_is("user/max_user_namespaces", 0) || failure.error == ENOSPC)
        return "the limit of user namespaces is reached; raise the sysctl user.max_user_namespaces";
    if (setting_is("kernel/unprivileged_userns_clone", 0))
        return "disabled; set the sysctl kernel.unprivileged_userns_clone to 1";
    if (is_forbidden)
        return "forbidden, for example by the container that arhost runs in";
    return "not in this kernel (" + error + ")";
}

std::string enter_user_namespace() {
    // Tries the namespace in a child process first. Some systems allow the namespace but not the mapping, and a
    // process cannot leave a user namespace again.
    UserNamespaceFailure failure = try_in_child();
    if (failure.step == Step::none)
        failure = try_here();
    return to_text(failure, "/proc/sys");
}

} // namespace arhost::sandbox
