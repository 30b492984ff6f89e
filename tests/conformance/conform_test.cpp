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
#include <regex>
#include <sys/resource.h>

namespace arhost::test {
namespace {

using testing::HasSubstr;
using testing::Not;

const std::string rt_embree = arhost::test::plugin_directory() + "/rt_embree.so";

// ---- Text and exit status of one run ---------------------------------------------------------------

struct Case {
    Case(std::string b, std::string a, int s, std::vector<std::string> t)
        : behaviour(std::move(b)), arguments(std::move(a)), status(s), texts(std::move(t)) {}
    std::string behaviour;
    std::string arguments; // "./rt_bgra.so" is a wrong plugin, and "@" the folder of the shipped plugins
    int status;
    std::vector<std::string> texts; // in the output, or not if they begin with '!'
};
class ConformCase : public testing::TestWithParam<Case> {};

TEST_P(ConformCase, HasTextAndStatus) {
    ConformRun run;
    run.write("text.so", "no library");
    const auto with_folder = [](std::string text) {
        if (const std::size_t at = text.find('@'); at != std::string::npos)
            text.replace(at, 1, plugin_directory());
        return text;
    };
    std::vector<std::string> arguments;
    std::istringstream words(with_folder(GetParam().arguments));
    for (std::string word; words >> word;) {
        if (word.starts_with("./")) {
            const std::string name = std::filesystem::path(word).stem();
            const std::size_t kind = name.find('_');
            run.link_wrong(name.substr(kind + 1), name.substr(0, kind));
        }
        arguments.push_back(word);
    }
    EXPECT_EQ(run.run(arguments), GetParam().status) << run.output();
    for (const std::string &text : GetParam().texts)
        if (text.starts_with('!'))
            EXPECT_THAT(run.output(), Not(HasSubstr(text.substr(1))));
        else
            EXPECT_THAT(run.output(), HasSubstr(with_folder(text)));
}

const std::string not_allowed = "it needs 'video', which the sandbox does not allow: give --allow video";
const Case cases[] = {
    Case("ListsTheTestsThatAPatternMatches", "--list --only raytracer.*-alpha", 0,
         {"raytracer.miss-alpha ", "!abi."}),
    Case("ReportsTheFailureAndTheCommandToRepeatIt",
         "./rt_miss_alpha_1.so --only raytracer.miss-alpha --seed 7 --set samples=2", 1,
         {"pixel (0, 0): no ray hit, alpha is 1; expected 0",
          "/rt_miss_alpha_1.so --only raytracer.miss-alpha --seed 7 --set samples=2"}),
    Case("PrintsTheCommandWithAllOptions",
         "./rt_no_licence.so --only abi.descriptor --reads @ --reference ./rt_none.so --timeout-factor 2.5", 1,
         {"to repeat: arhost conform /", "/rt_no_licence.so --only abi.descriptor --seed 1 --reads @ --reference /",
          "rt_none.so --timeout-factor 2.5\n"}),
    Case("ReportsTheSignalAndTheCallOfACrash", "./rt_crash_in_render.so --only raytracer.render", 1,
         {"crashed  raytracer.render\n         SIGSEGV in render"}),
    Case("SkipsTestsWhoseNeededTestHasNotPassed", "./rt_crash_in_create.so", 1,
         {"raytracer.start\n         needs abi.create, which has not passed"}),
    Case("RunsNeededTestsWithoutReportingThem", "rt_embree --only raytracer.miss-alpha", 0, {"!abi."}),
    Case("ReportsNeededTestsThatFail", "./rt_crash_in_create.so --only abi.longer-options", 1,
         {"crashed  abi.create\n", "skip     abi.longer-options\n         needs abi.create, which has not "}),
    Case("ReportsALoadFailureOnce", "text.so --only abi.longer-options", 1,
         {"fail     abi.load\n", "cannot be loaded", "skip     abi.longer-options\n"}),
    Case("FailsIfNoTestRan", "rt_embree --only tracker.*", 2, {"no test"}),
    Case("FailsIfThePluginDoesNotExist", "nothing.so", 2, {"there is no plugin 'nothing.so'"}),
    Case("FailsOnAnUnknownOption", "rt_embree --only abi.create --set sampels=2", 2, {"sampels"}),
    // An invalid reference is not the plugin's fault.
    Case("FailsIfTheReferenceIsMissing", "rt_embree --only raytracer.reference --reference none.so", 2,
         {"none.so' does not exist; give --reference FILE"}),
    Case("FailsIfTheReferenceIsATracker", "rt_embree --only raytracer.reference --reference @/tracker_aruco.so", 2,
         {"error    raytracer.reference\n", "tracker_aruco.so' is a tracker but must be a ray tracer"}),
    Case("FailsIfTheReferenceIsNoLibrary", "rt_embree --only raytracer.reference --reference text.so", 2,
         {"error    raytracer.reference\n", "text.so' cannot be used: abi.load failed: "}),
    Case("FailsIfTheReferenceCrashes",
         "rt_embree --only raytracer.reference --reads @ --reference ./rt_crash_in_render.so", 2,
         {"error    raytracer.reference\n", "cannot be used: raytracer.render failed: SIGSEGV in render"}),
    Case("FailsAPluginThatFloodsTheSuitesDescriptor", "./rt_floods_descriptor_3.so --only abi.create", 1,
         {"more than 32 MiB were written to the suite's result pipe, descriptor 3"}),
    Case("FailsAPluginThatWritesToTheSuitesDescriptor", "./rt_writes_to_descriptor_3.so --only abi.create", 1,
         {"descriptor 3, has an invalid result: '{} {"}),
    Case("FailsALongName", "./rt_long_name.so --only abi.*", 1,
         {"fail     abi.load", "the descriptor's 'name' has 5000000 bytes; the maximum is 4096"}),
    Case("FailsManyOptions", "./rt_many_options.so --only abi.*", 1,
         {"fail     abi.load", "bytes as JSON; the limit is 130048: declare fewer options"}),
    Case("FailsAnOptionWithoutAKey", "./rt_option_without_key.so --only abi.*", 1,
         {"fail     abi.load", "its option 1 has no key"}),
    Case("FailsADescriptionThatIsNotUtf8", "./rt_description_not_utf8.so --only abi.*", 1,
         {"fail     abi.descriptor", "the descriptor's description is not UTF-8: \"Bas\ufffd"}),
    Case(
        "ReportsAnUnknownNeed", "./rt_unknown_need.so --only abi.load", 1,
        {"it needs 'bluetooth', which this arhost cannot allow; a plugin may need video, usb, gpu, display, network, "
         "listen, processes"}),
    Case("ReportsAMissingRender", "./rt_no_render.so", 1,
         {"its function 'render' is NULL, but a ray tracer must have it"}),
    Case("ReportsAMissingTrack", "./tracker_no_track.so", 1,
         {"its function 'track' is NULL, but a tracker must have it"}),
    Case("ReportsAMissingRead", "./source_no_read.so", 1, {"its function 'read' is NULL, but a source must have it"}),
    Case("ReportsAMissingWrite", "./sink_no_write.so", 1, {"its function 'write' is NULL, but a sink must have it"}),
    Case("SkipsTestsOfCapabilitiesThatTheRayTracerLacks",
         "./rt_lambert_only.so --only raytracer.translucent-shadow,raytracer.moving-object,raytracer.reference", 0,
         {"skip     raytracer.translucent-shadow\n         ARHOST_RAYTRACER_CAPABILITY_GLASS is not declared",
          "skip     raytracer.moving-object\n         ARHOST_RAYTRACER_CAPABILITY_MOTION is not declared",
          "pass     raytracer.reference"}),
    Case("PassesTheRayTracerThatShadesFewerPixels", "rt_embree --only raytracer.shading", 0,
         {"pass     raytracer.shading"}),
    Case("DrawsTag36h11", "tracker_aruco --family tag36h11 --only tracker.start,tracker.corners", 0,
         {"with a marker of tag36h11"}),
    Case("DrawsDict6x6", "tracker_aruco --family DICT_6X6_250 --only tracker.start,tracker.corners", 0,
         {"with a marker of DICT_6X6_250"}),
    Case("DrawsTheFamilyThatTheTrackerKnows", "tracker_apriltag --only tracker.start", 0,
         {"with a marker of tag36h11"}),
    Case("DrawsPatterns", "tracker_pattern --only tracker.start,tracker.track", 0, {"with a marker of pattern"}),
    Case("DrawsMatrixCodes", "tracker_pattern --family artoolkit-5x5-bch-22-7-7 --only tracker.start,tracker.corners",
         0, {"with a marker of artoolkit-5x5-bch-22-7-7"}),
    Case("DrawsPictures", "tracker_image --only tracker.start,tracker.copies", 0, {"with a marker of image"}),
    Case("GivesASourceAnInput", "source_file --only source.start,source.read", 0, {"pass     source.read"}),
    Case("GivesASinkOfNumberedFilesAnOutput", "sink_images --only sink.start,sink.files", 0, {"pass     sink.files"}),
    Case("GivesASinkAnOutputWhoseNameItAccepts", "sink_video --only sink.start,sink.files", 0,
         {"pass     sink.files"}),
    Case("GivesASinkStandardOutput", "sink_pipe --only sink.start", 0, {"pass     sink.start"}),
    Case("FailsIfTheTrackerDoesNotKnowTheFamily", "tracker_apriltag --family DICT_6X6_250 --only tracker.start", 1,
         {" --seed 1 --family DICT_6X6_250"}),
    Case("FailsIfTheSuiteDoesNotDrawTheFamily", "tracker_apriltag --family tag16h5 --only tracker.start", 2,
         {"--family tag16h5: the suite draws only tag36h11, DICT_6X6_250, tag25h9, pattern, image, "
          "artoolkit-5x5-bch-22-7-7; give pictures of the markers: --print ID=FILE"}),
    Case("FailsIfAPrintHasNoId", "tracker_apriltag --print one=tag.png", 2, {"--print one=tag.png: must be ID=FILE"}),
    Case("FailsIfAPrintCannotBeRead", "tracker_apriltag --print 1=none.png --only tracker.track", 2, {"none.png"}),
    Case(
        "ReportsTheOrderOfCorners", "./tracker_corners_from_bottom_left.so --only tracker.*corner*", 1,
        {"the corners begin at the bottom left corner of the upright print and run clockwise; expected top left, top "
         "right, bottom right, bottom left"}),
    Case("TestsATrackerOfBodies", "tracker_body --body head --only tracker.*", 0,
         {"pass     tracker.body-pose", "skip     tracker.start"}),
    Case("FailsIfTheTrackerDoesNotKnowTheBody", "tracker_body --body foot --only tracker.*", 1,
         {"there is no body 'foot'; known: head hand"}),
    Case("FailsIfNoBodyIsNamed", "tracker_body --only tracker.*", 1,
         {"it starts with no marker, and no body is named: give --family NAME or --body NAME"}),
    Case("SkipsTestsThatNeedAMissingDevice", "source_v4l2 --allow video --set device=/dev/arhost-none", 0,
         {"skip     source.start\n         it needs 'video', and start returned ",
          "source.read\n         needs source.start, which has not passed"}),
    Case("SkipsTestsWithInstancesIfANeedIsNotAllowed", "source_v4l2", 0,
         {"pass     abi.descriptor", "skip     abi.create\n         " + not_allowed,
          "skip     source.seek\n         " + not_allowed}),
    Case("AllowsEveryNeedWithoutASandbox", "source_v4l2 --only abi.create --sandbox none", 0,
         {"pass     abi.create"}),
    Case("RejectsAnUnknownNeed", "source_v4l2 --allow vidoe", 2, {"vidoe"}),
    Case("RunsThePluginInTheSandbox", "./source_opens_a_socket.so --only source.start --reads /srv", 1,
         {"no socket: Operation not permitted", "--only source.start --seed 1 --reads /srv\n"}),
    Case("AllowsTheNetwork", "./source_opens_a_socket.so --only source.start --allow network", 0, {}),
    Case("RunsThePluginWithoutASandbox", "./source_opens_a_socket.so --only source.start --sandbox none", 0, {}),
};
INSTANTIATE_TEST_SUITE_P(, ConformCase, testing::ValuesIn(cases),
                         [](const auto &info) { return info.param.behaviour; });

// ---- Options and reports ---------------------------------------------------------------------------

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

// Whether a process waits for two descriptors without a timeout, as base::write_all does.
bool waits_until_it_can_write(pid_t pid) {
    std::istringstream text(read_file("/proc/" + std::to_string(pid) + "/syscall"));
    std::string number, descriptors, count, timeout; // of poll, or a null pointer of ppoll
    return text >> number >> descriptors >> count >> timeout && count == "0x2" &&
           (timeout == "0xffffffff" || timeout == "0x0");
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
        EXPECT_TRUE(run.eventually([&] { return waits_until_it_can_write(run.pid()); }));
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
    std::smatch pid;
    std::string output;
    if (!run.eventually(
            [&] { return std::regex_search(output = run.output(), pid, std::regex("process ([0-9]+)\n")); }))
        throw std::runtime_error("it started no process: " + output);
    return std::stoi(pid[1]);
}

TEST(Conform, KillsProcessesStartedByATest) {
    ConformRun run;
    EXPECT_EQ(run.run({run.link_wrong("hangs_with_child_process").string(), "--only", "abi.create", "--allow",
                       "processes", "--timeout-factor", "0.3"}),
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

TEST(Conform, FailsOnAnInvalidAddressOfASocket) {
    ConformRun run;
    EXPECT_EQ(run.run({arhost::test::plugin_directory() + "/sink_web.so", "--allow", "listen", "--only", "abi.create",
                       "--set", "listen=local host"}),
              2);
    EXPECT_THAT(run.output(), HasSubstr("option 'listen': 'local host' must be a name"));
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

TEST(Conform, ReportsTheOffsetOfCorners) {
    ConformRun run;
    EXPECT_EQ(run.run({run.link_wrong("corners_at_half", "tracker").string(), "--only", "tracker.corners"}), 1);
    EXPECT_THAT(run.output(), testing::ContainsRegex("mean error of the four corners is .0\\.[45]., 0\\.[45].*: "
                                                     "pixel centres are at integers"));
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
