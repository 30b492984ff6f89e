// SPDX-License-Identifier: Apache-2.0
//
// A host that wants a call to return soon: before it, or from another thread meanwhile.
#pragma once

#include "conformance/test.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <thread>

namespace arhost::conformance {

inline void expect_ok_or_cancelled(const char *call, arhost_status status, const char *when = "cancelled before") {
    if (status != ARHOST_STATUS_OK && status != ARHOST_STATUS_ERROR_CANCELLED)
        throw Failure(fmt::format("{}, {} returned {}; it must be OK or CANCELLED", when, call, status_name(status)));
}

// The host cancels 100 ms after `function` has been called, which is the plugin's `call`, again and again until then
// where it returns sooner.
template <class Function>
void expect_to_be_cancelled(const Context &context, Host &host, const char *call, Function &&function) {
    using Clock = std::chrono::steady_clock;
    // A plugin asks each 100 ms, however short the deadlines are.
    const std::chrono::duration<double> soon = 2s * std::max(1.0, context.timeout_factor);
    Clock::time_point cancelled;
    std::jthread other([&] {
        std::this_thread::sleep_for(100ms);
        cancelled = Clock::now();
        host.cancel();
    });
    arhost_status status = ARHOST_STATUS_OK;
    while (status == ARHOST_STATUS_OK && !host.is_cancelled())
        status = function();
    const Clock::time_point returned = Clock::now();
    const bool was_cancelled = host.is_cancelled();
    other.join();
    if (!was_cancelled && status == ARHOST_STATUS_END)
        throw Skip(fmt::format("{} came to its end before it could be cancelled", call));
    if (!was_cancelled)
        throw Failure(fmt::format("{} returned {} before anything was cancelled", call, status_name(status)));
    expect_ok_or_cancelled(call, status == ARHOST_STATUS_END ? ARHOST_STATUS_OK : status, "cancelled meanwhile");
    if (returned - cancelled > soon)
        throw Failure(fmt::format("cancelled meanwhile, {} went on for {:.1f} s; {:.3g} s are allowed", call,
                                  std::chrono::duration<double>(returned - cancelled).count(), soon.count()));
}

} // namespace arhost::conformance
