// SPDX-License-Identifier: Apache-2.0
//
// arhost-calibrate and arhost-map with files of strangers, and with signals.
#include "program_test.hpp"

#include "base/unique_fd.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <opencv2/imgcodecs.hpp>
#include <sys/socket.h>
#include <sys/stat.h>

namespace {

using arhost::base::UniqueFd;
using testing::HasSubstr;

struct Program {
    const char *name, *arguments;
};

void PrintTo(const Program &program, std::ostream *out) {
    *out << program.name;
}

class EveryReader : public arhost::test::ProgramTest, public testing::WithParamInterface<Program> {
protected:
    void SetUp() override {
        write("camera.yaml",
              "image_width: 640\nimage_height: 480\ncamera_matrix: {rows: 3, cols: 3, data: [600, 0, 320, "
              "0, 600, 240, 0, 0, 1]}\ndistortion_model: plumb_bob\ndistortion_coefficients: {rows: 1, "
              "cols: 5, data: [0, 0, 0, 0, 0]}\n");
        cv::imwrite(folder() / "grey.png", cv::Mat(480, 640, CV_8U, cv::Scalar(128)));
    }
    std::string command(const std::string &input) const {
        return program(GetParam().name) + input + " " + GetParam().arguments;
    }
};

INSTANTIATE_TEST_SUITE_P(Frames, EveryReader,
                         testing::Values(Program{"arhost-calibrate", "--chessboard 9x6 --square 36 -o out.yaml"},
                                         Program{"arhost-map", "--camera camera.yaml --family tag36h11 --side 40 "
                                                               "-o out.yaml"}),
                         [](const auto &info) { return std::string(info.param.name).substr(7); });

// A server that nobody may reach.
class Server {
public:
    Server() : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)) {
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        socklen_t size = sizeof address;
        EXPECT_EQ(::bind(socket_.get(), reinterpret_cast<sockaddr *>(&address), size), 0);
        EXPECT_EQ(::listen(socket_.get(), 8), 0);
        EXPECT_EQ(::getsockname(socket_.get(), reinterpret_cast<sockaddr *>(&address), &size), 0);
        port_ = ntohs(address.sin_port);
    }
    int port() const { return port_; }
    bool was_reached() const { return UniqueFd(::accept(socket_.get(), nullptr, nullptr)).get() >= 0; }

private:
    UniqueFd socket_;
    int port_ = 0;
};

} // namespace

TEST_P(EveryReader, FetchesNothingThatAFileNames) {
    const Server server;
    const std::string url = "http://127.0.0.1:" + std::to_string(server.port()) + "/";
    const std::pair<const char *, std::string> contents[] = {
        {"hls.m3u8", "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\n" + url + "a.ts\n#EXT-X-ENDLIST\n"},
        {"hls.avi", "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\n" + url + "a.ts\n#EXT-X-ENDLIST\n"},
        {"list.ffconcat", "ffconcat version 1.0\nfile " + url + "a.mp4\n"},
        {"offer.sdp", "v=0\no=- 0 0 IN IP4 127.0.0.1\ns=a\nc=IN IP4 127.0.0.1\nt=0 0\nm=video " +
                          std::to_string(server.port()) + " TCP/RTP/AVP 26\n"},
        {"dash.mpd",
         "<?xml version=\"1.0\"?><MPD xmlns=\"urn:mpeg:dash:schema:mpd:2011\" type=\"static\" "
         "mediaPresentationDuration=\"PT1S\"><Period><AdaptationSet mimeType=\"video/mp4\"><Representation "
         "id=\"a\" bandwidth=\"1\"><BaseURL>" +
             url + "</BaseURL></Representation></AdaptationSet></Period></MPD>"}};
    for (const auto &[name, text] : contents) {
        SCOPED_TRACE(name);
        write(name, text);
        for (const char *option : {"--video ", "--images "})
            EXPECT_EQ(execute(command(option + std::string(name))), 2) << printed();
        EXPECT_FALSE(server.was_reached());
    }
}

TEST_P(EveryReader, TakesOneFrameOfEachImage) {
    std::filesystem::create_symlink("grey.png", folder() / "grey-1.png");
    std::filesystem::create_symlink("grey.png", folder() / "grey-2.png");
    EXPECT_EQ(execute(command("--images grey-%d.png")), 2);
    EXPECT_THAT(printed(), HasSubstr("grey-%d.png: has several frames; read it with --video"));
    EXPECT_EQ(execute(command("--video grey-%d.png")), 2);
    EXPECT_THAT(printed(), HasSubstr("2 frames"));
}

TEST_P(EveryReader, RejectsAPipe) {
    ASSERT_EQ(::mkfifo((folder() / "pipe").c_str(), 0600), 0);
    for (const char *option : {"--video ", "--images "}) {
        EXPECT_EQ(execute(command(option + std::string("pipe"))), 2);
        EXPECT_THAT(printed(), HasSubstr("pipe: is not a regular file"));
    }
}

TEST_P(EveryReader, EndsOnSignalsAndLeavesNoFile) {
    std::string images = "--images";
    for (int i = 0; i < 2000; ++i)
        images += " grey.png";
    const auto before = files();
    for (const int signal : {SIGINT, SIGTERM}) {
        // The temporary output exists as soon as the program watches signals. A shell ignores SIGINT in the
        // background.
        EXPECT_EQ(
            execute(
                "{ env --default-signal=INT " + command(images) +
                " & } ; until ls out.yaml.*.tmp > /dev/null 2>&1; do sleep 0.01; kill -0 $! || exit 1; done; kill -" +
                std::to_string(signal) + " $!; wait $!"),
            128 + signal)
            << printed();
        EXPECT_EQ(files(), before);
    }
}
