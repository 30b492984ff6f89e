// SPDX-License-Identifier: Apache-2.0
//
// The suite proves itself: a right plugin passes, each wrong one fails the tests named for it and no other.
#include "conform_run.hpp"
#include "matrix.hpp"
#include "matrix_sinks.hpp"
#include "matrix_sources.hpp"
#include "matrix_trackers.hpp"

#include <gmock/gmock.h>

#include <set>

namespace arhost::test {
namespace {

using testing::HasSubstr;
using testing::UnorderedElementsAreArray;

class Matrix : public testing::TestWithParam<WrongPlugin> {};

TEST_P(Matrix, FindsItByTheseTestsAndNoOther) {
    const WrongPlugin &wrong = GetParam();
    ConformRun run;
    const std::filesystem::path plugin = run.link_wrong(wrong.defect, wrong.kind);
    // What hangs is waited for, but not for half a minute.
    const bool hangs = wrong.verdict == "timeout";
    const int status = run.run({plugin.string(), "--only", wrong.kind == "rt" ? "*" : wrong.kind + ".*", "--jobs",
                                "1", "--timeout-factor", hangs ? "0.3" : "3", "--json", "results.json"});
    std::vector<std::string> found_by;
    const nlohmann::json report = run.json("results.json");
    for (const nlohmann::json &result : report.at("results"))
        if (const std::string verdict = result.at("verdict"); verdict != "pass" && verdict != "skip") {
            if (verdict == "warn" && wrong.verdict != "warn")
                continue; // this machine is slow
            found_by.push_back(result.at("test"));
            EXPECT_EQ(verdict, wrong.verdict) << found_by.back();
        }
    EXPECT_THAT(found_by, UnorderedElementsAreArray(wrong.found_by)) << run.output();
    EXPECT_EQ(status, wrong.verdict == "pass" || wrong.verdict == "warn" ? 0 : 1);
}

INSTANTIATE_TEST_SUITE_P(Wrong, Matrix, testing::ValuesIn(wrong_plugins),
                         [](const auto &info) { return info.param.defect; });
INSTANTIATE_TEST_SUITE_P(WrongTracker, Matrix, testing::ValuesIn(wrong_trackers),
                         [](const auto &info) { return info.param.defect; });
INSTANTIATE_TEST_SUITE_P(WrongSource, Matrix, testing::ValuesIn(wrong_sources),
                         [](const auto &info) { return info.param.defect; });
INSTANTIATE_TEST_SUITE_P(WrongSink, Matrix, testing::ValuesIn(wrong_sinks),
                         [](const auto &info) { return info.param.defect; });

struct Table {
    std::string source; // in wrong/
    const std::vector<WrongPlugin> &plugins;
};
const std::vector<Table> tables = {{"wrong.cpp", wrong_plugins},
                                   {"wrong_tracker.cpp", wrong_trackers},
                                   {"wrong_source.cpp", wrong_sources},
                                   {"wrong_sink.cpp", wrong_sinks}};

TEST(MatrixTable, HasAtLeastOneWrongPluginForEveryTest) {
    std::set<std::string> proven;
    for (const Table &table : tables)
        for (const WrongPlugin &wrong : table.plugins)
            proven.insert(wrong.found_by.begin(), wrong.found_by.end());
    EXPECT_EQ(proven, ConformRun::test_names());
}

TEST(MatrixTable, HasEveryDefectThatTheWrongPluginsKnow) {
    for (const Table &table : tables) {
        const std::string source = read_file(ARHOST_SOURCE_DIRECTORY "/tests/conformance/wrong/" + table.source);
        for (std::size_t at = 0; (at = source.find("has(\"", at)) != std::string::npos;) {
            at += 5;
            const std::string defect = source.substr(at, source.find('"', at) - at);
            EXPECT_THAT(table.plugins, testing::Contains(testing::Field(&WrongPlugin::defect, defect)));
        }
    }
}

// ---- docs/conformance.md ---------------------------------------------------------------------------

TEST(ConformanceDocument, HasTheMatrix) {
    for (const Table &table : tables) {
        std::string text = "| what is wrong | verdict | found by |\n| --- | --- | --- |\n";
        for (const WrongPlugin &wrong : table.plugins) {
            std::string tests;
            for (const std::string &test : wrong.found_by)
                tests += (tests.empty() ? "`" : ", `") + test + "`";
            text += "| " + wrong.what + " | " + wrong.verdict + " | " + tests + " |\n";
        }
        EXPECT_THAT(read_file(ARHOST_SOURCE_DIRECTORY "/docs/conformance.md"), HasSubstr(text));
    }
}

TEST(ConformanceDocument, HasEveryTestAndItsPromise) {
    ConformRun run;
    ASSERT_EQ(run.run({"--list"}), 0);
    std::istringstream lines(run.output());
    std::string table = "| test | promise |\n| --- | --- |\n";
    for (std::string name, promise; lines >> name >> std::ws && std::getline(lines, promise);)
        table += "| `" + name + "` | " + promise + " |\n";
    EXPECT_THAT(read_file(ARHOST_SOURCE_DIRECTORY "/docs/conformance.md"), HasSubstr(table));
}

} // namespace
} // namespace arhost::test
