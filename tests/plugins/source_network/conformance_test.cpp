// SPDX-License-Identifier: Apache-2.0
//
// Runs the conformance suite with a network camera.
#include "arhost_run.hpp"
#include "camera_server.hpp"

#include <directories.hpp>
#include <gmock/gmock.h>

using namespace arhost::test;
using testing::HasSubstr;

TEST(NetworkRun, PassesTheConformanceSuite) {
    ARHOST_REQUIRE_FFMPEG();
    const Media media;
    const CameraServer server("http", media);
    ArhostRun run;
    run.start({"conform", arhost::test::plugin_directory() + "/source_network.so", "--allow", "network", "--jobs",
               "4", "--timeout-factor", "3", "--set", "url=" + server.url("mjpeg")});
    EXPECT_EQ(run.wait(std::chrono::minutes(3)), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("pass     source.start"));
}
