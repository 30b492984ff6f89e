// SPDX-License-Identifier: Apache-2.0
#include "sandbox/layers.hpp"

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <sys/resource.h>
#include <sys/sysinfo.h>
#include <sys/utsname.h>

namespace arhost::sandbox {
namespace {

// Lowers the soft and the hard limit to `maximum` if they are higher.
void lower(Layer &layer, const char *name, __rlimit_resource resource, rlim_t maximum) {
    rlimit limit{};
    ::getrlimit(resource, &limit);
    limit.rlim_max = std::min(limit.rlim_max, maximum);
    limit.rlim_cur = std::min(limit.rlim_cur, limit.rlim_max);
    if (::setrlimit(resource, &limit) == 0)
        add_to(layer.active, name);
    else
        add_to(layer.missing, error_text(name));
}

std::uint64_t three_quarters_of_memory() {
    struct sysinfo info {};
    ::sysinfo(&info);
    return std::uint64_t(info.totalram) * info.mem_unit / 4 * 3;
}

bool kernel_is_at_least(int major, int minor) {
    utsname name{};
    int found_major = 0, found_minor = 0;
    ::uname(&name);
    return std::sscanf(name.release, "%d.%d", &found_major, &found_minor) == 2 &&
           std::pair(found_major, found_minor) >= std::pair(major, minor);
}

} // namespace

std::uint64_t memory_limit(const Policy &policy) {
    if (under_sanitizer)
        return 0;
    return policy.memory_bytes ? policy.memory_bytes : three_quarters_of_memory();
}

Layer raise_oom_score() {
    std::ofstream file("/proc/self/oom_score_adj");
    file << 1000 << std::flush;
    if (!file)
        return {"out of memory", "", error_text("oom_score_adj")};
    return {"out of memory", "killed first", ""};
}

Layer set_limits(const Policy &policy) {
    Layer layer{"limits", "", ""};
    // RLIMIT_DATA counts private writable memory, including thread stacks. RLIMIT_AS also counts addresses that
    // allocators and thread libraries only reserve, so it is higher. It limits page tables, which need up to 1/512 of
    // the addresses.
    constexpr rlim_t reserved_bytes = rlim_t{64} << 30;
    if (has_memory_limit(policy)) {
        lower(layer, "memory", RLIMIT_DATA, memory_limit(policy));
        if (!policy.allows("display")) // a window loads GPU drivers, which reserve large regions
            lower(layer, "addresses", RLIMIT_AS, memory_limit(policy) + reserved_bytes);
    }
    // Prevents writes to /tmp even if other layers are missing.
    if (policy.writable.empty() && !policy.standard_output && !may_share_memory(policy))
        lower(layer, "files", RLIMIT_FSIZE, policy.scratch.empty() ? 0 : scratch_bytes);
    // Half of the usual 1024. All descriptors in unread messages of a user's processes count towards one limit. A
    // plugin must not reach this limit, because the host and the scene loader also need descriptors.
    lower(layer, "descriptors", RLIMIT_NOFILE, policy.makes_shared_memory ? 1024 : 512);
    lower(layer, "core", RLIMIT_CORE, 0);
    lower(layer, "stack", RLIMIT_STACK, 8 << 20);   // RLIMIT_DATA does not count the stack of the main thread
    lower(layer, "timers", RLIMIT_SIGPENDING, 256); // POSIX timers and queued signals are counted per user
    lower(layer, "queues", RLIMIT_MSGQUEUE, 0);
    lower(layer, "priorities", RLIMIT_RTPRIO, 0); // a real-time thread could starve all others
    lower(layer, "nice", RLIMIT_NICE, 0);
    // Since version 5.14, Linux counts threads per user namespace; earlier versions count them per user. Linux does
    // not enforce the limit for root. The limit grows with the number of processors, because thread pools have one
    // thread for each.
    const bool is_own_count = has_pid_namespace() && kernel_is_at_least(5, 14);
    lower(layer, "threads", RLIMIT_NPROC, is_own_count ? 1024 + 4 * ::get_nprocs() : 8192);
    return layer;
}

} // namespace arhost::sandbox
