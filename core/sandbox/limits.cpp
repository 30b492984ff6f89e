// SPDX-License-Identifier: Apache-2.0
#include "sandbox/layers.hpp"

#include <algorithm>
#include <fstream>
#include <sys/resource.h>
#include <sys/sysinfo.h>

namespace arhost::sandbox {
namespace {

// Lowers soft and hard limit. What is lower already stays.
std::string lower(__rlimit_resource resource, rlim_t most, const char *name) {
    rlimit limit{};
    if (::getrlimit(resource, &limit) != 0)
        return error_text(name);
    limit.rlim_max = std::min(limit.rlim_max, most);
    limit.rlim_cur = std::min(limit.rlim_cur, limit.rlim_max);
    return ::setrlimit(resource, &limit) == 0 ? "" : error_text(name);
}

std::uint64_t three_quarters_of_memory() {
    struct sysinfo info {};
    ::sysinfo(&info);
    return std::uint64_t(info.totalram) * info.mem_unit / 4 * 3;
}

} // namespace

Layer set_limits(const Policy &policy) {
    Layer layer{"limits", "", ""};
    const auto add = [&](__rlimit_resource resource, rlim_t most, const char *name) {
        const std::string error = lower(resource, most, name);
        (error.empty() ? layer.reached : layer.lacks) +=
            (error.empty() ? layer.reached : layer.lacks).empty() ? "" : ", ";
        (error.empty() ? layer.reached : layer.lacks) += error.empty() ? name : error;
    };
    // Where the machine runs out of memory all the same, the kernel ends a worker and never the host.
    std::ofstream("/proc/self/oom_score_adj") << 1000;
    // Private writable memory, stacks of threads included; not what is reserved only (RLIMIT_AS would count it).
    if (has_memory_limit(policy))
        add(RLIMIT_DATA, policy.memory_bytes ? policy.memory_bytes : three_quarters_of_memory(), "memory");
    if (policy.writable.empty() && !may_share_memory(policy))
        add(RLIMIT_FSIZE, 0, "files"); // a full file system in /tmp, say, where no other layer is
    // Half of the usual 1024: descriptors that are under way in messages count for all processes of a user
    // together, and the host must be able to send some whatever a worker has under way.
    add(RLIMIT_NOFILE, 512, "descriptors");
    add(RLIMIT_CORE, 0, "core");
    add(RLIMIT_MSGQUEUE, 0, "queues");
    add(RLIMIT_NPROC, 4096, "threads"); // no limit for root, whose threads the memory bounds
    return layer;
}

} // namespace arhost::sandbox
