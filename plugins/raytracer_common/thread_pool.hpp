// SPDX-License-Identifier: Apache-2.0
//
// A thread pool that processes the tiles of one image in parallel.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <mutex>
#include <stop_token>
#include <thread>
#include <vector>

namespace arhost::raytracer_common {

// While an object of this class exists, the current thread treats denormal floats as 0: operations with denormals
// take about a hundred cycles.
class FlushDenormals {
public:
    FlushDenormals();
    ~FlushDenormals();
    FlushDenormals(const FlushDenormals &) = delete;
    FlushDenormals &operator=(const FlushDenormals &) = delete;

private:
    unsigned before_;
};

class ThreadPool {
public:
    // `threads`: number of threads, including the thread that calls for_each(); 0: one per processor.
    explicit ThreadPool(unsigned threads);
    unsigned thread_count() const { return static_cast<unsigned>(helpers_.size()) + 1; }

    // Calls work(i, thread) once for each i in [0, count) and returns when all calls have returned. `thread` is the
    // number of the calling thread, from 0 to thread_count() − 1. `work` must not throw. Only one thread may call
    // for_each() at a time.
    using Work = std::function<void(std::size_t i, std::size_t thread)>;
    void for_each(std::size_t count, const Work &work);

private:
    void run_helper(const std::stop_token &stop, std::size_t thread);
    void run_items(std::size_t thread);

    std::mutex mutex_; // guards work_, count_, round_ and busy_
    std::condition_variable_any started_;
    std::condition_variable done_;
    const Work *work_ = nullptr;
    std::size_t count_ = 0, round_ = 0, busy_ = 0;
    std::atomic<std::size_t> next_{0};
    std::vector<std::jthread> helpers_; // last member: destroyed, and thus joined, before the others
};

} // namespace arhost::raytracer_common
