// SPDX-License-Identifier: Apache-2.0
#include "raytracer_common/thread_pool.hpp"

#include <algorithm>

#if defined(__SSE2__)
#include <immintrin.h>
#endif

namespace arhost::raytracer_common {

#if defined(__SSE2__)
// 0x8040 sets the bits flush-to-zero and denormals-are-zero (Intel SDM vol. 1, 10.2.3).
FlushDenormals::FlushDenormals() : before_(_mm_getcsr()) {
    _mm_setcsr(before_ | 0x8040);
}
FlushDenormals::~FlushDenormals() {
    _mm_setcsr(before_);
}
#else
FlushDenormals::FlushDenormals() : before_(0) {}
FlushDenormals::~FlushDenormals() = default;
#endif

ThreadPool::ThreadPool(unsigned threads) {
    if (threads == 0)
        threads = std::max(1u, std::thread::hardware_concurrency());
    for (unsigned i = 1; i < threads; ++i)
        helpers_.emplace_back([this, i](const std::stop_token &stop) { run_helper(stop, i); });
}

void ThreadPool::for_each(std::size_t count, const Work &work) {
    {
        std::lock_guard lock(mutex_);
        work_ = &work;
        count_ = count;
        // Relaxed: the mutex publishes the value to the helpers.
        next_.store(0, std::memory_order_relaxed);
        busy_ = helpers_.size();
        ++round_;
    }
    started_.notify_all();
    run_items(0);
    // Locking synchronizes with each helper's unlock in run_helper(), which publishes the helper's results.
    std::unique_lock lock(mutex_);
    done_.wait(lock, [this] { return busy_ == 0; });
}

void ThreadPool::run_helper(const std::stop_token &stop, std::size_t thread) {
    std::size_t seen = 0;
    std::unique_lock lock(mutex_);
    while (started_.wait(lock, stop, [&] { return round_ != seen; })) {
        seen = round_;
        lock.unlock();
        run_items(thread);
        lock.lock();
        if (--busy_ == 0)
            done_.notify_one();
    }
}

void ThreadPool::run_items(std::size_t thread) {
    const FlushDenormals flush;
    // Relaxed: fetch_add makes each index unique, and next_ does not publish any other data.
    for (std::size_t i; (i = next_.fetch_add(1, std::memory_order_relaxed)) < count_;)
        (*work_)(i, thread);
}

} // namespace arhost::raytracer_common
