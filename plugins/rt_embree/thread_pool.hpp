// SPDX-License-Identifier: Apache-2.0
//
// A few threads that share out the tiles of one image at a time.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <mutex>
#include <stop_token>
#include <thread>
#include <vector>

namespace rt_embree {

// While it lives, this thread's denormal floats count as 0: they would cost a hundred cycles each.
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
    // So many threads work, the caller's own included; 0: one a processor.
    explicit ThreadPool(unsigned threads);
    unsigned thread_count() const { return static_cast<unsigned>(helpers_.size()) + 1; }

    // Calls work(i, thread) for i from 0 to count − 1, each once, on whichever thread is free (0 to
    // thread_count() − 1), and returns when all are done. `work` throws nothing. Not to be called by two
    // threads at once.
    using Work = std::function<void(std::size_t i, std::size_t thread)>;
    void for_each(std::size_t count, const Work &work);

private:
    void help(const std::stop_token &stop, std::size_t thread);
    void take_turns(std::size_t thread);

    std::mutex mutex_; // guards what follows, but for next_
    std::condition_variable_any called_;
    std::condition_variable done_;
    const Work *work_ = nullptr;
    std::size_t count_ = 0, round_ = 0, busy_ = 0;
    std::atomic<std::size_t> next_{0};
    std::vector<std::jthread> helpers_; // last: joined before the rest goes
};

} // namespace rt_embree
