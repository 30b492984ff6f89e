// SPDX-License-Identifier: Apache-2.0
//
// Runs of arhost with sink_pipe, in the sandbox.
#include "../../system/arhost_run.hpp"
#include "fifo.hpp"
#include "waiting.hpp"

#include <gmock/gmock.h>

#include <arpa/inet.h>
#include <future>
#include <netinet/in.h>
#include <sys/socket.h>

namespace fs = std::filesystem;
using namespace arhost::test;
using testing::HasSubstr;
using testing::StartsWith;

namespace {

constexpr std::size_t frame_bytes = 6 + 160 * 120 * 3 / 2; // of Y4M with the size below

std::string yaml(const std::string &output, const std::string &source = "frames: 30", const std::string &more = "") {
    return "version: 1\nsource: {plugin: source_synthetic, options: {width: 160, height: 120, " + source +
           "}}\noutputs: [{plugin: sink_pipe, " + output + "}]\nstats: stats.json\n" + more;
}

void wait_for_output(const ArhostRun &run, const std::string &text) {
    EXPECT_TRUE(run.wait_for_output(text)) << run.output();
}

// A run that writes to a FIFO, with a reader.
struct FifoRun : ArhostRun {
    explicit FifoRun(const std::string &output_options = "") : ArhostRun(yaml("path: out/fifo" + output_options)) {
        make_fifo(fifo);
    }
    const fs::path fifo = path("out/fifo");
};

std::size_t frames_in(const std::string &stream) {
    return (stream.size() - stream.find('\n') - 1) / frame_bytes;
}

} // namespace

TEST(PipeRun, FfmpegDecodesEachFrameOfAFifo) {
    if (std::system("ffmpeg -version >/dev/null 2>&1") != 0)
        GTEST_SKIP() << "needs ffmpeg";
    FifoRun run;
    auto decoded = std::async(std::launch::async, [&] {
        return std::system(
            ("timeout 60 ffmpeg -loglevel error -i " + run.fifo.string() + " -f framemd5 " + run.path("md5").string())
                .c_str());
    });
    EXPECT_EQ(run.run(), 0) << run.output();
    EXPECT_EQ(decoded.get(), 0);
    EXPECT_EQ(count_of(run.read("md5"), "\n0,"), 30u) << run.read("md5");
}

TEST(PipeRun, StandardOutputHasOnlyTheVideo) {
    for (const char *path : {"\"-\"", "/dev/stdout"}) {
        ArhostRun run(yaml("path: " + std::string(path)));
        run.start({"--config", "run.yaml"},
                  [] { ::dup2(::open("video.y4m", O_CREAT | O_WRONLY | O_CLOEXEC, 0600), STDOUT_FILENO); });
        EXPECT_EQ(run.wait(), 0) << run.output();
        const std::string video = run.read("video.y4m");
        EXPECT_THAT(video, StartsWith("YUV4MPEG2 W160 H120 "));
        EXPECT_EQ(video.size(), video.find('\n') + 1 + 30 * frame_bytes);
    }
}

namespace {

std::string poses_yaml(const std::string &output) {
    return "version: 1\nsource: {plugin: source_synthetic, options: {width: 160, height: 120, frames: 30}}\n"
           "outputs: [{plugin: sink_poses, " +
           output + "}]\n";
}

void expect_lines_of_all_frames(const std::string &text) {
    EXPECT_EQ(count_of(text, "\n"), 30u);
    EXPECT_THAT(text, testing::AllOf(StartsWith("{\"frame\": 0, "), HasSubstr("}\n{\"frame\": 29, "),
                                     testing::EndsWith("}\n")));
}

} // namespace

TEST(PosesRun, StandardOutputHasOnlyTheLines) {
    ArhostRun run(poses_yaml("path: \"-\""));
    run.start({"--config", "run.yaml"},
              [] { ::dup2(::open("poses.jsonl", O_CREAT | O_WRONLY | O_CLOEXEC, 0600), STDOUT_FILENO); });
    EXPECT_EQ(run.wait(), 0) << run.output();
    expect_lines_of_all_frames(run.read("poses.jsonl"));
}

TEST(PosesRun, AFifoReceivesTheLines) {
    ArhostRun run(poses_yaml("path: out/fifo"));
    const fs::path fifo = make_fifo(run.path("out/fifo"));
    auto text = std::async(std::launch::async, [&] { return FifoReader(fifo).read_all(); });
    EXPECT_EQ(run.run(), 0) << run.output();
    expect_lines_of_all_frames(text.get());
}

