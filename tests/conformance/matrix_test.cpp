// SPDX-License-Identifier: Apache-2.0
//
// Tests the suite: a correct plugin passes, and each wrong one fails the tests listed for it.
#include "matrix_run.hpp"
#include "matrix_sinks.hpp"
#include "matrix_sources.hpp"
#include "matrix_trackers.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>

#include <set>

namespace arhost::test {
namespace {

using testing::HasSubstr;

// Per push, each wrong plugin runs the tests that must find its defect. Plugins that must pass, and one failing
// plugin per kind, run the whole suite; exhaustive_test.cpp runs it for all.
class MatrixTargeted : public testing::TestWithParam<WrongPlugin> {};
class MatrixWhole : public testing::TestWithParam<WrongPlugin> {};

TEST_P(MatrixTargeted, FailsTheListedTests) {
    std::string tests;
    for (const std::string &test : GetParam().found_by)
        tests += (tests.empty() ? "" : ",") + test;
    expect_found(GetParam(), tests);
}
TEST_P(MatrixWhole, FailsExactlyTheListedTests) {
    expect_found(GetParam(), whole_suite(GetParam()));
}

std::vector<WrongPlugin> failing(std::vector<WrongPlugin> plugins) {
    std::erase_if(plugins, [](const WrongPlugin &plugin) { return plugin.found_by.empty(); });
    return plugins;
}
std::vector<WrongPlugin> sample(const std::vector<WrongPlugin> &plugins) {
    constexpr std::size_t stride = 16;
    std::vector<WrongPlugin> chosen;
    for (std::size_t i = 0; i < plugins.size(); ++i)
        if (plugins[i].found_by.empty() || i % stride == 0)
            chosen.push_back(plugins[i]);
    return chosen;
}
const auto defect = [](const auto &info) { return info.param.defect; };

INSTANTIATE_TEST_SUITE_P(RayTracer, MatrixTargeted, testing::ValuesIn(failing(wrong_plugins)), defect);
INSTANTIATE_TEST_SUITE_P(Tracker, MatrixTargeted, testing::ValuesIn(failing(wrong_trackers)), defect);
INSTANTIATE_TEST_SUITE_P(Body, MatrixTargeted, testing::ValuesIn(failing(wrong_bodies)), defect);
INSTANTIATE_TEST_SUITE_P(Source, MatrixTargeted, testing::ValuesIn(failing(wrong_sources)), defect);
INSTANTIATE_TEST_SUITE_P(Sink, MatrixTargeted, testing::ValuesIn(failing(wrong_sinks)), defect);
INSTANTIATE_TEST_SUITE_P(RayTracer, MatrixWhole, testing::ValuesIn(sample(wrong_plugins)), defect);
INSTANTIATE_TEST_SUITE_P(Tracker, MatrixWhole, testing::ValuesIn(sample(wrong_trackers)), defect);
INSTANTIATE_TEST_SUITE_P(Body, MatrixWhole, testing::ValuesIn(sample(wrong_bodies)), defect);
INSTANTIATE_TEST_SUITE_P(Source, MatrixWhole, testing::ValuesIn(sample(wrong_sources)), defect);
INSTANTIATE_TEST_SUITE_P(Sink, MatrixWhole, testing::ValuesIn(sample(wrong_sinks)), defect);

struct Table {
    std::string source; // in wrong/
    const std::vector<WrongPlugin> &plugins;
};
const std::vector<Table> tables = {{"wrong.cpp", wrong_plugins},
                                   {"wrong_tracker.cpp", wrong_trackers},
                                   {"wrong_body.cpp", wrong_bodies},
                                   {"wrong_source.cpp", wrong_sources},
                                   {"wrong_sink.cpp", wrong_sinks}};

TEST(MatrixTable, HasAWrongPluginForEveryTest) {
    std::set<std::string> covered;
    for (const Table &table : tables)
        for (const WrongPlugin &wrong : table.plugins)
            covered.insert(wrong.found_by.begin(), wrong.found_by.end());
    EXPECT_EQ(covered, ConformRun::test_names());
}

TEST(MatrixTable, ListsEveryDefectOfTheWrongPlugins) {
    for (const Table &table : tables) {
        const std::string source =
            read_file(arhost::test::source_directory() + "/tests/conformance/wrong/" + table.source);
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
        std::string text = "| defect | verdict | found by |\n| --- | --- | --- |\n";
        for (const WrongPlugin &wrong : table.plugins) {
            std::string tests;
            for (const std::string &test : wrong.found_by)
                tests += (tests.empty() ? "`" : ", `") + test + "`";
            text += "| " + wrong.description + " | " + wrong.verdict + " | " + tests + " |\n";
        }
        EXPECT_THAT(read_file(arhost::test::source_directory() + "/docs/conformance.md"), HasSubstr(text));
    }
}

TEST(ConformanceDocument, HasEveryTestAndItsRequirement) {
    ConformRun run;
    ASSERT_EQ(run.run({"--list"}), 0);
    std::istringstream lines(run.output());
    std::string table = "| test | requirement |\n| --- | --- |\n";
    for (std::string name, requirement; lines >> name >> std::ws && std::getline(lines, requirement);)
        table += "| `" + name + "` | " + requirement + " |\n";
    EXPECT_THAT(read_file(arhost::test::source_directory() + "/docs/conformance.md"), HasSubstr(table));
}

} // namespace
} // namespace arhost::test
