// SPDX-License-Identifier: Apache-2.0
//
// Shipped sources and sinks pass the suite; exhaustive_test.cpp has further configurations. matrix.hpp covers
// rt_embree (defect "none"), and Conform.PassesTheTrackers the trackers.
#include "own_plugins.hpp"

namespace arhost::test {
namespace {

class OwnPlugins : public testing::TestWithParam<OwnPlugin> {};

TEST_P(OwnPlugins, PassTheSuite) {
    expect_to_pass(GetParam());
}

INSTANTIATE_TEST_SUITE_P(
    All, OwnPlugins,
    testing::Values(
        OwnPlugin{"Synthetic", "source_synthetic", {"width=160", "height=120", "frames=60"}},
        OwnPlugin{"FilePictures", "source_file", {"path=in/%02d.png"}},
        OwnPlugin{"FileVideo", "source_file", {"path=in/a.mp4"}}, OwnPlugin{"Camera", "source_v4l2", {}, "video"},
        OwnPlugin{"Images", "sink_images", {"path=%03d.png"}}, OwnPlugin{"Video", "sink_video", {"path=video.mp4"}},
        OwnPlugin{"Poses", "sink_poses", {"path=poses.jsonl"}},
        OwnPlugin{"Trajectory", "sink_trajectory", {"path=run.trajectory.jsonl"}}, OwnPlugin{"Null", "sink_null", {}},
        OwnPlugin{"Session", "sink_session", {"path=session"}}, OwnPlugin{"Window", "sink_window", {}, "display"},
        OwnPlugin{"Web", "sink_web", {}, "listen"}, OwnPlugin{"Control", "sink_control", {}, "listen"},
        OwnPlugin{"Pipe", "sink_pipe", {"path=-"}}, OwnPlugin{"PipePixels", "sink_pipe", {"path=-", "format=rgba"}},
        OwnPlugin{"V4l2", "sink_v4l2", {"device=/dev/video10"}, "video"}),
    [](const auto &info) { return info.param.name; });

} // namespace
} // namespace arhost::test
