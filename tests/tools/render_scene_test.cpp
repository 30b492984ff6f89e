// SPDX-License-Identifier: Apache-2.0
#include "plugin_under_test.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <sys/wait.h>

namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

const std::string counter = arhost::test::test_plugin_directory() + "/rt_counter.so";

class RenderScene : public testing::Test {
protected:
    // The output file's bytes; empty if the program fails.
    std::string picture(const std::string &scene, const std::string &options,
                        const std::string &samples = "--samples 1") const {
        const fs::path file = scratch_.path() / "picture.ppm";
        fs::remove(file);
        const std::string command = arhost::test::build_directory() + "/bin/render-scene " +
                                    arhost::test::source_directory() + "/config/scenes/" + scene +
                                    ".yaml --size 80x60 --output " + file.string() + " " + samples + " " + options +
                                    " > " + (scratch_.path() / "output.txt").string() + " 2>&1";
        status_ = std::system(command.c_str());
        return read(file);
    }
    const fs::path &folder() const { return scratch_.path(); }
    int status_of(const std::string &arguments) const {
        const int status = std::system((arhost::test::build_directory() + "/bin/render-scene" + arguments + " > " +
                                        (scratch_.path() / "output.txt").string() + " 2>&1")
                                           .c_str());
        return WEXITSTATUS(status);
    }
    std::string printed() const { return read(scratch_.path() / "output.txt"); }
    bool failed() const { return status_ != 0; }

private:
    static std::string read(const fs::path &file) {
        std::ifstream stream(file, std::ios::binary);
        return {std::istreambuf_iterator<char>(stream), {}};
    }

    arhost::test::ScratchFolder scratch_;
    mutable int status_ = 0;
};

} // namespace

TEST_F(RenderScene, ShowsMovingObjectsAtTheGivenTime) {
    const std::string early = picture("moving", "--time 1"), late = picture("moving", "--time 2.5");
    ASSERT_FALSE(early.empty()) << printed();
    EXPECT_NE(early, late);
    EXPECT_EQ(picture("moving", "--time 8.5"), late) << "a loop takes 6 s";
    EXPECT_EQ(picture("moving", ""), picture("moving", "--time 0"));
}

TEST_F(RenderScene, RejectsAnOutputThatIsASceneInput) {
    const fs::path scene = folder() / "wood.png";
    std::ofstream(scene) << "version: 1\n";
    const std::string named = " " + scene.string() + " --output " + (folder() / "link.png").string();
    fs::create_hard_link(scene, folder() / "link.png");
    EXPECT_EQ(status_of(named), 1);
    EXPECT_THAT(printed(), HasSubstr("link.png: the scene reads this file; choose another"));
    EXPECT_EQ(fs::file_size(scene), 11u);
}

TEST_F(RenderScene, ReportsUsageErrorsInOneLineWithoutTerminalControls) {
    EXPECT_EQ(status_of(" a.yaml --output a.png '--no\x1b[2Jsuch'"), 2);
    EXPECT_THAT(printed(), AllOf(HasSubstr("--no [2Jsuch"), Not(HasSubstr("\x1b"))));
    EXPECT_EQ(status_of(" 'no\x1b[2Jsuch.yaml' --output " + (folder() / "a.png").string()), 1);
    EXPECT_THAT(printed(), AllOf(HasSubstr("no [2Jsuch.yaml"), Not(HasSubstr("\x1b"))));
    EXPECT_FALSE(fs::exists(folder() / "a.png"));
}

TEST_F(RenderScene, HelpShowsTheSyntaxOfPointsAndSizes) {
    EXPECT_EQ(status_of(" --help"), 0);
    EXPECT_THAT(printed(), AllOf(HasSubstr("--eye X,Y,Z"), HasSubstr("--size WIDTHxHEIGHT")));
}

TEST_F(RenderScene, IgnoresTheTimeOfAStaticScene) {
    const std::string still = picture("demo", "");
    ASSERT_FALSE(still.empty()) << printed();
    EXPECT_EQ(picture("demo", "--time 2.5"), still);
}

TEST_F(RenderScene, PassesLightSamplesToThePlugin) {
    const std::string few = picture("moving", "--light-samples 1");
    ASSERT_FALSE(few.empty()) << printed();
    EXPECT_NE(picture("moving", "--light-samples 4"), few);
    EXPECT_EQ(picture("moving", "--light-samples 4"), picture("moving", "")) << "as the plugin's default";
}

