// SPDX-License-Identifier: Apache-2.0
//
// The program about the tests: what it reports, how, and with which exit status.
#include "conform_run.hpp"

#include <gmock/gmock.h>
#include <png.h>

#include <algorithm>
#include <array>

namespace arhost::test {
namespace {

using testing::HasSubstr;
using testing::Not;

const std::string rt_embree = ARHOST_PLUGIN_DIRECTORY "/rt_embree.so";

TEST(Conform, ListsTheTestsThatAPatternMatches) {
    ConformRun run;
    EXPECT_EQ(run.run({"--list", "--only", "raytracer.*-alpha"}), 0);
    EXPECT_THAT(run.output(), HasSubstr("raytracer.miss-alpha "));
    EXPECT_THAT(run.output(), Not(HasSubstr("abi.")));
}

TEST(Conform, SaysWhatIsWrongWithNumbersAndHowToSeeItAgain) {
    ConformRun run;
    const std::string plugin = run.link_wrong("miss_alpha_1").string();
    EXPECT_EQ(run.run({plugin, "--only", "raytracer.miss-alpha", "--seed", "7", "--set", "samples=2"}), 1);
    EXPECT_THAT(run.output(), HasSubstr("pixel (0, 0): no ray hit, alpha is 1 and must be 0"));
    EXPECT_THAT(run.output(),
                HasSubstr("arhost conform " + plugin + " --only raytracer.miss-alpha --seed 7 --set samples=2"));
}

TEST(Conform, NamesTheSignalAndTheCall) {
    ConformRun run;
    EXPECT_EQ(run.run({run.link_wrong("crash_in_render").string(), "--only", "raytracer.region"}), 1);
    EXPECT_THAT(run.output(), HasSubstr("crashed  raytracer.region\n         SIGSEGV in render"));
}

TEST(Conform, SkipsWhatNeedsATestThatHasNotPassed) {
    ConformRun run;
    EXPECT_EQ(run.run({run.link_wrong("crash_in_create").string()}), 1);
    EXPECT_THAT(run.output(), HasSubstr("raytracer.start\n         needs abi.create, which has not passed"));
}

TEST(Conform, ErrsWhereNoTestRan) {
    ConformRun run;
    EXPECT_EQ(run.run({rt_embree, "--only", "tracker.*"}), 2);
    EXPECT_THAT(run.output(), HasSubstr("no test"));
}

TEST(Conform, ErrsWhereTheReferenceIsMissing) {
    ConformRun run;
    EXPECT_EQ(run.run({rt_embree, "--only", "raytracer.reference", "--reference", "none.so"}), 2);
    EXPECT_THAT(run.output(), HasSubstr("none.so' is not there; give --reference FILE"));
}

TEST(Conform, ErrsOnAPluginThatIsNotThere) {
    ConformRun run;
    EXPECT_EQ(run.run({"nothing.so"}), 2);
    EXPECT_THAT(run.output(), HasSubstr("there is no plugin 'nothing.so'"));
}

TEST(Conform, ErrsOnAnOptionThatThePluginHasNot) {
    ConformRun run;
    EXPECT_EQ(run.run({rt_embree, "--only", "abi.create", "--set", "sampels=2"}), 2);
    EXPECT_THAT(run.output(), HasSubstr("sampels"));
}

TEST(Conform, FailsAFileThatIsNoPlugin) {
    ConformRun run;
    std::ofstream(run.path("text.so")) << "no library";
    EXPECT_EQ(run.run({"text.so"}), 1);
    EXPECT_THAT(run.output(), HasSubstr("can't be loaded"));
}

TEST(Conform, PassesTheTrackers) {
    for (const std::string name : {"tracker_apriltag", "tracker_aruco"}) {
        ConformRun run;
        EXPECT_EQ(run.run({ARHOST_PLUGIN_DIRECTORY "/" + name + ".so", "--patience", "3", "--json", "results.json"}),
                  0)
            << run.output();
        const nlohmann::json report = run.json("results.json");
        EXPECT_THAT(report.at("results"), testing::SizeIs(testing::Gt(40)));
    }
}

TEST(Conform, SaysWhichFunctionIsMissing) {
    const std::array<std::array<std::string, 3>, 4> lacking = {{{"rt", "render", "a ray tracer"},
                                                                {"tracker", "track", "a tracker"},
                                                                {"source", "read", "a source"},
                                                                {"sink", "write", "a sink"}}};
    for (const auto &[kind, function, owner] : lacking) {
        ConformRun run;
        EXPECT_EQ(run.run({run.link_wrong("no_" + function, kind).string()}), 1);
        EXPECT_THAT(run.output(),
                    HasSubstr("its function '" + function + "' is NULL, which " + owner + " must have"));
    }
}

TEST(Conform, TellsHowLongAFrameTakesWhereItIsSoonEnoughToo) {
    ConformRun run;
    run.run({ARHOST_PLUGIN_DIRECTORY "/tracker_aruco.so", "--patience", "3", "--only", "tracker.speed", "--json",
             "results.json", "--html", "page.html"});
    const auto measured = testing::ContainsRegex("640×480: p50 [0-9.]+ ms, p99 [0-9.]+ ms, of [0-9]+ frames");
    EXPECT_THAT(run.output(), measured);
    EXPECT_THAT(run.json("results.json").at("results")[0].at("message").get<std::string>(), measured);
    EXPECT_THAT(run.read("page.html"), measured);
}

TEST(Conform, RunsTheTestsOfThePluginsKindAlone) {
    ConformRun run;
    run.run({ARHOST_PLUGIN_DIRECTORY "/tracker_aruco.so", "--only", "*.start", "--json", "results.json"});
    const nlohmann::json report = run.json("results.json");
    ASSERT_EQ(report.at("results").size(), 1u);
    EXPECT_EQ(report.at("results")[0].at("test"), "tracker.start");
}

// Of tag36h11, which is none of the suite's own.
void write_tag_0(const std::filesystem::path &file) {
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

TEST(Conform, DrawsTheMarkersThatAreGiven) {
    ConformRun run;
    write_tag_0(run.path("tag.png"));
    const std::string tracker = ARHOST_PLUGIN_DIRECTORY "/tracker_apriltag.so", tag = run.path("tag.png");
    EXPECT_EQ(run.run({tracker, "--print", "0=" + tag, "--only", "tracker.*s"}), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("pass     tracker.corners"));
    EXPECT_EQ(run.run({tracker, "--print", "0=" + tag, "--only", "tracker.several"}), 2);
    EXPECT_THAT(run.output(), HasSubstr("it takes three prints"));
    EXPECT_EQ(run.run({tracker, "--print", "5=" + tag, "--only", "tracker.track"}), 1);
    EXPECT_THAT(run.output(), HasSubstr("0 markers are seen and must be one"));
    EXPECT_THAT(run.output(),
                HasSubstr("again: arhost conform " + tracker + " --only tracker.track --seed 1 --print 5="));
}

TEST(Conform, ErrsOnAMarkerThatCantBeRead) {
    ConformRun run;
    const std::string tracker = ARHOST_PLUGIN_DIRECTORY "/tracker_apriltag.so";
    EXPECT_EQ(run.run({tracker, "--print", "one=tag.png"}), 2);
    EXPECT_THAT(run.output(), HasSubstr("--print one=tag.png: must be ID=FILE"));
    EXPECT_EQ(run.run({tracker, "--print", "1=none.png", "--only", "tracker.track"}), 2);
    EXPECT_THAT(run.output(), HasSubstr("none.png"));
}

TEST(Conform, SkipsWhatNeedsADeviceThatIsNotThere) {
    ConformRun run;
    EXPECT_EQ(
        run.run({ARHOST_PLUGIN_DIRECTORY "/source_v4l2.so", "--allow", "video", "--set", "device=/dev/arhost-none"}),
        0);
    EXPECT_THAT(run.output(), HasSubstr("skip     source.start\n         it needs 'video', and start returned "));
    EXPECT_THAT(run.output(), HasSubstr("source.read\n         needs source.start, which has not passed"));
}

TEST(Conform, SkipsWhatMakesAnInstanceWhereANeedIsNotAllowed) {
    ConformRun run;
    const std::string camera = ARHOST_PLUGIN_DIRECTORY "/source_v4l2.so";
    EXPECT_EQ(run.run({camera}), 0);
    const std::string why = "it needs 'video', which the sandbox keeps from it: give --allow video";
    EXPECT_THAT(run.output(), HasSubstr("pass     abi.descriptor"));
    EXPECT_THAT(run.output(), HasSubstr("skip     abi.create\n         " + why));
    EXPECT_THAT(run.output(), HasSubstr("skip     source.seek\n         " + why));
    EXPECT_EQ(run.run({camera, "--only", "abi.create", "--sandbox", "none"}), 0);
    EXPECT_THAT(run.output(), HasSubstr("pass     abi.create"));
    EXPECT_EQ(run.run({camera, "--allow", "vidoe"}), 2);
}

TEST(Conform, PutsThePluginIntoTheSandboxOfARun) {
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

TEST(Conform, LetsAPluginWriteIntoItsTestsFolderAlone) {
    ConformRun run;
    const std::string plugin = run.link_wrong("caches_beside_its_library", "sink").string();
    const std::filesystem::path cache = run.path("sink_caches_beside_its_library.cache");
    EXPECT_EQ(run.run({plugin, "--only", "sink.start"}), 1);
    EXPECT_THAT(run.output(), HasSubstr("can't write " + cache.string()));
    EXPECT_FALSE(std::filesystem::exists(cache));
    EXPECT_EQ(run.run({plugin, "--only", "sink.start", "--sandbox", "none"}), 0);
    EXPECT_TRUE(std::filesystem::exists(cache));
}

TEST(Conform, NamesTheNeedThatIsUnknown) {
    ConformRun run;
    EXPECT_EQ(run.run({run.link_wrong("needs_what_is_unknown").string(), "--only", "abi.load"}), 1);
    EXPECT_THAT(run.output(), HasSubstr("it needs 'bluetooth', which this arhost can't allow; what a plugin may need "
                                        "is video, usb, gpu, display, network, processes"));
}

TEST(Conform, LeavesNothingOfASinksFilesBehind) {
    ConformRun run;
    std::filesystem::create_directory(run.path("tmp"));
    ::setenv("TMPDIR", run.path("tmp").c_str(), 1);
    run.link_wrong("crash_in_stop", "sink");
    EXPECT_EQ(run.run({"sink_crash_in_stop.so", "--only", "sink.w*", "--set", "path=out/frame"}), 1);
    EXPECT_THAT(run.output(), HasSubstr("SIGSEGV in stop"));
    EXPECT_TRUE(std::filesystem::is_empty(run.path("tmp")));
    EXPECT_FALSE(std::filesystem::exists(run.path("out")));
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
    EXPECT_THAT(xml, HasSubstr("tests=\"11\" failures=\"1\" errors=\"0\" skipped=\"0\""));
    EXPECT_THAT(xml, HasSubstr("<testcase classname=\"abi\" name=\"descriptor\""));
    EXPECT_THAT(xml, HasSubstr("<failure type=\"fail\" message=\"the descriptor's licence is empty\">"));
}

} // namespace
} // namespace arhost::test
