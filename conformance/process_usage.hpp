// SPDX-License-Identifier: Apache-2.0
// Descriptors, threads and memory of this process, to detect a plugin's leaks.
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
    long allocated_kib; // by malloc, including allocations that reuse free heap memory
    long dirty_kib;     // all private memory that has been written to

    static ProcessUsage now() {
        ::malloc_trim(0); // returns free memory in the arenas of driver threads
        const auto heap = ::mallinfo2();
        return {descriptors_now(), number_in("/proc/self/status", "Threads:"),
                static_cast<long>((heap.uordblks + heap.hblkhd) / 1024), dirty_kib_now()};
    }
    static long descriptors_now() { // throws std::system_error
        namespace fs = std::filesystem;
        return static_cast<long>(std::distance(fs::directory_iterator("/proc/self/fd"), fs::directory_iterator()));
    }

private:
    // Returns the number in the line of `file` that begins with `label`.
    static long number_in(const char *file, const char *label) {
        std::ifstream lines(file);
        for (std::string word; lines >> word && word != label;)
            lines.ignore(std::numeric_limits<std::streamsize>::max(), '\n');
        long number = 0;
        if (!(lines >> number))
            throw std::runtime_error(std::string(file) + " cannot be parsed");
        return number;
    }
    static long dirty_kib_now() {
        if (::access("/proc/self/smaps_rollup", F_OK) != 0) { // not in this kernel
            long size = 0, resident = 0;
            if (!(std::ifstream("/proc/self/statm") >> size >> resident))
                throw std::runtime_error("/proc/self/statm cannot be parsed");
            return resident * (::sysconf(_SC_PAGESIZE) / 1024);
        }
        return number_in("/proc/self/smaps_rollup", "Private_Dirty:"); // exact, unlike statm
    }
};

// Describes what has grown from `before` to `after`; empty if nothing has. Memory may grow by allowed_kib, because
// allocators keep some.
inline std::string growth(const ProcessUsage &before, const ProcessUsage &after, long allowed_kib) {
    const auto grown = [](long from, long to, const char *unit) {
        return fmt::format("from {} {} to {}", from, unit, to);
    };
    if (after.descriptors > before.descriptors)
        return grown(before.descriptors, after.descriptors, "open descriptors");
    if (after.threads > before.threads)
        return grown(before.threads, after.threads, "threads");
    if (after.allocated_kib > before.allocated_kib + allowed_kib)
        return grown(before.allocated_kib, after.allocated_kib, "KiB of allocated memory");
    if (after.dirty_kib > before.dirty_kib + allowed_kib)
        return grown(before.dirty_kib, after.dirty_kib, "KiB of private memory");
    return {};
}

// Describes what grows each time `work` runs; empty if nothing does. Pools and caches grow once; a leak grows every
// time.
template <class Work> std::string growth_by(Work &&work, long allowed_kib) {
    constexpr int repetitions = 5;
    std::string grown;
    for (int i = 0; i < repetitions; ++i) {
        const ProcessUsage before = ProcessUsage::now();
        work();
        const ProcessUsage after = ProcessUsage::now();
        grown = growth(before, after, allowed_kib);
        const bool is_of_memory = after.descriptors <= before.descriptors && after.threads <= before.threads;
        if (grown.empty() || (i > 0 && !is_of_memory)) // descriptors and threads run out soon
            break;
    }
    return grown;
}

// `run(frames)` starts, processes that many frames, and stops. Detects 1 KiB leaked per frame, or 40 KiB per start.
template <class Run> void expect_no_leak(Run &&run) {
    constexpr int frames = 40;
    constexpr long allowed_kib = 150, max_new_descriptors = 100;
    int starts = 0;
    const auto work = [&](int max_starts) {
        const long before = ProcessUsage::descriptors_now();
        for (starts = 0; starts < max_starts && ProcessUsage::descriptors_now() < before + max_new_descriptors;
             ++starts)
            run(frames); // stops before descriptors run out
    };
    work(2); // to warm up
    if (const std::string grown = growth_by([&] { work(5); }, allowed_kib); !grown.empty())
        throw Failure(fmt::format("after {} starts with {} frames each, the process grew {}", starts, frames, grown));
}

} // namespace arhost::conformance
