// SPDX-License-Identifier: Apache-2.0
//
// Runs the suite on a wrong plugin and checks which tests find it.
#pragma once

#include "conform_run.hpp"
#include "matrix.hpp"

#include <gmock/gmock.h>

namespace arhost::test {

// The value of --only for every test of a wrong plugin's kind. Tests of abi.* run only on ray tracers.
inline std::string whole_suite(const WrongPlugin &wrong) {
    return wrong.kind == "rt" ? "*" : wrong.kind == "body" ? "tracker.*" : wrong.kind + ".*";
}

// Runs `tests`, of which exactly those in wrong.found_by must fail, with wrong.verdict.
inline void expect_found(const WrongPlugin &wrong, const std::string &tests) {
    ConformRun run;
    const std::filesystem::path plugin = run.link_wrong(wrong.defect, wrong.kind);
    const bool hangs = wrong.verdict == "timeout"; // a plugin that hangs gets a short timeout
    std::vector<std::string> arguments = {
        plugin.string(),     "--only", tests,         "--jobs", "1", "--timeout-factor",
        hangs ? "0.3" : "3", "--json", "results.json"};
    if (wrong.kind == "body")
        arguments.insert(arguments.end(), {"--body", "head"});
    const int status = run.run(arguments);
    std::vector<std::string> found_by;
    const nlohmann::json report = run.json("results.json");
    for (const nlohmann::json &result : report.at("results"))
        if (const std::string verdict = result.at("verdict"); verdict != "pass" && verdict != "skip") {
            if (verdict == "warn" && wrong.verdict != "warn")
                continue; // ignore speed warnings: the machine may be slow
            found_by.push_back(result.at("test"));
            EXPECT_EQ(verdict, wrong.verdict) << found_by.back();
        }
    EXPECT_THAT(found_by, testing::UnorderedElementsAreArray(wrong.found_by)) << run.output();
    EXPECT_EQ(status, wrong.verdict == "pass" || wrong.verdict == "warn" ? 0 : 1);
}

} // namespace arhost::test
