// SPDX-License-Identifier: Apache-2.0
//
// Runs the whole suite on every wrong plugin, and on further configurations of shipped plugins. Too slow for each
// push: tools/test --exhaustive.
#include "matrix_run.hpp"
#include "matrix_sinks.hpp"
#include "matrix_sources.hpp"
#include "matrix_trackers.hpp"
#include "own_plugins.hpp"

namespace arhost::test {
namespace {

class MatrixExhaustive : public testing::TestWithParam<WrongPlugin> {};

TEST_P(MatrixExhaustive, FailsExactlyTheListedTests) {
    expect_found(GetParam(), whole_suite(GetParam()));
}

const auto defect = [](const auto &info) { return info.param.defect; };
INSTANTIATE_TEST_SUITE_P(RayTracer, MatrixExhaustive, testing::ValuesIn(wrong_plugins), defect);
INSTANTIATE_TEST_SUITE_P(Tracker, MatrixExhaustive, testing::ValuesIn(wrong_trackers), defect);
INSTANTIATE_TEST_SUITE_P(Body, MatrixExhaustive, testing::ValuesIn(wrong_bodies), defect);
INSTANTIATE_TEST_SUITE_P(Source, MatrixExhaustive, testing::ValuesIn(wrong_sources), defect);
INSTANTIATE_TEST_SUITE_P(Sink, MatrixExhaustive, testing::ValuesIn(wrong_sinks), defect);

class OwnPluginsExhaustive : public testing::TestWithParam<OwnPlugin> {};

TEST_P(OwnPluginsExhaustive, PassTheSuite) {
    expect_to_pass(GetParam());
}

INSTANTIATE_TEST_SUITE_P(
    All, OwnPluginsExhaustive,
    testing::Values(OwnPlugin{"FilePicture", "source_file", {"path=in/00.png"}},
                    OwnPlugin{"FileLoop", "source_file", {"path=in/a.mp4", "loop=true", "frames=30"}},
                    OwnPlugin{"LastImage", "sink_images", {"path=last.jpg"}},
                    OwnPlugin{"Mpeg4", "sink_video", {"path=video.mkv", "codec=mpeg4"}},
                    OwnPlugin{"SessionH264", "sink_session", {"path=session", "codec=h264"}},
                    OwnPlugin{"Dissertation", "sink_trajectory", {"path=run.txt", "format=dissertation"}}),
    [](const auto &info) { return info.param.name; });

} // namespace
} // namespace arhost::test
