// SPDX-License-Identifier: Apache-2.0
//
// Runs tests, each in a process of its own with a deadline. Nothing of the plugin is opened in this one.
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
    int signals = -1; // a signalfd: what comes there ends a run
};

Result run_alone(const Test &test, const RunSettings &settings);

// `results` may begin with those of tests that were run before. A test whose need has not passed is skipped;
// a need that is not among the tests counts as passed. What the tests leave behind is killed. Throws
// base::Interrupted, and then nothing of the run is left, neither processes nor folders.
void run_all(std::span<const Test> tests, const RunSettings &settings, std::vector<Result> &results,
             const std::function<void(const Result &)> &on_result);

} // namespace arhost::conformance
