// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <thread>
#include <vector>

namespace arhost::synthetic {

// Divides [0, count) into `threads` parts of equal size and calls work(first, last) for all parts in parallel. One of
// the calls runs on the caller's thread.
template <class Work> void in_parallel(int count, int threads, const Work &work) {
    std::vector<std::jthread> others;
    const auto bound = [&](int part) { return static_cast<int>(static_cast<long long>(count) * part / threads); };
    for (int part = 1; part < threads; ++part)
        others.emplace_back([&work, first = bound(part), last = bound(part + 1)] { work(first, last); });
    work(0, bound(1));
}

} // namespace arhost::synthetic
