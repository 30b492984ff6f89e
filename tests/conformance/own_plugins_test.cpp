// SPDX-License-Identifier: Apache-2.0
//
// arhost's own sources and sinks keep the ABI's promises; rt_embree is matrix.hpp's first.
#include "conform_run.hpp"

#include <gmock/gmock.h>

namespace arhost::test {
namespace {

struct Own {
    std::string name, plugin;
    std::vector<std::string> settings;
    std::string allow = "";
};
std::ostream &operator<<(std::ostream &stream, const Own &own) {
    return stream << own.name;
}

// 12 pictures, and a film of them.
const char *const inputs =
    "version: 1\n"
    "source: {plugin: source_synthetic, options: {width: 160, height: 120, frames: 12}}\n"
    "outputs: [{plugin: sink_images, path: in/%02d.png}, {plugin: sink_video, path: in/a.mp4}]\n";

class OwnPlugin : public testing::TestWithParam<Own> {};

TEST_P(OwnPlugin, KeepsItsPromises) {
    ArhostRun run(inputs);
    if (GetParam().plugin == "source_file") {
        ASSERT_EQ(run.run(), 0) << run.output();
    }
    std::vector<std::string> arguments = {"conform",          ARHOST_PLUGIN_DIRECTORY "/" + GetParam().plugin + ".so",
                                          "--jobs",           "1",
                                          "--timeout-factor", "3",
                                          "--json",           "results.json"};
    for (const std::string &setting : GetParam().settings)
        arguments.insert(arguments.end(), {"--set", setting});
    if (!GetParam().allow.empty())
        arguments.insert(arguments.end(), {"--allow", GetParam().allow});
    run.start(arguments);
    EXPECT_EQ(run.wait(std::chrono::minutes(3)), 0) << run.output();
    const nlohmann::json report = nlohmann::json::parse(run.read("results.json"));
    for (const nlohmann::json &result : report.at("results"))
        if (result.at("verdict") == "skip" && result.at("test").get<std::string>().ends_with(".start"))
            GTEST_SKIP() << result.at("message").get<std::string>();
}

INSTANTIATE_TEST_SUITE_P(
    All, OwnPlugin,
    testing::Values(Own{"Synthetic", "source_synthetic", {"width=160", "height=120", "frames=60"}},
                    Own{"FilePictures", "source_file", {"path=in/%02d.png"}},
                    Own{"FilePicture", "source_file", {"path=in/00.png"}},
                    Own{"FileFilm", "source_file", {"path=in/a.mp4"}},
                    Own{"FileLoop", "source_file", {"path=in/a.mp4", "loop=true", "frames=30"}},
                    Own{"Camera", "source_v4l2", {}, "video"}, Own{"Images", "sink_images", {"path=%03d.png"}},
                    Own{"LastImage", "sink_images", {"path=last.jpg"}}, Own{"Film", "sink_video", {"path=film.mp4"}},
                    Own{"Mpeg4", "sink_video", {"path=film.mkv", "codec=mpeg4"}},
                    Own{"Poses", "sink_poses", {"path=poses.jsonl"}},
                    Own{"Trajectory", "sink_trajectory", {"path=run.trajectory.jsonl"}},
                    Own{"Dissertation", "sink_trajectory", {"path=run.txt", "format=dissertation"}},
                    Own{"Null", "sink_null", {}}, Own{"Window", "sink_window", {}, "display"}),
    [](const auto &info) { return info.param.name; });

} // namespace
} // namespace arhost::test
