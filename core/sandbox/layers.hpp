// SPDX-License-Identifier: Apache-2.0
//
// The layers of the sandbox, in the order in which sandbox::enter applies them. The order matters, because a layer
// may remove rights that are needed to apply another layer; that layer must come first.
#pragma once

#include "sandbox/sandbox.hpp"

#include <cerrno>
#include <cstring>
#include <unistd.h>

// The sandbox is less strict in builds with sanitizers, because these reserve terabytes of address space and start
// processes.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define ARHOST_UNDER_SANITIZER 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define ARHOST_UNDER_SANITIZER 1
#endif
#endif

namespace arhost::sandbox {

#ifdef ARHOST_UNDER_SANITIZER
constexpr bool under_sanitizer = true;
#else
constexpr bool under_sanitizer = false;
#endif

inline std::string error_text(const std::string &what) {
    return what + ": " + std::strerror(errno);
}

inline void add_to(std::string &list, const std::string &what) {
    list += (list.empty() ? "" : ", ") + what;
}

// Sanitizers start processes for leak checks and stack traces.
inline bool may_start_processes(const Policy &policy) {
    return under_sanitizer || policy.allows("processes");
}

// Whether the process may use memory that RLIMIT_DATA does not count: memfds and shared anonymous mappings.
inline bool may_share_memory(const Policy &policy) {
    return policy.makes_shared_memory || policy.allows("gpu") || policy.allows("display") ||
           policy.allows("processes");
}
inline bool has_memory_limit(const Policy &policy) {
    return !under_sanitizer && !policy.allows("gpu"); // GPU drivers map large regions
}

// Whether arhost-launcher has started this process in a PID namespace. The parent of this process is outside of it.
inline bool has_pid_namespace() {
    return ::getppid() == 0;
}

// Why a user namespace could not be entered.
struct UserNamespaceFailure {
    enum class Step { none, trial, creation, mapping } step = Step::none; // trial: in a child process
    int error = 0;                                                        // errno; 0: the child was killed
};
// Returns the reason and what an administrator can change; "" without a failure. `settings`: /proc/sys.
std::string to_text(const UserNamespaceFailure &failure, const std::filesystem::path &settings);

void drop_environment(const Policy &policy); // cannot fail
Layer raise_oom_score();                     // the OOM killer kills workers first; must run while /proc is writable
Layer report_control_group();                // arhost-launcher has created it
Layer enter_namespaces(const Policy &policy);
void enter_root(const Policy &policy, Layer &layer, bool has_control_group_namespace); // part of enter_namespaces
// The scratch folder (Policy::scratch).
constexpr std::uint64_t scratch_bytes = 64 << 20; // also the maximum size of a file in it
bool mount_scratch(const std::filesystem::path &folder, bool may_execute);
void point_to_scratch(const Policy &policy); // by environment variables; must run after all other layers
Layer set_limits(const Policy &policy);
Layer drop_capabilities();
Layer enter_landlock(const Policy &policy); // this layer and the next one require no_new_privs
Layer filter_system_calls(const Policy &policy);

// The paths to which a policy grants access, with wildcards expanded. Patterns that match nothing are omitted.
struct Paths {
    std::vector<std::filesystem::path> readable, devices; // devices may be read, written and controlled with ioctl
    std::vector<std::filesystem::path> sockets;           // sockets of the X or Wayland server
};
Paths paths_of(const Policy &policy);

} // namespace arhost::sandbox
