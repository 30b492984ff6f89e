// SPDX-License-Identifier: Apache-2.0
//
// Namespaces: no other processes, no network, no System V IPC objects, and a root folder with only what the policy
// grants.
#include "sandbox/layers.hpp"

#include <sched.h>
#include <unistd.h>

namespace arhost::sandbox {

Layer enter_namespaces(const Policy &policy) {
    Layer layer{"namespaces", "", ""};
    const auto active = [&](const char *what) { add_to(layer.active, what); };
    const auto missing = [&](const char *what) { add_to(layer.missing, error_text(what)); };
    // Root needs no user namespace, and in one it would lose access to the files of other users. arhost-launcher has
    // started a worker in a user namespace, with the capability to create other namespaces in it.
    if (::unshare(CLONE_NEWNS) != 0) {
        if (const std::string why_not = enter_user_namespace(); !why_not.empty()) {
            layer.missing = "user: " + why_not;
            return layer;
        }
        if (::unshare(CLONE_NEWNS) != 0) {
            missing("mount");
            return layer;
        }
    }
    if (::geteuid() != 0)
        active("user");
    has_pid_namespace() ? active("pid") : add_to(layer.missing, "pid");
    enter_root(policy) ? active("mount") : missing("mount");
    if (!policy.allows("network"))
        ::unshare(CLONE_NEWNET) == 0 ? active("net") : missing("net");
    ::unshare(CLONE_NEWIPC) == 0 ? active("ipc") : missing("ipc");
    return layer;
}

} // namespace arhost::sandbox
