// SPDX-License-Identifier: Apache-2.0
//
// Tests the suite: a correct plugin passes, and each wrong one fails the tests listed for it in docs/conformance.md.
#include "conform_run.hpp"
#include "conformance/child.hpp"
#include "waiting.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>

#include <algorithm>
#include <list>
#include <map>
#include <set>

namespace arhost::test {
namespace {

using testing::HasSubstr;
using Verdicts = std::map<std::string, std::string>; // by test

struct Kind {
    std::string prefix;  // of the plugins' file names
    std::string heading; // in docs/conformance.md
    std::string suite;   // the value of --only for all tests. Only ray tracers run those of abi.*
};
std::ostream &operator<<(std::ostream &stream, const Kind &kind) {
    return stream << kind.prefix;
}
const std::vector<Kind> kinds = {{"rt", "### Ray tracers", "abi.*,raytracer.*"},
                                 {"tracker", "### Trackers", "tracker.*"},
                                 {"body", "### Trackers of bodies", "tracker.*"},
                                 {"source", "### Sources", "source.*"},
                                 {"sink", "### Sinks", "sink.*"}};

struct WrongPlugin {
    Kind kind;
    std::string defect;
    std::string verdict;               // of the tests that find it
    std::vector<std::string> found_by; // exactly these tests
};
std::ostream &operator<<(std::ostream &stream, const WrongPlugin &wrong) {
    return stream << wrong.defect;
}

const std::string &document() {
    static const std::string text = read_file(source_directory() + "/docs/conformance.md");
    return text;
}

std::vector<WrongPlugin> wrong_plugins(const Kind &kind) {
    std::istringstream lines(document().substr(document().find(kind.heading + "\n")));
    std::vector<WrongPlugin> plugins;
    std::string line;
    std::getline(lines, line);
    while (std::getline(lines, line) && !line.starts_with('#')) {
        if (!line.starts_with("| `"))
            continue;
        std::ranges::replace_if(
            line, [](char c) { return c == '`' || c == ','; }, ' ');
        std::istringstream cells(line.substr(1));
        std::vector<std::string> words[4]; // name, defect, verdict, found by
        for (std::vector<std::string> &of_cell : words) {
            std::string cell;
            std::getline(cells, cell, '|');
            std::istringstream stream(cell);
            of_cell.assign(std::istream_iterator<std::string>(stream), {});
        }
        plugins.push_back({kind, words[0].at(0), words[2].at(0), words[3]});
    }
    return plugins;
}
std::vector<WrongPlugin> all_wrong_plugins() {
    std::vector<WrongPlugin> all;
    for (const Kind &kind : kinds)
        std::ranges::copy(wrong_plugins(kind), std::back_inserter(all));
    return all;
}

const std::vector<conformance::Test> &suite() {
    static const std::vector<conformance::Test> tests = conformance::all_tests();
    return tests;
}
const conformance::Test &test_of_suite(const std::string &name) {
    return *std::ranges::find(suite(), name, &conformance::Test::name);
}

void expect_found(const WrongPlugin &wrong, const Verdicts &verdicts) {
    std::vector<std::string> found_by;
    for (const auto &[test, verdict] : verdicts) {
        // Speed warnings are ignored: the machine may be slow.
        if (verdict == "pass" || verdict == "skip" || (verdict == "warn" && wrong.verdict != "warn"))
            continue;
        found_by.push_back(test);
        EXPECT_EQ(verdict, wrong.verdict) << test;
    }
    EXPECT_THAT(found_by, testing::UnorderedElementsAreArray(wrong.found_by));
}

// ---- In this process -------------------------------------------------------------------------------

// Runs tests of the suite on a wrong plugin.
class SuiteHere {
public:
    explicit SuiteHere(const WrongPlugin &wrong)
        : library_(ConformRun::wrong_library(wrong.defect, wrong.kind.prefix)),
          name_(wrong.kind.prefix + "_" + wrong.defect + ".so") {
        subject_.reference = plugin_directory() + "/rt_embree.so";
        subject_.family = wrong.kind.prefix == "tracker" ? conformance::drawn_families.front() : "";
        subject_.body = wrong.kind.prefix == "body" ? "head" : "";
        subject_.timeout_factor = 3;
        subject_.policy.mode = sandbox::Mode::none;
    }
    // Runs a test after those that it needs, and returns its verdict.
    std::string run(const std::string &name) {
        if (const auto known = verdicts_.find(name); known != verdicts_.end())
            return known->second;
        const conformance::Test &test = test_of_suite(name);
        if (*test.needs && run(test.needs) != "pass")
            return verdicts_[name] = "skip";
        subject_.scratch = folder_.path() / name / "scratch";
        std::filesystem::create_directories(subject_.scratch);
        // A copy has static variables of its own, as in a new process; a link would be the same library.
        subject_.plugin = folder_.path() / name / name_;
        std::filesystem::copy_file(library_, subject_.plugin);
        return verdicts_[name] = to_text(conformance::run_here(test, subject_, calls_).verdict);
    }
    const Verdicts &verdicts() const { return verdicts_; }

private:
    std::filesystem::path library_, name_;
    ScratchFolder folder_;
    conformance::Subject subject_;
    conformance::CallPage calls_{
        ipc::SharedMemory::create("arhost-conform-call", sizeof(ipc::Call)).map(ipc::Access::read_write)};
    Verdicts verdicts_;
};

// Plugins whose test would never return, or takes seconds.
bool waits(const WrongPlugin &wrong) {
    return wrong.verdict == "timeout" || wrong.verdict == "warn" || wrong.defect == "ignores_cancel_while_rendering";
}
// These tests execute the suite's program, or use libseccomp, which notifies a process only once.
bool needs_process(const conformance::Test &test) {
    return test.forks || test.name == std::string_view("sink.slow-disk");
}
// Plugins that crash, hang, leak or attack, or that only the sandbox or a test with its own process finds.
bool needs_process(const WrongPlugin &wrong) {
    static const std::set<std::string> others = {"floods_descriptor_3", "forges_verdict", "writes_to_descriptor_3",
                                                 "opens_a_socket", "writes_beside_library"};
    return wrong.verdict == "crashed" || waits(wrong) || others.contains(wrong.defect) ||
           wrong.defect.find("leak") != std::string::npos || wrong.defect.starts_with("leaves_") ||
           std::ranges::any_of(wrong.found_by,
                               [](const std::string &test) { return needs_process(test_of_suite(test)); });
}

class Matrix : public testing::TestWithParam<Kind> {};

// Each plugin runs the tests that must find its defect; an unusual but correct one runs all tests, as the usual one
// does in MatrixWhole.
TEST_P(Matrix, FindsDefectsInOneProcess) {
    for (const WrongPlugin &wrong : wrong_plugins(GetParam())) {
        if (needs_process(wrong) || wrong.defect == "none")
            continue;
        SCOPED_TRACE(wrong.defect);
        SuiteHere here(wrong);
        for (const std::string &test : wrong.found_by)
            here.run(test);
        for (const conformance::Test &test : suite())
            if (const std::string_view name = test.name;
                wrong.found_by.empty() && !needs_process(test) &&
                wrong.kind.suite.find(name.substr(0, name.find('.') + 1)) != std::string::npos)
                here.run(test.name);
        expect_found(wrong, here.verdicts());
    }
}

// ---- By arhost conform -----------------------------------------------------------------------------

class MatrixRun {
public:
    MatrixRun(const WrongPlugin &wrong, const std::string &tests) : wrong_(wrong) {
        // A plugin that hangs gets short deadlines, which still leave a loaded machine time for the calls before.
        const double factor = wrong.verdict == "timeout"
                                  ? static_cast<double>(scaled(std::chrono::milliseconds(600)).count()) / 1000
                                  : 3;
        std::vector<std::string> arguments = {run_.link_wrong(wrong.defect, wrong.kind.prefix),
                                              "--only",
                                              tests,
                                              "--jobs",
                                              "1",
                                              "--timeout-factor",
                                              std::to_string(factor),
                                              "--json",
                                              "results.json"};
        if (wrong.kind.prefix == "body")
            arguments.insert(arguments.end(), {"--body", "head"});
        run_.start(arguments);
    }
    void expect_found() {
        const int status = run_.wait();
        SCOPED_TRACE(wrong_.defect + ": " + run_.output());
        EXPECT_EQ(status, wrong_.verdict == "pass" || wrong_.verdict == "warn" ? 0 : 1);
        Verdicts verdicts;
        const nlohmann::json report = run_.json("results.json");
        for (const nlohmann::json &result : report.at("results"))
            verdicts[result.at("test")] = result.at("verdict");
        test::expect_found(wrong_, verdicts);
    }

private:
    WrongPlugin wrong_;
    ConformRun run_;
};

TEST_P(Matrix, FindsDefectsInTheirOwnProcesses) {
    std::list<MatrixRun> waiting; // at the same time
    for (const bool are_waiting : {true, false})
        for (const WrongPlugin &wrong : wrong_plugins(GetParam())) {
            if (!needs_process(wrong) || waits(wrong) != are_waiting)
                continue;
            std::string tests;
            for (const std::string &test : wrong.found_by)
                tests += (tests.empty() ? "" : ",") + test;
            if (are_waiting)
                waiting.emplace_back(wrong, tests);
            else
                MatrixRun(wrong, tests).expect_found();
        }
    for (MatrixRun &run : waiting)
        run.expect_found();
}

INSTANTIATE_TEST_SUITE_P(, Matrix, testing::ValuesIn(kinds), [](const auto &info) { return info.param.prefix; });

class MatrixWhole : public testing::TestWithParam<WrongPlugin> {};

TEST_P(MatrixWhole, FailsExactlyTheListedTests) {
    MatrixRun(GetParam(), GetParam().kind.suite).expect_found();
}

// A correct plugin of each kind, and a wrong one.
std::vector<WrongPlugin> sample() {
    std::vector<WrongPlugin> chosen;
    for (const Kind &kind : kinds) {
        const std::vector<WrongPlugin> plugins = wrong_plugins(kind);
        chosen.insert(chosen.end(), {plugins.at(0), plugins.at(plugins.size() / 2)});
    }
    return chosen;
}
const auto name_of = [](const auto &info) { return info.param.kind.prefix + "_" + info.param.defect; };
INSTANTIATE_TEST_SUITE_P(Sample, MatrixWhole, testing::ValuesIn(sample()), name_of);
INSTANTIATE_TEST_SUITE_P(Exhaustive, MatrixWhole, testing::ValuesIn(all_wrong_plugins()), name_of);

// ---- docs/conformance.md ---------------------------------------------------------------------------

TEST(ConformanceDocument, HasAWrongPluginForEveryTest) {
    std::set<std::string> covered, tests;
    for (const WrongPlugin &wrong : all_wrong_plugins())
        covered.insert(wrong.found_by.begin(), wrong.found_by.end());
    for (const conformance::Test &test : suite())
        tests.insert(test.name);
    EXPECT_EQ(covered, tests);
}

TEST(ConformanceDocument, ListsEveryDefectOfTheWrongPlugins) {
    for (const Kind &kind : kinds) {
        const std::string file = kind.prefix == "rt" ? "wrong.cpp" : "wrong_" + kind.prefix + ".cpp";
        const std::string source = read_file(source_directory() + "/tests/conformance/wrong/" + file);
        std::set<std::string> listed;
        for (const WrongPlugin &wrong : wrong_plugins(kind))
            EXPECT_TRUE(listed.insert(wrong.defect).second) << wrong.defect;
        for (std::size_t at = 0; (at = source.find("has(\"", at)) != std::string::npos;) {
            at += 5;
            EXPECT_THAT(listed, testing::Contains(source.substr(at, source.find('"', at) - at)));
        }
    }
}

TEST(ConformanceDocument, HasEveryTestAndItsRequirement) {
    std::string table = "| test | requirement |\n| --- | --- |\n";
    for (const conformance::Test &test : suite())
        table += "| `" + std::string(test.name) + "` | " + test.requirement + " |\n";
    EXPECT_THAT(document(), HasSubstr(table));
}

} // namespace
} // namespace arhost::test
