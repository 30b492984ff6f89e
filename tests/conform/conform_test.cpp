// SPDX-License-Identifier: Apache-2.0
//
// The program about the tests: what it reports, how, and with which exit status.
#include "conform_run.hpp"

#include <gmock/gmock.h>

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

TEST(Conform, TestsPluginsOfOtherKindsByTheAbisTests) {
    ConformRun run;
    EXPECT_EQ(run.run({ARHOST_PLUGIN_DIRECTORY "/tracker_aruco.so", "--json", "results.json"}), 0) << run.output();
    const nlohmann::json report = run.json("results.json");
    EXPECT_EQ(report.at("results").size(), 9u);
    for (const nlohmann::json &result : report.at("results"))
        EXPECT_THAT(result.at("test").get<std::string>(), testing::StartsWith("abi."));
}

TEST(Conform, SkipsWhatNeedsADeviceThatIsNotThere) {
    ConformRun run;
    EXPECT_EQ(run.run({ARHOST_PLUGIN_DIRECTORY "/source_v4l2.so", "--set", "device=/dev/arhost-none"}), 0);
    EXPECT_THAT(run.output(), HasSubstr("skip     source.start\n         it needs 'video', and start returned "));
    EXPECT_THAT(run.output(), HasSubstr("source.read\n         needs source.start, which has not passed"));
}

TEST(Conform, LeavesNothingOfASinksFilesBehind) {
    ConformRun run;
    std::filesystem::create_directory(run.path("tmp"));
    ::setenv("TMPDIR", run.path("tmp").c_str(), 1);
    run.link_wrong("sink_crash_in_stop");
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
    EXPECT_THAT(xml, HasSubstr("tests=\"9\" failures=\"1\" errors=\"0\" skipped=\"0\""));
    EXPECT_THAT(xml, HasSubstr("<testcase classname=\"abi\" name=\"descriptor\""));
    EXPECT_THAT(xml, HasSubstr("<failure type=\"fail\" message=\"the descriptor's licence is empty\">"));
}

} // namespace
} // namespace arhost::test