TEST_F(RenderScene, RejectsInvalidTimesAndSampleCounts) {
    for (const char *option : {"--time -1", "--time soon", "--light-samples 0", "--samples 257"}) {
        EXPECT_EQ(picture("moving", option), "") << option;
        EXPECT_TRUE(failed()) << option;
        EXPECT_NE(printed().find(std::string(option).substr(0, std::string(option).find(' '))), std::string::npos)
            << printed();
    }
}

TEST_F(RenderScene, RunsAnyRayTracerByNameOrFile) {
    const std::string embree = picture("demo", "");
    ASSERT_FALSE(embree.empty()) << printed();
    EXPECT_EQ(picture("demo", "--raytracer rt_embree"), embree) << printed();
    EXPECT_EQ(picture("demo", "--raytracer " + arhost::test::plugin_directory() + "/rt_embree.so"), embree)
        << printed();

    // rt_counter draws a square in the corner whose colour encodes the camera distance; the rest is checkerboard.
    const std::string counted = picture("demo", "--eye 0,0,513 --raytracer " + counter, "");
    ASSERT_FALSE(counted.empty()) << printed();
    const std::string header = "P6\n80 60\n255\n";
    ASSERT_EQ(counted.size(), header.size() + 80 * 60 * 3);
    EXPECT_EQ(counted.substr(0, header.size() + 3), header + std::string("\x0d\x00\xaa", 3));
    EXPECT_EQ(counted.substr(counted.size() - 3), "\xb0\xb0\xb0");
    ::setenv("ARHOST_PLUGIN_PATH", arhost::test::test_plugin_directory().c_str(), 1);
    EXPECT_EQ(picture("demo", "--eye 0,0,513 --raytracer rt_counter", ""), counted) << printed();
    ::unsetenv("ARHOST_PLUGIN_PATH");
}

TEST_F(RenderScene, PassesOptionsToThePlugin) {
    const std::string one = picture("demo", ""), four = picture("demo", "", "--samples 4");
    ASSERT_FALSE(one.empty()) << printed();
    EXPECT_NE(four, one);
    EXPECT_EQ(picture("demo", "--set samples=4", ""), four);
    EXPECT_EQ(picture("demo", "--set samples=4"), four) << "--set overrides --samples";
    EXPECT_EQ(picture("demo", "", ""), picture("demo", "", "--samples 16")) << "the default";
    EXPECT_EQ(picture("moving", "--set light_samples=2"), picture("moving", "--light-samples 2"));
    EXPECT_EQ(picture("demo", "--set threads=1 --set instruction_set=base"), one);
}

TEST_F(RenderScene, ReportsErrorsOfThePluginAndItsOptions) {
    const auto rejected = [&](const std::string &options, const std::string &samples = "") {
        EXPECT_EQ(picture("demo", options, samples), "") << options;
        EXPECT_TRUE(failed()) << options;
        return printed();
    };
    EXPECT_THAT(rejected("--raytracer rt_embre"),
                HasSubstr("--raytracer: there is no plugin 'rt_embre'; did you mean 'rt_embree'?"));
    EXPECT_THAT(rejected("--raytracer ./nowhere.so"), HasSubstr("--raytracer: there is no plugin '"));
    EXPECT_THAT(rejected("--raytracer sink_null"), HasSubstr("--raytracer: 'sink_null' is a sink, not a ray tracer"));
    EXPECT_THAT(rejected("--raytracer " + arhost::test::test_plugin_directory() + "/no_plugin.so"),
                HasSubstr("is not an arhost plugin"));
    EXPECT_THAT(rejected("--set sampels=4"), HasSubstr("--set: sampels: unknown key; did you mean 'samples'?"));
    EXPECT_THAT(rejected("--set samples=1000"), HasSubstr("--set: samples: "));
    EXPECT_THAT(rejected("--set samples"), HasSubstr("--set samples: the argument must be key=value"));
    EXPECT_THAT(rejected("--raytracer " + counter, "--samples 2"), HasSubstr("--samples: samples: unknown key"));
    // Expects the plugin's log message, then the failed call.
    EXPECT_THAT(
        rejected("--set reject=true --raytracer " + counter),
        HasSubstr(
            "rejected, as the option 'reject' requests\nrender-scene: rt_counter: create: configuration error"));
    EXPECT_THAT(rejected("--set error_at=13 --eye 0,0,513 --raytracer " + counter),
                HasSubstr("rt_counter: render: internal error"));
}
