// SPDX-License-Identifier: Apache-2.0
//
// Runs arhost with network cameras, inside the sandbox.
#include "arhost_run.hpp"
#include "camera_server.hpp"
#include "waiting.hpp"

#include <gmock/gmock.h>

using namespace arhost::test;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

namespace {

std::string configuration(const std::string &source, int frames) {
    return "version: 1\nmode: live\nframes: " + std::to_string(frames) + "\nsource: {" + source +
           "}\noutputs: [{plugin: sink_null}]\nstats: stats.json\ntimeline: timeline.csv\n";
}

} // namespace

TEST(NetworkRun, PlaysInTheSandboxWithoutShowingThePassword) {
    ARHOST_REQUIRE_RTSP_SERVER();
    const Media media;
    const CameraServer server("rtsp", media);
    for (const char *transport : {"tcp", "udp"}) {
        ArhostRun run(configuration("plugin: source_network, conform: true, allow: [network], options: {transport: " +
                                        std::string(transport) + ", url: \"" +
                                        server.url("private", user_and_password) + "\"}",
                                    50));
        ASSERT_EQ(run.run(), 0) << run.output();
        const auto stats = run.stats();
        EXPECT_EQ(stats["frames"]["in"], 50);
        for (const auto &[name, check] : stats["conformance"].items())
            EXPECT_EQ(check["violations"], 0) << name << ": " << check;
        for (const char *file : {"output.txt", "stats.json", "timeline.csv"})
            EXPECT_THAT(run.read(file), AllOf(Not(HasSubstr("s3cr")), Not(HasSubstr("camera:")))) << file;
    }
}

TEST(NetworkRun, NeedsThePermissionNetwork) {
    ArhostRun run(configuration("plugin: source_network, options: {url: \"http://camera:s3cret@host/\"}", 1));
    EXPECT_EQ(run.run(), 2);
    EXPECT_THAT(
        run.output(),
        HasSubstr("'source_network' needs 'network', which the sandbox blocks: add 'allow: [network]' to source"));
    EXPECT_THAT(run.output(), Not(HasSubstr("s3cret")));
}

TEST(NetworkRun, AnUnreachableCameraIsAnErrorWithoutRetries) {
    ArhostRun run(configuration("plugin: source_network, allow: [network], "
                                "options: {url: \"http://camera:s3cret@127.0.0.1:1/?key=s3cret\"}",
                                1));
    EXPECT_EQ(run.run(), 2);
    EXPECT_THAT(run.output(), AllOf(HasSubstr("run.yaml:4"),
                                    HasSubstr("the stream 'http://127.0.0.1:1/?…' cannot be received: "
                                              "Connection refused"),
                                    Not(HasSubstr("s3cret")), Not(HasSubstr("restarting"))));
}

TEST(NetworkRun, SourceFileSaysHowToPlayAUrl) {
    for (const char *place : {"path: %", "options: {path: %}"}) {
        std::string source = "plugin: source_file, " + std::string(place);
        source.replace(source.find('%'), 1, "\"rtsp://camera:s3cret@host/live\"");
        ArhostRun run(configuration(source, 1));
        EXPECT_EQ(run.run(), 2);
        EXPECT_THAT(run.output(), AllOf(HasSubstr("run.yaml:4"),
                                        HasSubstr("is a URL, but 'source_file' reads only files; for "
                                                  "network cameras write 'source: {plugin: "
                                                  "source_network, allow: [network], options: {url: …}}'"),
                                        Not(HasSubstr("s3cret"))));
    }
}

// The outage exceeds deadline_ms, after which the host would kill a hanging worker.
TEST(NetworkRun, ContinuesWhenTheCameraComesBack) {
    ARHOST_REQUIRE_FFMPEG();
    const Media media;
    CameraServer server("http", media);
    const auto deadline = scaled(std::chrono::seconds(1));
    ArhostRun run(
        configuration("plugin: source_network, allow: [network], deadline_ms: " + std::to_string(deadline.count()) +
                          ", options: {url: \"" + server.url("mjpeg", user_and_password) + "\"}",
                      100));
    run.start();
    const auto wait_for = [&](const char *text) {
        EXPECT_TRUE(eventually([&] { return run.output().find(text) != std::string::npos; })) << run.output();
    };
    wait_for("160×120 px");
    server.kill();
    wait_for("reconnecting until it is back");
    std::this_thread::sleep_for(2.5 * deadline); // the outage
    server.start();
    EXPECT_EQ(run.wait(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("is back"));
    EXPECT_EQ(run.stats()["frames"]["in"], 100);
    EXPECT_EQ(run.stats()["restarts"]["source"], 0);
    EXPECT_EQ(run.stats()["counters"]["source"]["lost_connections"], 1);
}
