// SPDX-License-Identifier: Apache-2.0
#include "sandbox/layers.hpp"

#include <algorithm>
#include <fstream>
#include <sys/resource.h>
#include <sys/sysinfo.h>

namespace arhost::sandbox {
namespace {

// Lowers soft and hard limit; what is lower already stays.
void lower(Layer &layer, const char *name, __rlimit_resource resource, rlim_t most) {
    rlimit limit{};
    ::getrlimit(resource, &limit);
    limit.rlim_max = std::min(limit.rlim_max, most);
    limit.rlim_cur = std::min(limit.rlim_cur, limit.rlim_max);
    if (::setrlimit(resource, &limit) == 0)
        add_to(layer.reached, name);
    else
        add_to(layer.lacks, error_text(name));
}

std::uint64_t three_quarters_of_memory() {
    struct sysinfo info {};
    ::sysinfo(&info);
    return std::uint64_t(info.totalram) * info.mem_unit / 4 * 3;
}

} // namespace

Layer go_first_out_of_memory() {
    std::ofstream file("/proc/self/oom_score_adj");
    file << 1000 << std::flush;
    if (!file)
        return {"out of memory", "", error_text("oom_score_adj")};
    return {"out of memory", "first to go", ""};
}

Layer set_limits(const Policy &policy) {
    Layer layer{"limits", "", ""};
    // Private writable memory, stacks of threads included; not what is reserved only (RLIMIT_AS would count it).
    if (has_memory_limit(policy))
        lower(layer, "memory", RLIMIT_DATA, policy.memory_bytes ? policy.memory_bytes : three_quarters_of_memory());
    if (policy.writable.empty() && !may_share_memory(policy))
        lower(layer, "files", RLIMIT_FSIZE, 0); // a full file system in /tmp, say, where no other layer is
    // Half of the usual 1024: descriptors that are under way in messages count for all processes of a user
    // together, and who has to send some, as host and scene loader do, must be able to whatever a plugin has
    // under way.
    lower(layer, "descriptors", RLIMIT_NOFILE, policy.makes_shared_memory ? 1024 : 512);
    lower(layer, "core", RLIMIT_CORE, 0);
    lower(layer, "queues", RLIMIT_MSGQUEUE, 0);
    lower(layer, "priorities", RLIMIT_RTPRIO, 0); // a real-time thread keeps a processor from all others
    lower(layer, "nice", RLIMIT_NICE, 0);
    lower(layer, "threads", RLIMIT_NPROC, 8192); // in its user namespace; none for root
    return layer;
}

} // namespace arhost::sandbox
