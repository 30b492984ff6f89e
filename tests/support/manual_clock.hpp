// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/clock.hpp"

namespace arhost::test {

// A clock that shows the time that the test sets.
class ManualClock final : public base::Clock {
public:
    time_point now() const override { return now_; }
    void advance(duration time) { now_ += time; }

private:
    time_point now_{std::chrono::hours(1)};
};

} // namespace arhost::test
