// SPDX-License-Identifier: Apache-2.0
// A run's results as text, JSON, JUnit XML and HTML.
#pragma once

#include "conformance/runner.hpp"

#include <string>
#include <vector>

namespace arhost::conformance {

struct Report {
    RunSettings settings;
    std::vector<Test> tests;
    std::vector<Result> results; // in the order of the tests
    std::optional<Facts> plugin; // empty if it could not be opened

    std::size_t count(Verdict verdict) const;
    // 0: success; 1: a test failed, crashed or timed out; 2: an error of the suite, or no test ran.
    int exit_status() const;
    const Test &test_of(const Result &result) const;
    // The command that runs this test again.
    std::string command(const Result &result) const;
};

std::string as_line(const Report &report, const Result &result); // with the message and the command
std::string as_summary(const Report &report);
std::string as_json(const Report &report);
std::string as_junit(const Report &report);
std::string as_html(const Report &report);

// Printable, with &, <, > and quotes escaped for XML and HTML.
std::string escaped(const std::string &text);

} // namespace arhost::conformance
