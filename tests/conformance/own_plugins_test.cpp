// SPDX-License-Identifier: Apache-2.0
//
// Shipped plugins pass the suite, without arguments where they need none. The defect "none" in matrix_test.cpp covers
// rt_embree and tracker_apriltag.
#include "conform_run.hpp"

#include <directories.hpp>
#include <gtest/gtest.h>

namespace arhost::test {
namespace {

struct OwnPlugin {
    std::string name, plugin;
    std::vector<std::string> settings;
    std::string allow = "";
};
std::ostream &operator<<(std::ostream &stream, const OwnPlugin &configuration) {
    return stream << configuration.name;
}

class OwnPlugins : public testing::TestWithParam<OwnPlugin> {};

TEST_P(OwnPlugins, PassTheSuite) {
    const OwnPlugin &configuration = GetParam();
    // Input of source_file: 12 pictures and a video of them.
    ArhostRun run("version: 1\n"
                  "source: {plugin: source_synthetic, options: {width: 160, height: 120, frames: 12}}\n"
                  "outputs: [{plugin: sink_images, path: in/%02d.png}, {plugin: sink_video, path: in/a.mp4}]\n");
    if (configuration.plugin == "source_file") {
        ASSERT_EQ(run.run(), 0) << run.output();
    }
    std::vector<std::string> arguments = {
        "conform",          arhost::test::plugin_directory() + "/" + configuration.plugin + ".so",
        "--jobs",           "1",
        "--timeout-factor", "3",
        "--json",           "results.json"};
    for (const std::string &setting : configuration.settings)
        arguments.insert(arguments.end(), {"--set", setting});
    if (!configuration.allow.empty())
        arguments.insert(arguments.end(), {"--allow", configuration.allow});
    run.start(arguments);
    EXPECT_EQ(run.wait(std::chrono::minutes(3)), 0) << run.output();
    const nlohmann::json report = nlohmann::json::parse(run.read("results.json"));
    for (const nlohmann::json &result : report.at("results"))
        if (configuration.plugin == "sink_video" && result.at("test") == "sink.order") {
            EXPECT_EQ(result.at("verdict"), "pass") << result;
        }
    for (const nlohmann::json &result : report.at("results"))
        if (result.at("verdict") == "skip" && result.at("test").get<std::string>().ends_with(".start"))
            GTEST_SKIP() << result.at("message").get<std::string>();
}

const auto name_of = [](const auto &info) { return info.param.name; };
INSTANTIATE_TEST_SUITE_P(
    All, OwnPlugins,
    testing::Values(OwnPlugin{"ArUco", "tracker_aruco", {}}, OwnPlugin{"Patterns", "tracker_pattern", {}},
                    OwnPlugin{"Vulkan", "rt_vulkan", {}}, OwnPlugin{"Embree", "rt_embree", {}},
                    OwnPlugin{"Reference", "rt_embree", {"quality=reference"}},
                    OwnPlugin{"DefaultPictures", "source_file", {}},
                    OwnPlugin{"Synthetic", "source_synthetic", {"width=160", "height=120", "frames=60"}},
                    OwnPlugin{"FilePictures", "source_file", {"path=in/%02d.png"}},
                    OwnPlugin{"FileVideo", "source_file", {"path=in/a.mp4"}},
                    OwnPlugin{"Camera", "source_v4l2", {}, "video"}, OwnPlugin{"Images", "sink_images", {}},
                    OwnPlugin{"Video", "sink_video", {}}, OwnPlugin{"Poses", "sink_poses", {}},
                    OwnPlugin{"Trajectory", "sink_trajectory", {}}, OwnPlugin{"Null", "sink_null", {}},
                    OwnPlugin{"Session", "sink_session", {}}, OwnPlugin{"Window", "sink_window", {}, "display"},
                    OwnPlugin{"Web", "sink_web", {}, "listen"}, OwnPlugin{"Control", "sink_control", {}, "listen"},
                    OwnPlugin{"Pipe", "sink_pipe", {}},
                    OwnPlugin{"PipePixels", "sink_pipe", {"path=-", "format=rgba"}},
                    OwnPlugin{"V4l2", "sink_v4l2", {"device=/dev/video10"}, "video"}),
    name_of);
INSTANTIATE_TEST_SUITE_P(
    Exhaustive, OwnPlugins,
    testing::Values(OwnPlugin{"AprilTag", "tracker_apriltag", {}}, OwnPlugin{"Pictures", "tracker_image", {}},
                    OwnPlugin{"FilePicture", "source_file", {"path=in/00.png"}},
                    OwnPlugin{"FileLoop", "source_file", {"path=in/a.mp4", "loop=true", "frames=30"}},
                    OwnPlugin{"PythonSource", "source_python", {}}, OwnPlugin{"PythonTracker", "tracker_python", {}},
                    OwnPlugin{"PythonRaytracer", "rt_python", {}}, OwnPlugin{"PythonSink", "sink_python", {}},
                    OwnPlugin{"LastImage", "sink_images", {"path=last.jpg"}},
                    OwnPlugin{"Mpeg4", "sink_video", {"path=video.mkv", "codec=mpeg4"}},
                    OwnPlugin{"SessionH264", "sink_session", {"path=session", "codec=h264"}},
                    OwnPlugin{"Dissertation", "sink_trajectory", {"path=run.txt", "format=dissertation"}}),
    name_of);

} // namespace
} // namespace arhost::test
