// SPDX-License-Identifier: Apache-2.0
//
// Namespaces: no access to other processes, the network, System V IPC objects, or the names of other control groups.
// The root folder contains only what the policy grants.
#include "sandbox/layers.hpp"

#include <sched.h>
#include <unistd.h>

namespace arhost::sandbox {

Layer enter_namespaces(const Policy &policy) {
    Layer layer{"namespaces", "", ""};
    const auto active = [&](const char *what) { add_to(layer.active, what); };
    const auto missing = [&](const char *what) { add_to(layer.missing, error_text(what)); };
    const auto leave = [&](int flag, const char *what) {
        const bool has_left = ::unshare(flag) == 0;
        has_left ? active(what) : missing(what);
        return has_left;
    };
    bool has_user_namespace = ::geteuid() != 0; // entered by arhost-launcher or below
    // Root needs no user namespace, and in one it would lose access to the files of other users. Otherwise,
    // arhost-launcher has started the worker in a user namespace, in which the worker may create other namespaces.
    if (::unshare(CLONE_NEWNS) != 0) {
        if (const std::string why_not = enter_user_namespace(); !why_not.empty()) {
            layer.missing = "user: " + why_not;
            return layer;
        }
        has_user_namespace = true;
        if (::unshare(CLONE_NEWNS) != 0) {
            missing("mount");
            return layer;
        }
    }
    if (has_user_namespace)
        active("user");
    has_pid_namespace() ? active("pid") : add_to(layer.missing, "pid: the parent process has not created one");
    enter_root(policy, layer, leave(CLONE_NEWCGROUP, "cgroup"));
    if (!policy.allows("network"))
        leave(CLONE_NEWNET, "net");
    leave(CLONE_NEWIPC, "ipc");
    return layer;
}

} // namespace arhost::sandbox