TEST(PosesRun, EachFrameIsADatagram) {
    const arhost::base::UniqueFd socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    ASSERT_EQ(::bind(socket.get(), reinterpret_cast<const sockaddr *>(&address), size), 0);
    ASSERT_EQ(::getsockname(socket.get(), reinterpret_cast<sockaddr *>(&address), &size), 0);
    const std::string options = "options: {udp: \"127.0.0.1:" + std::to_string(ntohs(address.sin_port)) + "\"}";
    ArhostRun run(poses_yaml("allow: [network], " + options));
    EXPECT_EQ(run.run(), 0) << run.output();
    std::string text(1 << 20, '\0');
    std::size_t used = 0;
    for (ssize_t got = 0; (got = ::recv(socket.get(), text.data() + used, text.size() - used, MSG_DONTWAIT)) > 0;) {
        EXPECT_EQ(text[used], '{');
        used += static_cast<std::size_t>(got);
        EXPECT_EQ(text[used - 1], '\n');
    }
    text.resize(used);
    expect_lines_of_all_frames(text);

    for (const std::string receiver : {"127.0.0.1:9", "localhost:9"}) {
        run.write("run.yaml", poses_yaml("options: {udp: \"" + receiver + "\"}"));
        EXPECT_EQ(run.run(), 2);
        EXPECT_THAT(run.messages(), HasSubstr("this output needs 'allow: [network]'")) << receiver;
    }
}

TEST(PosesRun, NeedsOneReceiver) {
    for (const char *output :
         {"allow: [network]", "path: out/a.jsonl, allow: [network], options: {udp: \"127.0.0.1:9\"}"}) {
        ArhostRun run(poses_yaml(output));
        run.expect(2, {"set either 'path' or the option 'udp'"});
    }
}

