// SPDX-License-Identifier: Apache-2.0
//
// Reports the progress of an image that takes long, so that the host does not assume a hang.
#pragma once

#include <arhost-cpp/plugin.hpp>

#include <atomic>
#include <chrono>

namespace arhost::raytracer_common {

class SlowImage {
public:
    explicit SlowImage(const Host &host) : host_(host) {}

    // To be called after each part of the image, at least once a second, on any thread.
    void report(double fraction) {
        // Relaxed: no other data depends on the number, and two reports at once do no harm.
        const std::int64_t due = reports_.load(std::memory_order_relaxed) + 1;
        if (std::chrono::steady_clock::now() < begin_ + due * interval)
            return;
        reports_.store(due, std::memory_order_relaxed);
        host_.progress(fraction, "tracing the image");
    }

private:
    static constexpr std::chrono::milliseconds interval{100}; // faster images report nothing
    const Host &host_;
    const std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
    std::atomic<std::int64_t> reports_ = 0;
};

} // namespace arhost::raytracer_common
