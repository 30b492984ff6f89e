// SPDX-License-Identifier: Apache-2.0
// Runs each test in its own process with a deadline. This process never opens the plugin.
#pragma once

#include "base/write_all.hpp"
#include "conformance/child.hpp"
#include "conformance/test.hpp"

#include <functional>
#include <span>
#include <vector>

namespace arhost::conformance {

struct RunSettings {
    Subject subject;
    unsigned jobs = 1;
    int signals = -1; // a signalfd whose signals end a run
};

Result run_alone(const Test &test, const RunSettings &settings);

// `results` may contain results of earlier tests. A test is skipped if the test that it needs has not passed; a
// needed test outside `tests` counts as passed. Kills the processes that tests leave behind. Throws base::Interrupted
// after removing all processes and folders of the run.
void run_all(std::span<const Test> tests, const RunSettings &settings, std::vector<Result> &results,
             const std::function<void(const Result &)> &on_result);

} // namespace arhost::conformance
