// SPDX-License-Identifier: Apache-2.0
//
// What this process holds, to see what a plugin leaves behind.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <unistd.h>

namespace arhost::conform {

struct ProcessUsage {
    long resident_kib, descriptors, threads;

    static ProcessUsage now() {
        namespace fs = std::filesystem;
        const auto entries = [](const char *folder) {
            return static_cast<long>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
        };
        long pages = 0;
        std::ifstream("/proc/self/statm") >> pages >> pages; // the second number
        return {pages * (::sysconf(_SC_PAGESIZE) / 1024), entries("/proc/self/fd"), entries("/proc/self/task")};
    }
};

// What has grown since `before` although nothing should have; empty: nothing. The allocator may keep some memory.
inline std::string growth(const ProcessUsage &before, const ProcessUsage &after, long resident_kib_allowed) {
    if (after.descriptors > before.descriptors)
        return "from " + std::to_string(before.descriptors) + " open descriptors to " +
               std::to_string(after.descriptors);
    if (after.threads > before.threads)
        return "from " + std::to_string(before.threads) + " threads to " + std::to_string(after.threads);
    if (after.resident_kib > before.resident_kib + resident_kib_allowed)
        return "from " + std::to_string(before.resident_kib) + " to " + std::to_string(after.resident_kib) +
               " KiB of resident memory";
    return {};
}

// What `work` leaves behind each time; empty: nothing. What an allocator keeps it keeps once, so a second look tells.
template <class Work> std::string growth_by(Work &&work, long resident_kib_allowed) {
    std::string grown;
    for (int look = 0; look < 2; ++look) {
        const ProcessUsage before = ProcessUsage::now();
        work();
        if ((grown = growth(before, ProcessUsage::now(), resident_kib_allowed)).empty())
            break;
    }
    return grown;
}

} // namespace arhost::conform
