// SPDX-License-Identifier: Apache-2.0
// Cancellation by the host: before a call, or from another thread during it.
#pragma once

#include "conformance/test.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <thread>

namespace arhost::conformance {

inline void expect_ok_or_cancelled(const char *call, arhost_status status, const char *when = "after cancellation") {
    if (status != ARHOST_STATUS_OK && status != ARHOST_STATUS_ERROR_CANCELLED)
        throw Failure(fmt::format("{}, {} returned {}; expected OK or CANCELLED", when, call, status_name(status)));
}

// Calls `function` until it is cancelled after 100 ms. `call`: its name for messages.
template <class Function>
void expect_to_be_cancelled(const Context &context, Host &host, const char *call, Function &&function) {
    using Clock = std::chrono::steady_clock;
    // At least 2 s, whatever the timeout factor: plugins poll every 100 ms.
    const std::chrono::duration<double> limit = 2s * std::max(1.0, context.timeout_factor);
    Clock::time_point cancelled;
    std::jthread canceller([&] {
        std::this_thread::sleep_for(100ms);
        cancelled = Clock::now();
        host.cancel();
    });
    arhost_status status = ARHOST_STATUS_OK;
    while (status == ARHOST_STATUS_OK && !host.is_cancelled())
        status = function();
    const Clock::time_point returned = Clock::now();
    const bool was_cancelled = host.is_cancelled();
    canceller.join();
    if (!was_cancelled && status == ARHOST_STATUS_END)
        throw Skip(fmt::format("{} reached the end of the source before it could be cancelled", call));
    if (!was_cancelled)
        throw Failure(fmt::format("{} returned {} before it was cancelled", call, status_name(status)));
    expect_ok_or_cancelled(call, status == ARHOST_STATUS_END ? ARHOST_STATUS_OK : status,
                           "cancelled during the call");
    if (returned - cancelled > limit)
        throw Failure(fmt::format("cancelled during the call, {} returned {:.1f} s later; the limit is {:.3g} s",
                                  call, std::chrono::duration<double>(returned - cancelled).count(), limit.count()));
}

} // namespace arhost::conformance