TEST(PipeRun, TheOverlayAloneMatchesTheComposite) {
    ArhostRun run("version: 1\nframes: 3\n"
                  "source: {plugin: source_synthetic, options: {width: 160, height: 120, id: 0, side_mm: 80}}\n"
                  "tracker: {plugin: tracker_aruco, targets: [{marker: 0, family: tag36h11, side_mm: 80}]}\n"
                  "raytracer: {plugin: rt_embree, scene: demo}\n"
                  "outputs:\n"
                  "  - {plugin: sink_pipe, path: out/frame, options: {format: rgba}}\n"
                  "  - {plugin: sink_pipe, path: out/overlay, options: {format: rgba, content: overlay}}\n");
    const auto read_all = [](const fs::path &fifo) {
        return std::async(std::launch::async, [fifo] { return FifoReader(fifo).read_all(); });
    };
    auto frames = read_all(make_fifo(run.path("out/frame"))), overlays = read_all(make_fifo(run.path("out/overlay")));
    ASSERT_EQ(run.run(), 0) << run.output();
    const std::string frame = frames.get(), overlay = overlays.get();
    ASSERT_EQ(frame.size(), 3u * 160 * 120 * 4);
    ASSERT_EQ(overlay.size(), frame.size());
    std::size_t opaque = 0, partial = 0, clear = 0;
    for (std::size_t i = 0; i < overlay.size(); i += 4) {
        const auto alpha = static_cast<std::uint8_t>(overlay[i + 3]);
        ++(alpha == 255 ? opaque : alpha == 0 ? clear : partial);
        if (alpha == 255) {
            ASSERT_EQ(overlay.compare(i, 3, frame, i, 3), 0) << "pixel " << i / 4;
        }
    }
    EXPECT_GT(opaque, 500u);
    EXPECT_GT(partial, 100u) << "shadows";
    EXPECT_GT(clear, 10'000u);
}

TEST(PipeRun, AClosedReaderOfStandardOutputEndsTheRun) {
    int ends[2];
    ASSERT_EQ(::pipe2(ends, O_CLOEXEC), 0);
    ArhostRun run(yaml("path: \"-\"", "frames: 100000"));
    run.start({"--config", "run.yaml"}, [&] { ::dup2(ends[1], STDOUT_FILENO); });
    ::close(ends[1]);
    char bytes[1000];
    EXPECT_GT(::read(ends[0], bytes, sizeof bytes), 0);
    ::close(ends[0]);
    EXPECT_EQ(run.wait(), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("the reader of standard output has closed it"));
}

TEST(PipeRun, OnlyOneOutputMayUseStandardOutputIfItSupportsIt) {
    for (const auto &[outputs, error] :
         {std::pair{"{plugin: sink_trajectory, path: \"-\"}",
                    "run.yaml:3:43: outputs[0].path: sink_trajectory cannot write to standard output; name a file"},
          {"{plugin: sink_pipe, path: \"-\"}, {plugin: sink_pipe, path: /dev/stdout}",
           "another output already writes"}}) {
        ArhostRun run("version: 1\nsource: {plugin: source_synthetic, options: {frames: 1}}\noutputs: [" +
                      std::string(outputs) + "]\n");
        EXPECT_EQ(run.run(), 2) << run.output();
        EXPECT_THAT(run.output(), HasSubstr(error));
    }
}

TEST(PipeRun, CheckOpensTheFifoWithoutAReader) {
    FifoRun run;
    EXPECT_EQ(run.run({"check", "run.yaml"}), 0) << run.output();
    EXPECT_THAT(run.output(), HasSubstr("output: sink_pipe: " + fs::canonical(run.fifo).string()));
}

// The reader pauses longer than the deadline of a frame.
TEST(PipeRun, APausedReaderDoesNotEndALockstepRun) {
    FifoRun run(", deadline_ms: 500");
    run.start();
    const FifoReader reader(run.fifo);
    wait_for_output(run, "which has paused");
    const std::string video = reader.read_all();
    EXPECT_EQ(run.wait(), 0) << run.output();
    EXPECT_EQ(frames_in(video), 30u);
    EXPECT_EQ(run.stats()["restarts"]["sink_pipe"], 0);
}

TEST(PipeRun, APausedReaderOnlyDropsItsOwnFramesOfALiveRun) {
    ArhostRun run("version: 1\nmode: live\n"
                  "source: {plugin: source_synthetic, fps: 100, options: {width: 160, height: 120, frames: 600}}\n"
                  "outputs: [{plugin: sink_pipe, path: out/fifo}, {plugin: sink_poses, path: out/poses.jsonl}]\n"
                  "stats: stats.json\n");
    make_fifo(run.path("out/fifo"));
    run.start();
    const FifoReader reader(run.path("out/fifo"));
    const auto lines = [&] {
        return count_of(run.exists("out/poses.jsonl") ? run.read("out/poses.jsonl") : "", "\n");
    };
    EXPECT_TRUE(run.eventually([&] { return lines() >= 150; })) << "the paused reader holds up the run";
    const std::string video = reader.read_all();
    EXPECT_EQ(run.wait(), 0) << run.output();
    EXPECT_EQ(count_of(video, "YUV4MPEG2"), 1u);
    EXPECT_EQ((video.size() - video.find('\n') - 1) % frame_bytes, 0u);
    EXPECT_GT(run.stats()["frames"]["dropped"]["sink_pipe"], 0) << run.stats();
}

TEST(PipeRun, AnInterruptEndsARunThatWaitsForAReader) {
    FifoRun run;
    run.start();
    wait_for_output(run, "waiting for a program to read");
    send_signal(run.pid(), SIGINT);
    EXPECT_EQ(run.wait(), 130) << run.output();
}

TEST(PipeRun, AKilledWorkerCutsTheStreamAndEndsTheOutput) {
    FifoRun run;
    run.start();
    const FifoReader reader(run.fifo);
    std::string video = reader.read(200 + 4 * frame_bytes);
    send_signal(run.worker("sink_pipe"), SIGKILL);
    video += reader.read_all();
    EXPECT_EQ(run.wait(), 1) << run.output();
    EXPECT_EQ(count_of(video, "YUV4MPEG2"), 1u);
    EXPECT_THAT(run.output(), HasSubstr("was cut when this output was restarted"));
}

TEST(PipeRun, AKilledWorkerBeginsAnotherStreamForTheNextReader) {
    FifoRun run(", options: {reopen: true}");
    run.start();
    std::string first;
    {
        const FifoReader reader(run.fifo);
        first = reader.read(200 + 4 * frame_bytes);
        send_signal(run.worker("sink_pipe"), SIGKILL);
        first += reader.read_all();
    }
    EXPECT_EQ(count_of(first, "YUV4MPEG2"), 1u);
    const std::string second = FifoReader(run.fifo).read_all();
    EXPECT_EQ(run.wait(), 0) << run.output();
    EXPECT_THAT(second, StartsWith("YUV4MPEG2 "));
    EXPECT_GE(frames_in(first) + frames_in(second), 30u) << "a frame is missing";
}
