// SPDX-License-Identifier: Apache-2.0
// arhost-conform: options, reports and exit status.
#include "conform_run.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>
#include <png.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdlib>
#include <fcntl.h>
#include <sys/resource.h>
#include <thread>

namespace arhost::test {
namespace {

using testing::HasSubstr;
using testing::Not;

const std::string rt_embree = arhost::test::plugin_directory() + "/rt_embree.so";

TEST(Conform, ListsTheTestsThatAPatternMatches) {
    ConformRun run;
    EXPECT_EQ(run.run({"--list", "--only", "raytracer.*-alpha"}), 0);
    EXPECT_THAT(run.output(), HasSubstr("raytracer.miss-alpha "));
    EXPECT_THAT(run.output(), Not(HasSubstr("abi.")));
}

TEST(Conform, ReportsTheFailureAndTheCommandToRepeatIt) {
    ConformRun run;
    const std::string plugin = run.link_wrong("miss_alpha_1").string();
    EXPECT_EQ(run.run({plugin, "--only", "raytracer.miss-alpha", "--seed", "7", "--set", "samples=2"}), 1);
    EXPECT_THAT(run.output(), HasSubstr("pixel (0, 0): no ray hit, alpha is 1; expected 0"));
    EXPECT_THAT(run.output(),
                HasSubstr("arhost conform " + plugin + " --only raytracer.miss-alpha --seed 7 --set samples=2"));
}

TEST(Conform, ReportsTheSignalAndTheCallOfACrash) {
    ConformRun run;
    EXPECT_EQ(run.run({run.link_wrong("crash_in_render").string(), "--only", "raytracer.render"}), 1);
    EXPECT_THAT(run.output(), HasSubstr("crashed  raytracer.render\n         SIGSEGV in render"));
}

TEST(Conform, SkipsTestsWhoseNeededTestHasNotPassed) {
    ConformRun run;
    EXPECT_EQ(run.run({run.link_wrong("crash_in_create").string()}), 1);
    EXPECT_THAT(run.output(), HasSubstr("raytracer.start\n         needs abi.create, which has not passed"));
}

TEST(Conform, RunsNeededTestsWithoutReportingThem) {
    ConformRun run;
    EXPECT_EQ(run.run({rt_embree, "--only", "raytracer.miss-alpha"}), 0) << run.output();
    EXPECT_THAT(run.output(), Not(HasSubstr("abi.")));
    EXPECT_EQ(run.run({run.link_wrong("crash_in_create").string(), "--only", "abi.longer-options"}), 1);
    EXPECT_THAT(run.output(), HasSubstr("crashed  abi.create\n"));
    EXPECT_THAT(run.output(), HasSubstr("skip     abi.longer-options\n         needs abi.create, which has not "));
}

TEST(Conform, ReportsALoadFailureOnce) {
    ConformRun run;
    run.write("text.so", "no library");
    EXPECT_EQ(run.run({"text.so", "--only", "abi.longer-options"}), 1);
    EXPECT_THAT(run.output(), HasSubstr("fail     abi.load\n"));
    EXPECT_THAT(run.output(), HasSubstr("skip     abi.longer-options\n"));
}

TEST(Conform, FailsIfNoTestRan) {
    ConformRun run;
    EXPECT_EQ(run.run({rt_embree, "--only", "tracker.*"}), 2);
    EXPECT_THAT(run.output(), HasSubstr("no test"));
}

TEST(Conform, FailsIfTheReferenceIsMissing) {
    ConformRun run;
    EXPECT_EQ(run.run({rt_embree, "--only", "raytracer.reference", "--reference", "none.so"}), 2);
    EXPECT_THAT(run.output(), HasSubstr("none.so' does not exist; give --reference FILE"));
}

// An invalid reference is not the plugin's fault.
TEST(Conform, FailsIfTheReferenceCannotBeUsed) {
    ConformRun run;
    run.write("text.so", "no library");
    const std::string crashing = run.link_wrong("crash_in_render").string();
    for (const auto &[reference, why] :
         {std::pair<std::string, std::string>{arhost::test::plugin_directory() + "/tracker_aruco.so",
                                              "tracker_aruco.so' is a tracker but must be a ray tracer"},
          {"text.so", "text.so' cannot be used: abi.load failed: "},
          {crashing, "cannot be used: raytracer.render failed: SIGSEGV in render"}}) {
        EXPECT_EQ(run.run({rt_embree, "--only", "raytracer.reference", "--reference", reference, "--reads",
                           arhost::test::plugin_directory()}),
                  2);
        EXPECT_THAT(run.output(), HasSubstr("error    raytracer.reference\n"));
        EXPECT_THAT(run.output(), HasSubstr(why));
    }
}

TEST(Conform, PrintsTheCommandWithAllOptions) {
    ConformRun run;
    const std::string plugin = run.link_wrong("no_licence").string(), reference = run.link_wrong("none").string();
    EXPECT_EQ(run.run({plugin, "--only", "abi.descriptor", "--reads", arhost::test::plugin_directory(), "--reference",
                       reference, "--timeout-factor", "2.5"}),
              1);
    EXPECT_THAT(run.output(),
                HasSubstr("to repeat: arhost conform " + plugin + " --only abi.descriptor --seed 1 --reads " +
                          arhost::test::plugin_directory() + " --reference " + reference +
                          " --timeout-factor 2.5\n"));
}

TEST(Conform, RejectsInvalidOptions) {
    const std::array<std::array<std::string, 3>, 15> cases = {
        {{"--timeout-factor", "nan", "'nan' must be a number from 0.001 to 1000"},
         {"--timeout-factor", "1e300", "'1e300' must be a number from 0.001 to 1000"},
         {"--seed", "99999999999999999999", "must be a whole number from 0 to 18446744073709551615"},
         {"--seed", "-1", "must be a whole number from 0 to"},
         {"--reads", "", "does not exist"},
         {"--reads", "nowhere", "does not exist: nowhere"},
         {"--reads", "/", "the sandbox cannot grant '/'"},
         {"--sandbox", "strict", "strict not in {standard,permissive,none}"},
         {"--reference", "", "the name is empty"},
         {"--json", "", "the name is empty"},
         {"--print", "1=", "must be ID=FILE"},
         {"--print", "99999999999=a.png", "must be ID=FILE"},
         {"--environment", "A=B", "'A=B' is not a variable name"},
         {"--environment", "A B", "'A B' is not a variable name"},
         {"--environment", "", "'' is not a variable name"}}};
    for (const auto &[option, value, why] : cases) {
        ConformRun run;
        EXPECT_EQ(run.run({rt_embree, "--only", "abi.load", option, value}), 2) << option << " " << value;
        EXPECT_THAT(run.output(), HasSubstr(option));
        EXPECT_THAT(run.output(), HasSubstr(why));
        EXPECT_THAT(run.output(), Not(HasSubstr("abi.load")));
    }
}

TEST(Conform, ChecksBeforeTheRunThatReportsCanBeWritten) {
    ConformRun run;
    std::filesystem::create_directory(run.path("folder"));
    for (const auto &[file, why] : {std::pair<std::string, std::string>{"none/page", "No such file"},
                                    {"folder", "cannot write folder: it is a folder"}})
        for (const std::string option : {"--json", "--junit", "--html"}) {
            EXPECT_EQ(run.run({rt_embree, "--only", "abi.load", option, file}), 2);
            EXPECT_THAT(run.output(), HasSubstr(why));
            EXPECT_THAT(run.output(), Not(HasSubstr("abi.load")));
        }
}

bool has_unfinished_file(const ConformRun &run) {
    const std::filesystem::directory_iterator files(run.path("."));
    return std::any_of(begin(files), end(files), [](const auto &file) { return file.path().extension() == ".tmp"; });
}

TEST(Conform, RejectsTwoReportsInOneFile) {
    ConformRun run;
    EXPECT_EQ(run.run({rt_embree, "--only", "abi.load", "--json", "report", "--html", "./report"}), 2);
    EXPECT_THAT(run.output(), HasSubstr("cannot write ./report: another report is written there"));
    EXPECT_FALSE(has_unfinished_file(run));
}

TEST(Conform, WritesAReportThroughASymbolicLink) {
    ConformRun run;
    run.write("target.json", "earlier");
    std::filesystem::create_symlink("target.json", run.path("link.json"));
    EXPECT_EQ(run.run({rt_embree, "--only", "abi.load", "--json", "link.json"}), 0);
    EXPECT_TRUE(std::filesystem::is_symlink(run.path("link.json")));
    EXPECT_EQ(run.json("target.json").at("exit_status"), 0);
}

TEST(Conform, KeepsAnEarlierReportUntilTheNewOneIsComplete) {
    ConformRun run;
    run.write("results.json", "earlier");
    EXPECT_EQ(run.run({rt_embree, "--only", "tracker.*", "--json", "results.json"}), 2);
    EXPECT_EQ(run.read("results.json"), "earlier");
    EXPECT_FALSE(has_unfinished_file(run));
    EXPECT_EQ(run.run({rt_embree, "--only", "abi.load", "--json", "results.json"}), 0);
    EXPECT_EQ(run.json("results.json").at("exit_status"), 0);
    EXPECT_FALSE(has_unfinished_file(run));
    EXPECT_EQ(run.run({rt_embree, "--only", "abi.load", "--json", "/dev/stdout"}), 0);
    EXPECT_THAT(run.output(), HasSubstr("\"exit_status\": 0"));
}

TEST(Conform, RejectsAReportThatWouldReplaceAnInput) {
    ConformRun run;
    const std::string plugin = run.link_wrong("none").string();
    run.write("print.png", "no picture");
    std::filesystem::create_hard_link(run.path("print.png"), run.path("other.png"));
    for (const std::vector<std::string> &report : {std::vector<std::string>{"--json", plugin},
                                                   {"--junit", rt_embree},
                                                   {"--html", "print.png", "--print", "1=print.png"},
                                                   {"--html", "other.png", "--reads", "print.png"}}) {
        std::vector<std::string> arguments = {plugin, "--only", "abi.load", "--reference", rt_embree};
        arguments.insert(arguments.end(), report.begin(), report.end());
        EXPECT_EQ(run.run(arguments), 2) << report[1];
        EXPECT_THAT(run.output(), HasSubstr("cannot write " + report[1] + ": this run reads that file"));
    }
    EXPECT_EQ(run.read("print.png"), "no picture");
}

TEST(Conform, FailsIfStandardOutputCannotBeWritten) {
    ConformRun run;
    run.start({rt_embree, "--only", "abi.load"}, [] { ::dup2(::open("/dev/full", O_WRONLY), STDOUT_FILENO); });
    EXPECT_EQ(run.wait(), 2);
    EXPECT_THAT(run.output(), HasSubstr("cannot write to standard output: No space left on device"));
}

TEST(Conform, FailsIfTheListCannotBeWritten) {
    ConformRun run;
    run.start({"--list"}, [] { ::dup2(::open("/dev/full", O_WRONLY), STDOUT_FILENO); });
    EXPECT_EQ(run.wait(), 2);
    EXPECT_THAT(run.output(), HasSubstr("No space left on device"));
}

TEST(Conform, ReturnsTheExitStatusIfStandardErrorCannotBeWritten) {
    for (const char *stream : {"/dev/full", "pipe"}) {
        ConformRun run;
        run.start({"nosuch.so"}, [&] {
            int ends[2];
            if (stream != std::string("pipe") || ::pipe2(ends, O_CLOEXEC) != 0)
                ::dup2(::open("/dev/full", O_WRONLY), STDERR_FILENO);
            else
                ::dup2(ends[1], STDERR_FILENO); // its other end is closed by exec
        });
        EXPECT_EQ(run.wait(), 2) << stream;
    }
}

// The output is a full pipe that nobody reads.
TEST(Conform, EndsOnSignalsIfItsOutputIsNotRead) {
    for (const int stream : {STDOUT_FILENO, STDERR_FILENO}) {
        ConformRun run;
        std::filesystem::create_directory(run.path("tmp"));
        int ends[2];
        ASSERT_EQ(::pipe2(ends, O_CLOEXEC), 0);
        ::fcntl(ends[1], F_SETPIPE_SZ, 4096);
        ASSERT_EQ(::write(ends[1], std::string(4096, ' ').data(), 4096), 4096);
        run.start({run.link_wrong("none").string(), "--only", "abi.create", "--json", "results.json", "--environment",
                   "ARHOST_LIST_DESCRIPTORS"},
                  [&] {
                      ::setenv("TMPDIR", run.path("tmp").c_str(), 1);
                      ::setenv("ARHOST_LIST_DESCRIPTORS", "1", 1);
                      ::dup2(ends[1], stream);
                      std::signal(SIGTERM, SIG_DFL);
                  });
        while (run.running() && std::filesystem::is_empty(run.path("tmp"))) // once a test runs, signals are handled
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        std::this_thread::sleep_for(std::chrono::milliseconds(500)); // until its output blocks
        ::kill(run.pid(), SIGTERM);
        EXPECT_EQ(run.wait(), 128 + SIGTERM);
        EXPECT_TRUE(std::filesystem::is_empty(run.path("tmp")));
        EXPECT_FALSE(run.exists("results.json"));
        EXPECT_FALSE(has_unfinished_file(run));
        ::close(ends[0]);
        ::close(ends[1]);
    }
}

TEST(Conform, FailsInAnUnsuitableEnvironment) {
    ConformRun run;
    run.start({rt_embree, "--only", "abi.load"}, [] {
        const rlimit few{16, 16};
        ::setrlimit(RLIMIT_NOFILE, &few);
    });
    EXPECT_EQ(run.wait(), 2);
    EXPECT_THAT(run.output(), HasSubstr("the limit of open files is 16, but "));
    EXPECT_THAT(run.output(), HasSubstr("raise it: ulimit -n "));
    run.start({rt_embree, "--only", "abi.load"}, [] { ::setenv("TMPDIR", "/no/such/folder", 1); });
    EXPECT_EQ(run.wait(), 2);
    EXPECT_THAT(run.output(), HasSubstr("set TMPDIR to an existing folder"));
    std::filesystem::create_directory(run.path("caf\xe9"));
    run.start({rt_embree, "--only", "abi.load"}, [&] { ::setenv("TMPDIR", run.path("caf\xe9").c_str(), 1); });
    EXPECT_EQ(run.wait(), 2);
    EXPECT_THAT(run.output(), HasSubstr("is not UTF-8, but text passed to plugins must be"));
}

TEST(Conform, WorksIfSigchldIsIgnored) {
    ConformRun run;
    run.start({rt_embree, "--only", "abi.load"}, [] { ::signal(SIGCHLD, SIG_IGN); });
    EXPECT_EQ(run.wait(), 0) << run.output();
}

// ---- A plugin's descriptors, processes and messages ------------------------------------------------

TEST(Conform, PassesNoDescriptorsToThePlugin) {
    ConformRun run;
    run.write("secret.txt", "secret");
    run.start({run.link_wrong("none").string(), "--only", "abi.create", "--environment", "ARHOST_LIST_DESCRIPTORS"},
              [] {
                  ::setenv("ARHOST_LIST_DESCRIPTORS", "1", 1);
                  const int secret = ::open("secret.txt", O_RDWR);
                  ::dup2(secret, STDIN_FILENO);
                  ::dup2(secret, 9);
              });
    EXPECT_EQ(run.wait(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("0 is /dev/null"));
    EXPECT_THAT(run.output(), Not(HasSubstr("secret")));
}

// Returns the pid of the process that rt_hangs_with_child_process started.
pid_t wait_for_process(const ConformRun &run) {
    const std::string label = "process ";
    for (int i = 0; i < 5000; ++i) {
        const std::string output = run.output();
        if (const std::size_t at = output.find(label);
            at != std::string::npos && output.find('\n', at) < output.size())
            return std::stoi(output.substr(at + label.size()));
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    throw std::runtime_error("it started no process: " + run.output());
}

TEST(Conform, KillsProcessesStartedByATest) {
    ConformRun run;
    EXPECT_EQ(run.run({run.link_wrong("hangs_with_child_process").string(), "--only", "abi.create", "--allow",
                       "processes"}), // default timeout factor, because abi.load must not time out
              1);
    EXPECT_THAT(run.output(), HasSubstr("timeout  abi.create"));
    EXPECT_FALSE(is_alive(wait_for_process(run)));
}

TEST(Conform, LeavesNothingBehindIfInterrupted) {
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
        ConformRun run;
        std::filesystem::create_directory(run.path("tmp"));
        run.start({run.link_wrong("hangs_with_child_process").string(), "--only", "abi.create", "--allow",
                   "processes", "--json", "results.json"},
                  [&] {
                      ::setenv("TMPDIR", run.path("tmp").c_str(), 1);
                      std::signal(signal, SIG_DFL); // this test's parent may ignore it
                  });
        const pid_t process = wait_for_process(run);
        EXPECT_TRUE(is_alive(process));
        EXPECT_FALSE(std::filesystem::is_empty(run.path("tmp")));
        ::kill(run.pid(), signal);
        EXPECT_EQ(run.wait(), 128 + signal);
        EXPECT_THAT(run.output(), HasSubstr("interrupted after 1 of 2 tests\n"));
        EXPECT_FALSE(is_alive(process));
        EXPECT_TRUE(std::filesystem::is_empty(run.path("tmp")));
        EXPECT_FALSE(run.exists("results.json"));
        EXPECT_FALSE(has_unfinished_file(run));
    }
}

TEST(Conform, FailsAPluginThatWritesToTheSuitesDescriptor) {
    ConformRun run;
    EXPECT_EQ(run.run({run.link_wrong("floods_descriptor_3").string(), "--only", "abi.create"}), 1);
    EXPECT_THAT(run.output(), HasSubstr("more than 32 MiB were written to the suite's result pipe, descriptor 3"));
    EXPECT_EQ(run.run({run.link_wrong("writes_to_descriptor_3").string(), "--only", "abi.create"}), 1);
    EXPECT_THAT(run.output(), HasSubstr("descriptor 3, has an invalid result: '{} {"));
}

TEST(Conform, FailsInvalidDescriptors) {
    const std::array<std::array<std::string, 3>, 4> cases = {
        {{"long_name", "abi.load", "the descriptor's 'name' has 5000000 bytes; the maximum is 4096"},
         {"many_options", "abi.load", "bytes as JSON; the limit is 130048: declare fewer options"},
         {"option_without_key", "abi.load", "its option 1 has no key"},
         {"description_not_utf8", "abi.descriptor", "the descriptor's description is not UTF-8: \"Bas\ufffd"}}};
    for (const auto &[defect, test, why] : cases) {
        ConformRun run;
        EXPECT_EQ(run.run({run.link_wrong(defect).string(), "--only", "abi.*"}), 1);
        EXPECT_THAT(run.output(), HasSubstr("fail     " + test));
        EXPECT_THAT(run.output(), HasSubstr(why));
    }
}

TEST(Conform, RemovesControlCharactersFromAPluginsMessages) {
    ConformRun run;
    EXPECT_EQ(run.run({run.link_wrong("create_fails").string(), "--only", "abi.create", "--junit", "junit.xml",
                       "--html", "page.html"}),
              1);
    EXPECT_THAT(run.output(), HasSubstr("create returned UNSUPPORTED: no [2J \ufffd<&\n"));
    for (const std::string file : {"junit.xml", "page.html"})
        EXPECT_THAT(run.read(file), HasSubstr("create returned UNSUPPORTED: no [2J \ufffd&lt;&amp;"));
}

TEST(Conform, RemovesControlCharactersFromPaths) {
    ConformRun run;
    run.write("a\x1b[2J\xff/text.so", "no library");
    EXPECT_EQ(run.run({"a\x1b[2J\xff/text.so", "--junit", "junit.xml", "--html", "page.html"}), 1);
    for (const std::string &shown : {run.output(), run.read("junit.xml"), run.read("page.html")}) {
        EXPECT_THAT(shown, HasSubstr("a [2J\ufffd/text.so: cannot be loaded"));
        EXPECT_THAT(shown, HasSubstr("a\\x1b[2J\\xff/text.so")); // in the command, for the shell
        EXPECT_THAT(shown, Not(HasSubstr("\x1b")));
        EXPECT_THAT(shown, Not(HasSubstr("\xff")));
    }
}

TEST(Conform, FailsIfThePluginDoesNotExist) {
    ConformRun run;
    EXPECT_EQ(run.run({"nothing.so"}), 2);
    EXPECT_THAT(run.output(), HasSubstr("there is no plugin 'nothing.so'"));
}

TEST(Conform, FindsPluginsByName) {
    ConformRun run;
    EXPECT_EQ(run.run({"sink_null", "--only", "abi.load"}), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("pass     abi.load"));
    EXPECT_EQ(run.run({"sink_nul", "--only", "abi.load"}), 2);
    EXPECT_THAT(run.output(), HasSubstr("there is no plugin 'sink_nul'; did you mean 'sink_null'?"));
    run.link_wrong("miss_alpha_1");
    EXPECT_EQ(run.run({"rt_miss_alpha_1", "--only", "abi.load"}), 2) << "the current folder is not searched";
}

class ConformPython : public testing::Test {
protected:
    void SetUp() override {
        if (std::system("/usr/bin/python3 -c 'import numpy' 2>/dev/null") != 0)
            GTEST_SKIP() << "python3-numpy is not installed";
    }
};

const std::string idle_tracker = "class T:\n"
                                 "    def __init__(self, host): pass\n"
                                 "    def start(self, setup): pass\n"
                                 "    def track(self, frame): return []\n";
const std::string idle_sink = "class S:\n"
                              "    def __init__(self, host): pass\n"
                              "    def start(self, setup): pass\n"
                              "    def write(self, output): pass\n";

TEST_F(ConformPython, RunsAScript) {
    ConformRun run;
    run.write("my.py", idle_tracker + "    def devices(self): return [{'name': 'first', 'is_default': True}, "
                                      "{'name': 'second', 'serial': 's-2'}]\n");
    EXPECT_EQ(run.run({"my.py", "--only", "abi.create,abi.devices,tracker.start"}), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("tracker_python"));
    EXPECT_THAT(run.output(), HasSubstr("pass     tracker.start"));
    EXPECT_THAT(run.output(), testing::ContainsRegex("pass     abi.devices\\s+first, second"));
}

TEST_F(ConformPython, SkipsDevicesOfAScriptThatListsNone) {
    ConformRun run;
    run.write("my.py", idle_tracker);
    EXPECT_EQ(run.run({"my.py", "--only", "abi.create,abi.devices"}), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("skip     abi.devices\n         it does not have the extension"));
}

TEST_F(ConformPython, RejectsAScriptWithoutOrWithSeveralPlugins) {
    ConformRun run;
    run.write("my.py", "def f(:\n");
    EXPECT_EQ(run.run({"my.py"}), 2);
    EXPECT_THAT(run.output(), HasSubstr("my.py' cannot be used as a plugin:"));
    EXPECT_THAT(run.output(), HasSubstr("my.py:1: SyntaxError"));
    run.write("my.py", idle_tracker + idle_sink);
    EXPECT_EQ(run.run({"my.py"}), 2);
    EXPECT_THAT(run.output(),
                HasSubstr("contains several plugins; name one: arhost conform tracker_python|sink_python"));
    EXPECT_EQ(run.run({"sink_python", "--set", "script=my.py", "--only", "abi.create"}), 0) << run.output();
}

TEST(Conform, SkipsTestsOfCapabilitiesThatTheRayTracerLacks) {
    ConformRun run;
    EXPECT_EQ(run.run({run.link_wrong("lambert_only").string(), "--only",
                       "raytracer.translucent-shadow,raytracer.moving-object,raytracer.reference"}),
              0)
        << run.output();
    EXPECT_THAT(run.output(), HasSubstr("skip     raytracer.translucent-shadow\n"
                                        "         ARHOST_CAPABILITY_GLASS is not declared"));
    EXPECT_THAT(run.output(), HasSubstr("skip     raytracer.moving-object\n"
                                        "         ARHOST_CAPABILITY_MOTION is not declared"));
    EXPECT_THAT(run.output(), HasSubstr("pass     raytracer.reference"));
}

TEST(Conform, FailsOnAnUnknownOption) {
    ConformRun run;
    EXPECT_EQ(run.run({rt_embree, "--only", "abi.create", "--set", "sampels=2"}), 2);
    EXPECT_THAT(run.output(), HasSubstr("sampels"));
}

TEST(Conform, FailsOnAnInvalidAddressOfASocket) {
    ConformRun run;
    EXPECT_EQ(run.run({arhost::test::plugin_directory() + "/sink_web.so", "--allow", "listen", "--only", "abi.create",
                       "--set", "listen=local host"}),
              2);
    EXPECT_THAT(run.output(), HasSubstr("option 'listen': 'local host' must be a name"));
}

TEST(Conform, FailsAFileThatIsNotAPlugin) {
    ConformRun run;
    std::ofstream(run.path("text.so")) << "no library";
    EXPECT_EQ(run.run({"text.so"}), 1);
    EXPECT_THAT(run.output(), HasSubstr("cannot be loaded"));
}

TEST(Conform, PassesTheTrackers) {
    for (const std::string name : {"tracker_apriltag", "tracker_aruco"}) {
        ConformRun run;
        EXPECT_EQ(run.run({arhost::test::plugin_directory() + "/" + name + ".so", "--timeout-factor", "3", "--json",
                           "results.json"}),
                  0)
            << run.output();
        const nlohmann::json report = run.json("results.json");
        EXPECT_THAT(report.at("results"), testing::SizeIs(testing::Gt(40)));
    }
}

TEST(Conform, ReportsAMissingFunction) {
    const std::array<std::array<std::string, 3>, 4> cases = {{{"rt", "render", "a ray tracer"},
                                                              {"tracker", "track", "a tracker"},
                                                              {"source", "read", "a source"},
                                                              {"sink", "write", "a sink"}}};
    for (const auto &[kind, function, owner] : cases) {
        ConformRun run;
        EXPECT_EQ(run.run({run.link_wrong("no_" + function, kind).string()}), 1);
        EXPECT_THAT(run.output(),
                    HasSubstr("its function '" + function + "' is NULL, but " + owner + " must have it"));
    }
}

TEST(Conform, ReportsFrameTimesOfPassedTests) {
    ConformRun run;
    run.run({arhost::test::plugin_directory() + "/tracker_aruco.so", "--timeout-factor", "3", "--only",
             "tracker.speed", "--json", "results.json", "--html", "page.html"});
    const auto measured = testing::ContainsRegex("640×480: p50 [0-9.]+ ms, p99 [0-9.]+ ms, of [0-9]+ frames");
    EXPECT_THAT(run.output(), measured);
    EXPECT_THAT(run.json("results.json").at("results")[0].at("message").get<std::string>(), measured);
    EXPECT_THAT(run.read("page.html"), measured);
}

TEST(Conform, RunsOnlyTestsOfThePluginsKind) {
    ConformRun run;
    run.run({arhost::test::plugin_directory() + "/tracker_aruco.so", "--only", "*.start", "--json", "results.json"});
    const nlohmann::json report = run.json("results.json");
    ASSERT_EQ(report.at("results").size(), 1u);
    EXPECT_EQ(report.at("results")[0].at("test"), "tracker.start");
}

// Tag 0 of tag36h11, which the suite does not use by default.
void write_tag(const std::filesystem::path &file) {
    std::string cells = "########"
                        "#..#.#.#"
                        "##...#.#"
                        "##..####"
                        "#.#.####"
                        "##.#..##"
                        "####.###"
                        "########";
    std::ranges::replace(cells, '#', '\0');
    std::ranges::replace(cells, '.', '\xff');
    png_image png{};
    png.version = PNG_IMAGE_VERSION;
    png.width = png.height = 8;
    png.format = PNG_FORMAT_GRAY;
    ASSERT_TRUE(png_image_write_to_file(&png, file.c_str(), 0, cells.data(), 0, nullptr));
}

TEST(Conform, DrawsTheUsersMarkers) {
    ConformRun run;
    write_tag(run.path("tag.png"));
    const std::string tracker = arhost::test::plugin_directory() + "/tracker_apriltag.so", tag = run.path("tag.png");
    EXPECT_EQ(run.run({tracker, "--print", "0=" + tag, "--only", "tracker.*s"}), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("pass     tracker.corners"));
    EXPECT_EQ(run.run({tracker, "--print", "0=" + tag, "--only", "tracker.several"}), 2);
    EXPECT_THAT(run.output(), HasSubstr("the test needs three prints"));
    EXPECT_EQ(run.run({tracker, "--print", "5=" + tag, "--only", "tracker.track"}), 1);
    EXPECT_THAT(run.output(), HasSubstr("it reports marker 0 instead of 5"));
    EXPECT_THAT(run.output(),
                HasSubstr("to repeat: arhost conform " + tracker + " --only tracker.track --seed 1 --print 5="));
}

TEST(Conform, DrawsMarkersOfTheFamilyThatTheTrackerKnows) {
    ConformRun run;
    const std::string aruco = arhost::test::plugin_directory() + "/tracker_aruco.so",
                      apriltag = arhost::test::plugin_directory() + "/tracker_apriltag.so";
    for (const char *family : {"tag36h11", "DICT_6X6_250"}) {
        EXPECT_EQ(run.run({aruco, "--family", family, "--only", "tracker.start,tracker.corners"}), 0) << run.output();
        EXPECT_THAT(run.output(), HasSubstr(std::string("with a marker of ") + family));
    }
    EXPECT_EQ(run.run({apriltag, "--only", "tracker.start"}), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("with a marker of tag36h11"));
    EXPECT_EQ(run.run({apriltag, "--family", "DICT_6X6_250", "--only", "tracker.start"}), 1);
    EXPECT_THAT(run.output(), HasSubstr(" --seed 1 --family DICT_6X6_250"));
    EXPECT_EQ(run.run({apriltag, "--family", "tag16h5", "--only", "tracker.start"}), 2);
    EXPECT_THAT(run.output(),
                HasSubstr("--family tag16h5: the suite draws only tag36h11, DICT_6X6_250, tag25h9; give "
                          "pictures of the markers: --print ID=FILE"));
}

TEST(Conform, TestsATrackerOfBodies) {
    ConformRun run;
    const std::string tracker = arhost::test::test_plugin_directory() + "/tracker_body.so";
    EXPECT_EQ(run.run({tracker, "--body", "head", "--only", "tracker.*"}), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("pass     tracker.body-pose"));
    EXPECT_THAT(run.output(), HasSubstr("skip     tracker.start"));
    EXPECT_EQ(run.run({tracker, "--body", "foot", "--only", "tracker.*"}), 1);
    EXPECT_THAT(run.output(), HasSubstr("there is no body 'foot'; known: head hand"));
    EXPECT_EQ(run.run({tracker, "--only", "tracker.*"}), 1);
    EXPECT_THAT(run.output(),
                HasSubstr("it starts with no marker, and no body is named: give --family NAME or --body "
                          "NAME"));
}

TEST(Conform, ReportsTheOrderOfCornersAndTheirOffset) {
    ConformRun run;
    EXPECT_EQ(run.run({run.link_wrong("corners_from_bottom_left", "tracker").string(), "--only", "tracker.*corner*"}),
              1);
    EXPECT_THAT(run.output(), HasSubstr("the corners begin at the bottom left corner of the upright print and run "
                                        "clockwise; expected top left, top right, bottom right, bottom left"));
    EXPECT_EQ(run.run({run.link_wrong("corners_at_half", "tracker").string(), "--only", "tracker.corners"}), 1);
    EXPECT_THAT(run.output(), testing::ContainsRegex("mean error of the four corners is .0\\.[45]., 0\\.[45].*: "
                                                     "pixel centres are at integers"));
}

TEST(Conform, FailsIfAMarkersPictureCannotBeRead) {
    ConformRun run;
    const std::string tracker = arhost::test::plugin_directory() + "/tracker_apriltag.so";
    EXPECT_EQ(run.run({tracker, "--print", "one=tag.png"}), 2);
    EXPECT_THAT(run.output(), HasSubstr("--print one=tag.png: must be ID=FILE"));
    EXPECT_EQ(run.run({tracker, "--print", "1=none.png", "--only", "tracker.track"}), 2);
    EXPECT_THAT(run.output(), HasSubstr("none.png"));
}

TEST(Conform, SkipsTestsThatNeedAMissingDevice) {
    ConformRun run;
    EXPECT_EQ(run.run({arhost::test::plugin_directory() + "/source_v4l2.so", "--allow", "video", "--set",
                       "device=/dev/arhost-none"}),
              0);
    EXPECT_THAT(run.output(), HasSubstr("skip     source.start\n         it needs 'video', and start returned "));
    EXPECT_THAT(run.output(), HasSubstr("source.read\n         needs source.start, which has not passed"));
}

TEST(Conform, SkipsTestsWithInstancesIfANeedIsNotAllowed) {
    ConformRun run;
    const std::string camera = arhost::test::plugin_directory() + "/source_v4l2.so";
    EXPECT_EQ(run.run({camera}), 0);
    const std::string why = "it needs 'video', which the sandbox does not allow: give --allow video";
    EXPECT_THAT(run.output(), HasSubstr("pass     abi.descriptor"));
    EXPECT_THAT(run.output(), HasSubstr("skip     abi.create\n         " + why));
    EXPECT_THAT(run.output(), HasSubstr("skip     source.seek\n         " + why));
    EXPECT_EQ(run.run({camera, "--only", "abi.create", "--sandbox", "none"}), 0);
    EXPECT_THAT(run.output(), HasSubstr("pass     abi.create"));
    EXPECT_EQ(run.run({camera, "--allow", "vidoe"}), 2);
}

TEST(Conform, RunsThePluginInTheSandbox) {
    ConformRun run;
    const std::string plugin = run.link_wrong("opens_a_socket", "source").string();
    EXPECT_EQ(run.run({plugin, "--only", "source.start", "--reads", "/srv"}), 1);
    EXPECT_THAT(run.output(), HasSubstr("no socket: Operation not permitted"));
    EXPECT_THAT(run.output(), HasSubstr("--only source.start --seed 1 --reads /srv\n"));
    for (const std::vector<std::string> &options :
         {std::vector<std::string>{"--allow", "network"}, {"--sandbox", "none"}}) {
        std::vector<std::string> arguments = {plugin, "--only", "source.start"};
        arguments.insert(arguments.end(), options.begin(), options.end());
        EXPECT_EQ(run.run(arguments), 0) << run.output();
    }
}

TEST(Conform, LetsAPluginWriteOnlyToTheTestsFolder) {
    ConformRun run;
    const std::string plugin = run.link_wrong("writes_beside_library", "sink").string();
    const std::filesystem::path cache = run.path("sink_writes_beside_library.cache");
    EXPECT_EQ(run.run({plugin, "--only", "sink.start"}), 1);
    EXPECT_THAT(run.output(), HasSubstr("cannot write " + cache.string()));
    EXPECT_FALSE(std::filesystem::exists(cache));
    EXPECT_EQ(run.run({plugin, "--only", "sink.start", "--sandbox", "none"}), 0);
    EXPECT_TRUE(std::filesystem::exists(cache));
}

TEST(Conform, ReportsAnUnknownNeed) {
    ConformRun run;
    EXPECT_EQ(run.run({run.link_wrong("unknown_need").string(), "--only", "abi.load"}), 1);
    EXPECT_THAT(run.output(), HasSubstr("it needs 'bluetooth', which this arhost cannot allow; a plugin may need "
                                        "video, usb, gpu, display, network, listen, processes"));
}

TEST(Conform, RemovesASinksFiles) {
    ConformRun run;
    std::filesystem::create_directory(run.path("tmp"));
    run.link_wrong("crash_in_stop", "sink");
    run.start({"sink_crash_in_stop.so", "--only", "sink.w*", "--set", "path=out/frame"},
              [&] { ::setenv("TMPDIR", run.path("tmp").c_str(), 1); });
    EXPECT_EQ(run.wait(), 1);
    EXPECT_THAT(run.output(), HasSubstr("SIGSEGV in stop"));
    EXPECT_TRUE(std::filesystem::is_empty(run.path("tmp")));
    EXPECT_FALSE(std::filesystem::exists(run.path("out")));
}

TEST(Conform, ReportsAFullDiskAsAnErrorOfTheSuite) {
    ConformRun run;
    run.start({arhost::test::plugin_directory() + "/sink_images.so", "--set", "path=%d.png", "--only", "sink.start"},
              [] {
                  const rlimit full{1 << 20, 1 << 20}; // acts like a full disk
                  ::setrlimit(RLIMIT_FSIZE, &full);
              });
    EXPECT_EQ(run.wait(), 2);
    EXPECT_THAT(run.output(), HasSubstr("error    sink.start\n"));
    EXPECT_THAT(run.output(), HasSubstr("has no space for 16 MiB: File too large; free some, or set TMPDIR"));
}

TEST(Conform, FailsASinkThatUsesUpDescriptors) {
    ConformRun run;
    run.start({run.link_wrong("leaks_descriptors", "sink").string(), "--only", "sink.leaks", "--jobs", "1"}, [] {
        const rlimit few{100, 100}; // exhausted after the warm-up
        ::setrlimit(RLIMIT_NOFILE, &few);
    });
    EXPECT_EQ(run.wait(), 1);
    EXPECT_THAT(run.output(), HasSubstr("fail     sink.leaks\n"));
}

TEST(Conform, WritesAPageThatShowsTheWrongPixel) {
    ConformRun run;
    run.run({run.link_wrong("bgra").string(), "--only", "raytracer.reference", "--html", "page.html"});
    const std::string page = run.read("page.html");
    EXPECT_THAT(page, HasSubstr("<figcaption>rendered</figcaption>"));
    EXPECT_THAT(page, HasSubstr("<figcaption>reference</figcaption>"));
    EXPECT_THAT(page, HasSubstr("src=\"data:image/png;base64,iVBORw0KGgo"));
    EXPECT_THAT(page, HasSubstr("<i style=\"left:"));
    EXPECT_THAT(page, Not(HasSubstr("http")));
}

TEST(Conform, WritesJUnitForContinuousIntegration) {
    ConformRun run;
    run.run({run.link_wrong("no_licence").string(), "--only", "abi.*", "--junit", "junit.xml"});
    const std::string xml = run.read("junit.xml");
    EXPECT_THAT(xml, HasSubstr("tests=\"14\" failures=\"1\" errors=\"0\" skipped=\"2\""));
    EXPECT_THAT(xml, HasSubstr("<testcase classname=\"abi\" name=\"descriptor\""));
    EXPECT_THAT(xml, HasSubstr("<failure type=\"fail\" message=\"the descriptor's licence is empty\">"));
}

} // namespace
} // namespace arhost::test
