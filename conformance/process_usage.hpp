// SPDX-License-Identifier: Apache-2.0
//
// What this process holds, to see what a plugin leaves behind.
#pragma once

#include "conformance/test.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <limits>
#include <malloc.h>
#include <string>
#include <unistd.h>

namespace arhost::conformance {

struct ProcessUsage {
    long descriptors, threads;
    long allocated_kib; // by malloc; to the byte, wherever in the heap there was room
    long dirty_kib;     // all of its own memory, whoever has mapped it, that has been written to

    static ProcessUsage now() {
        ::malloc_trim(0); // what is free in the arenas of a driver's threads is no one's
        const auto heap = ::mallinfo2();
        return {descriptors_now(), entries("/proc/self/task"),
                static_cast<long>((heap.uordblks + heap.hblkhd) / 1024), dirty_kib_now()};
    }
    static long descriptors_now() { return entries("/proc/self/fd"); }

private:
    static long entries(const char *folder) { // throws std::system_error
        namespace fs = std::filesystem;
        return static_cast<long>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
    }
    static long dirty_kib_now() {
        std::ifstream pages("/proc/self/smaps_rollup"); // counted one by one, unlike those of statm
        long kib = 0;
        if (!pages) { // a kernel without it
            long size = 0, resident = 0;
            if (!(std::ifstream("/proc/self/statm") >> size >> resident))
                throw std::runtime_error("/proc/self/statm does not tell this process's memory");
            return resident * (::sysconf(_SC_PAGESIZE) / 1024);
        }
        for (std::string word; pages >> word && word != "Private_Dirty:";)
            pages.ignore(std::numeric_limits<std::streamsize>::max(), '\n');
        if (!(pages >> kib))
            throw std::runtime_error("/proc/self/smaps_rollup does not tell this process's memory");
        return kib;
    }
};

// What has grown since `before` although nothing should have; empty: nothing. The allocator may keep some memory.
inline std::string growth(const ProcessUsage &before, const ProcessUsage &after, long kib_allowed) {
    const auto grown = [](long from, long to, const char *what) {
        return fmt::format("from {} {} to {}", from, what, to);
    };
    if (after.descriptors > before.descriptors)
        return grown(before.descriptors, after.descriptors, "open descriptors");
    if (after.threads > before.threads)
        return grown(before.threads, after.threads, "threads");
    if (after.allocated_kib > before.allocated_kib + kib_allowed)
        return grown(before.allocated_kib, after.allocated_kib, "KiB of allocated memory");
    if (after.dirty_kib > before.dirty_kib + kib_allowed)
        return grown(before.dirty_kib, after.dirty_kib, "KiB of private memory");
    return {};
}

// What `work` leaves behind each time; empty: nothing. What pools and caches take they take once: only a leak grows
// as often as one looks.
template <class Work> std::string growth_by(Work &&work, long kib_allowed) {
    constexpr int looks = 5;
    std::string grown;
    for (int look = 0; look < looks; ++look) {
        const ProcessUsage before = ProcessUsage::now();
        work();
        const ProcessUsage after = ProcessUsage::now();
        grown = growth(before, after, kib_allowed);
        const bool is_of_memory = after.descriptors <= before.descriptors && after.threads <= before.threads;
        if (grown.empty() || (look > 0 && !is_of_memory)) // of the others there soon is none left
            break;
    }
    return grown;
}

// `run(frames)` is a start, so many frames, and a stop. Who leaks a KiB a frame, or 40 a start, is found.
template <class Run> void expect_no_leak(Run &&run) {
    constexpr int frames = 40;
    constexpr long kib_allowed = 150, many_descriptors = 100;
    int starts = 0;
    const auto work = [&](int most) {
        const long before = ProcessUsage::descriptors_now();
        for (starts = 0; starts < most && ProcessUsage::descriptors_now() < before + many_descriptors; ++starts)
            run(frames); // while descriptors are left
    };
    work(2); // to warm up
    if (const std::string grown = growth_by([&] { work(5); }, kib_allowed); !grown.empty())
        throw Failure(fmt::format("{} starts with {} frames each led {}", starts, frames, grown));
}

} // namespace arhost::conformance
