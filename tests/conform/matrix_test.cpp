// SPDX-License-Identifier: Apache-2.0
//
// The suite proves itself: a right ray tracer passes, each wrong one fails the tests named for it and no other.
#include "conform_run.hpp"
#include "matrix_sinks.hpp"
#include "matrix_sources.hpp"

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
    const std::filesystem::path plugin = run.link_wrong(wrong.defect);
    // What hangs is waited for, but not for half a minute.
    const bool hangs = wrong.verdict == "timeout";
    const int status =
        run.run({plugin.string(), "--jobs", "1", "--patience", hangs ? "0.1" : "3", "--json", "results.json"});
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
INSTANTIATE_TEST_SUITE_P(Source, Matrix, testing::ValuesIn(wrong_sources),
                         [](const auto &info) { return info.param.defect; });
INSTANTIATE_TEST_SUITE_P(Sink, Matrix, testing::ValuesIn(wrong_sinks),
                         [](const auto &info) { return info.param.defect; });

// The wrong plugins of a kind, and the file whose defects they are, under names that begin so.
struct Part {
    const std::vector<WrongPlugin> &plugins;
    std::string source, prefix;
};
const std::vector<Part> parts = {{wrong_plugins, "wrong.cpp", ""},
                                 {wrong_sources, "wrong_source.cpp", "source_"},
                                 {wrong_sinks, "wrong_sink.cpp", "sink_"}};

TEST(MatrixTable, HasAtLeastOneWrongPluginForEveryTest) {
    std::set<std::string> proven;
    for (const Part &part : parts)
        for (const WrongPlugin &wrong : part.plugins)
            proven.insert(wrong.found_by.begin(), wrong.found_by.end());
    EXPECT_EQ(proven, ConformRun::test_names());
}

TEST(MatrixTable, HasEveryDefectThatTheWrongPluginsKnow) {
    for (const Part &part : parts) {
        const std::string source = read_file(ARHOST_SOURCE_DIRECTORY "/tests/conform/wrong/" + part.source);
        for (std::size_t at = 0; (at = source.find("has(\"", at)) != std::string::npos;) {
            at += 5;
            const std::string defect = part.prefix + source.substr(at, source.find('"', at) - at);
            EXPECT_THAT(part.plugins, testing::Contains(testing::Field(&WrongPlugin::defect, defect)));
        }
    }
}

// ---- docs/conformance.md ---------------------------------------------------------------------------

TEST(ConformanceDocument, HasTheMatrix) {
    for (const Part &part : parts) {
        std::string table = "| what is wrong | verdict | found by |\n| --- | --- | --- |\n";
        for (const WrongPlugin &wrong : part.plugins) {
            std::string tests;
            for (const std::string &test : wrong.found_by)
                tests += (tests.empty() ? "`" : ", `") + test + "`";
            table += "| " + wrong.what + " | " + wrong.verdict + " | " + tests + " |\n";
        }
        EXPECT_THAT(read_file(ARHOST_SOURCE_DIRECTORY "/docs/conformance.md"), HasSubstr(table));
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
