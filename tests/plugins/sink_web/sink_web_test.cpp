// SPDX-License-Identifier: Apache-2.0
//
// Runs arhost with the page, in its sandbox, and sends requests to it.
#include "arhost_run.hpp"
#include "http_client.hpp"
#include "process_state.hpp"
#include "sink_under_test.hpp"
#include "waiting.hpp"

#include "base/listening_socket.hpp"
#include "base/unique_fd.hpp"

#include <arhost/control.h>
#include <gmock/gmock.h>
#include <sys/resource.h>

#include <regex>

using namespace arhost::test;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;
using Json = nlohmann::json;

namespace {

const std::string token = "0123456789abcdef";

std::string yaml(const std::string &granted, const std::string &options) {
    return "version: 1\nmode: live\n"
           "source: {plugin: source_synthetic, options: {frames: 0, id: 0, side_mm: 80, width: 160, height: 120}}\n"
           "tracker: {plugin: tracker_aruco, targets: [{marker: 0, family: tag36h11, side_mm: 80}]}\n"
           "raytracer: {plugin: rt_embree, scene: scene.yaml}\n"
           "outputs: [{plugin: sink_web, allow: [listen], control: " +
           granted + ", options: {" + options + "}}]\nstats: stats.json\n";
}

class WebRun : public ArhostRun {
public:
    explicit WebRun(const std::string &granted = "[quit, freeze, status]", const std::string &options = "")
        : WebRun(Configuration{yaml(granted, "listen: \"127.0.0.1:0\"" + (options.empty() ? "" : ", " + options))}) {}
    struct Configuration {
        std::string text;
    };
    explicit WebRun(const Configuration &configuration) : ArhostRun(configuration.text) {
        write("scene.yaml", small_scene);
        std::filesystem::create_directories(path("out")); // so that a key `reads` can name it
        start();
        const std::regex url("http://127\\.0\\.0\\.1:([0-9]+)/");
        std::string text;
        std::smatch match;
        wait_for([&] { return std::regex_search(text = output(), match, url); });
        port_ = static_cast<std::uint16_t>(std::stoi(match[1]));
        wait_for([&] { return get("/snapshot.jpg").status == 200; });
    }
    // Waits until the condition holds; throws if it does not, or if arhost has ended.
    template <class Condition> void wait_for(Condition &&condition) const {
        if (!eventually([&] { return !running() || condition(); }) || !running())
            throw std::runtime_error(output());
    }
    std::uint16_t port() const { return port_; }
    HttpClient connect() const { return HttpClient(port_); }
    HttpAnswer request(const std::string &text) const {
        HttpClient client = connect();
        client.send(text);
        return client.receive_answer();
    }
    HttpAnswer get(const std::string &path, const std::string &headers = "") const {
        return request("GET " + path + " HTTP/1.1\r\nHost: localhost\r\n" + headers + "\r\n");
    }
    HttpAnswer post(const std::string &body, const std::string &headers = "") const {
        return request("POST /api/control HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
                       "Content-Length: " +
                       std::to_string(body.size()) + "\r\n" + headers + "\r\n" + body);
    }
    Json status() const { return Json::parse(get("/api/status").body); }
    HttpClient watch(int receive_buffer = 0) const {
        HttpClient client(port_, receive_buffer);
        client.send("GET /stream.mjpg HTTP/1.1\r\nHost: localhost\r\n\r\n");
        return client;
    }
    // Like watch(), and receives the header.
    HttpClient viewer() const {
        HttpClient client = watch();
        client.receive_to("\r\n\r\n");
        return client;
    }
    void expect_quit() {
        EXPECT_EQ(post(R"({"command":"quit"})").status, 200) << output();
        EXPECT_EQ(wait(), 0) << output();
    }

private:
    std::uint16_t port_ = 0;
};

// A connection from an address of this machine, which may be unable to connect. Closed by the destructor.
class AnyConnection {
public:
    AnyConnection(std::uint16_t port, int address, const std::string &text, int receive_buffer = 0)
        : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK, 0)) {
        if (receive_buffer > 0)
            ::setsockopt(fd_.get(), SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof receive_buffer);
        sockaddr_in own{}, server{};
        own.sin_family = server.sin_family = AF_INET;
        own.sin_addr.s_addr = htonl(0x7f000100u + static_cast<unsigned>(address)); // 127.0.1.0 and following
        server.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        server.sin_port = htons(port);
        ::bind(fd_.get(), reinterpret_cast<const sockaddr *>(&own), sizeof own);
        ::connect(fd_.get(), reinterpret_cast<const sockaddr *>(&server), sizeof server);
        (void)!::send(fd_.get(), text.data(), text.size(), MSG_NOSIGNAL);
    }

private:
    arhost::base::UniqueFd fd_;
};

} // namespace

TEST(SinkWeb, ServesThePageThePictureAndTheDescription) {
    WebRun run;
    const HttpAnswer page = run.get("/");
    EXPECT_EQ(page.status, 200);
    EXPECT_THAT(page.body, AllOf(HasSubstr("src=\"/stream.mjpg\""), HasSubstr("width=\"160\" height=\"120\""),
                                 HasSubstr("\"granted\":["), testing::Not(HasSubstr("{{"))));
    EXPECT_THAT(page.head, AllOf(HasSubstr("Content-Security-Policy: default-src 'none'"), HasSubstr("nosniff"),
                                 HasSubstr("X-Frame-Options: DENY"), HasSubstr("no-store")));
    EXPECT_NE(page.body, run.get("/").body) << "each page must have its own nonce";
    EXPECT_THAT(run.get("/snapshot.jpg").body, StartsWith("\xff\xd8\xff"));
    EXPECT_EQ(Json::parse(run.get("/openapi.json").body)["openapi"], "3.1.0");
    EXPECT_EQ(run.get("/nothing").status, 404);
    EXPECT_EQ(run.get("/../etc/passwd").status, 404);
    run.expect_quit();
}

TEST(SinkWeb, TheCommandSetTurnsTheDebugViewOn) {
    WebRun run("[quit, set]");
    const std::size_t plain = run.get("/snapshot.jpg").body.size(); // a frame of one colour
    const std::string set = R"({"command": "set", "component": "sink_web", "option": "debug_view", "value": "true"})";
    EXPECT_EQ(run.post(set).status, 200);
    run.wait_for([&] { return run.get("/snapshot.jpg").body.size() >= plain * 3 / 2; });
    run.expect_quit();
}

TEST(SinkWeb, StreamsChangingFrames) {
    WebRun run;
    HttpClient viewer = run.watch();
    EXPECT_THAT(viewer.receive_to("\r\n\r\n"), HasSubstr("multipart/x-mixed-replace"));
    const std::string first = viewer.receive_frame();
    EXPECT_THAT(first, StartsWith("\xff\xd8\xff"));
    std::string other = first;
    for (int i = 0; i < 100 && other == first; ++i)
        other = viewer.receive_frame();
    EXPECT_NE(other, first);
    run.expect_quit();
}

TEST(SinkWeb, RepeatsTheLastFrameWhileTheVideoIsFrozen) {
    WebRun run;
    EXPECT_EQ(Json::parse(run.post(R"({"command":"freeze","on":true})").body)["frozen"], true);
    HttpClient viewer = run.viewer();
    std::string last = viewer.receive_frame(), next = viewer.receive_frame();
    for (int i = 0; i < 10 && last != next; ++i) // frames in progress
        last = std::exchange(next, viewer.receive_frame());
    EXPECT_EQ(last, next);
    run.expect_quit();
}

TEST(SinkWeb, GivesTheStatusAndTheGrantedCommands) {
    WebRun run;
    const Json answer = run.status();
    EXPECT_EQ(answer["ok"], true);
    EXPECT_THAT(answer["granted"], ElementsAre("freeze", "quit", "status"));
    EXPECT_EQ(answer["status"]["mode"], "live");
    Json targets = answer["status"]["targets"];
    while (targets.empty() && run.running()) // until the tracker has started
        targets = run.status()["status"]["targets"];
    EXPECT_EQ(targets.at(0)["name"], "tag36h11-0");
    EXPECT_EQ(targets.at(0)["state"], "detected");
    const HttpAnswer metrics = run.get("/metrics");
    EXPECT_EQ(metrics.status, 200);
    EXPECT_THAT(metrics.body,
                AllOf(HasSubstr("arhost_component_running{component=\"tracker\",plugin=\"tracker_aruco\"} 1\n"),
                      HasSubstr("arhost_stage_milliseconds{stage=\"latency\",quantile=\"0.5\"} "),
                      HasSubstr("arhost_latency_milliseconds{output=\"sink_web\",quantile=\"0.99\"} "),
                      HasSubstr("arhost_web_viewers 0\n")));
    run.expect_quit();
}

TEST(SinkWeb, GivesThePosesOfTheNewestFrame) {
    WebRun run;
    run.wait_for([&] { return !Json::parse(run.get("/api/targets").body)["targets"].empty(); });
    const Json line = Json::parse(run.get("/api/targets").body);
    EXPECT_EQ(line["targets"][0]["name"], "tag36h11-0");
    EXPECT_EQ(line["targets"][0]["mt"].size(), 16u);
    run.expect_quit();
}

TEST(SinkWeb, SendsThePosesOfEachFrameAndTheEndAsEvents) {
    WebRun run;
    HttpClient events = run.connect(), end = run.connect();
    events.send("GET /api/events HTTP/1.1\r\nHost: localhost\r\n\r\n");
    end.send("GET /api/events?only=end HTTP/1.1\r\nHost: localhost\r\n\r\n");
    EXPECT_THAT(events.receive_to("\r\n\r\n"), AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("text/event-stream")));
    std::uint64_t last = 0;
    for (int i = 0; i < 10; ++i) {
        events.receive_to("event: frame\ndata: ");
        const Json line = Json::parse(events.receive_to("\n\n"));
        EXPECT_TRUE(i == 0 || line["frame"] > last) << line;
        last = line["frame"];
    }
    EXPECT_EQ(run.get("/api/events?only=beginning").status, 400);
    run.expect_quit();
    EXPECT_THAT(events.receive_all(), HasSubstr("event: end\ndata: {}\n\n"));
    EXPECT_THAT(end.receive_all(), AllOf(HasSubstr("event: end\n"), testing::Not(HasSubstr("event: frame\n"))));
}

// A worker that loses its host destroys the plugin without stopping it.
TEST(SinkWeb, ALostHostIsNoEndOfTheRun) {
    arhost::base::ListeningSocket socket("127.0.0.1:0");
    HttpClient end(static_cast<std::uint16_t>(std::stoi(socket.address().substr(socket.address().rfind(':') + 1))));
    {
        arhost::test::SinkUnderTest sink("sink_web",
                                         {{"listen", std::to_string(socket.fd()) + " " + socket.address()}});
        sink.start_and_write(160, 120, 0, 1);
        end.send("GET /api/events?only=end HTTP/1.1\r\nHost: localhost\r\n\r\n");
        EXPECT_THAT(end.receive_to("\r\n\r\n"), StartsWith("HTTP/1.1 200"));
    }
    EXPECT_THAT(end.receive_all(), testing::Not(HasSubstr("event: end")));
}

TEST(SinkWeb, EventsHaveTheLimitsOfViewers) {
    WebRun run;
    std::vector<HttpClient> viewers;
    const auto status_of = [&](const std::string &path) {
        HttpClient &client = viewers.emplace_back(run.connect());
        client.send("GET " + path + " HTTP/1.1\r\nHost: localhost\r\n\r\n");
        return client.receive_to("\r\n\r\n").substr(9, 3);
    };
    for (int i = 0; i < 24; ++i)
        ASSERT_EQ(status_of(i % 2 ? "/api/events" : "/api/events?only=end"), "200") << i;
    EXPECT_EQ(status_of("/api/events"), "503");
    EXPECT_EQ(status_of("/stream.mjpg"), "200") << "pictures have places of their own";
    run.expect_quit();
}

TEST(SinkWeb, SendsOnlyFilesThatTheRunHasWrittenAndThatItMayRead) {
    for (const bool may_read : {true, false}) {
        std::string text = yaml("[quit, snapshot, status]", "listen: \"127.0.0.1:0\"") +
                           "snapshot: {plugin: sink_images, path: out/s-%02d.png}\n";
        const std::string allow = "allow: [listen]";
        if (may_read)
            text.replace(text.find(allow), allow.size(), allow + ", reads: [out]");
        WebRun run(WebRun::Configuration{text});
        EXPECT_EQ(run.get("/files/1").status, 404) << "nothing was written yet";
        EXPECT_EQ(run.post(R"({"command":"snapshot"})").status, 200);
        const HttpAnswer file = run.get("/files/1");
        EXPECT_EQ(file.status, may_read ? 200 : 403);
        if (may_read) {
            EXPECT_EQ(file.body, run.read("out/s-01.png"));
            EXPECT_THAT(file.head, HasSubstr("Content-Disposition: attachment; filename=\"s-01.png\""));
        } else {
            EXPECT_THAT(file.body, HasSubstr("'reads'"));
        }
        for (const char *path : {"/files/2", "/files/", "/files/01", "/files/../run.yaml", "/files/%2e%2e%2frun.yaml",
                                 "/files//etc/passwd", "/files/1/../../run.yaml"})
            EXPECT_EQ(run.get(path).status, 404) << path;
        run.expect_quit();
    }
}

TEST(SinkWeb, SlowDownloadsLeaveConnectionsToOthers) {
    std::string text = yaml("[quit, snapshot, status]", "listen: \"127.0.0.1:0\"") +
                       "snapshot: {plugin: sink_images, path: out/s-%02d.png}\n";
    const std::string allow = "allow: [listen]";
    text.replace(text.find(allow), allow.size(), allow + ", reads: [out]");
    WebRun run(WebRun::Configuration{text});
    ASSERT_EQ(run.post(R"({"command":"snapshot"})").status, 200);
    std::filesystem::resize_file(run.path("out/s-01.png"), 1 << 26); // more than the sockets buffer
    std::vector<HttpClient> downloads;
    const auto status_of_download = [&](std::uint32_t from) {
        HttpClient &client = downloads.emplace_back(run.port(), 4096, from);
        client.send("GET /files/1 HTTP/1.1\r\nHost: localhost\r\n\r\n");
        return client.receive_to("\r\n\r\n").substr(9, 3);
    };
    for (const std::uint32_t from : {2u, 3u, 4u, 5u}) {
        for (int i = 0; i < 4; ++i)
            ASSERT_EQ(status_of_download(from), "200") << from << " " << i;
        EXPECT_EQ(status_of_download(from), "503") << "4 downloads per address";
    }
    EXPECT_EQ(status_of_download(6), "503") << "16 downloads";
    downloads.clear();
    run.wait_for([&] { return status_of_download(6) == "200"; });
    run.expect_quit();
}

TEST(SinkWeb, EncodesNothingWithoutViewers) {
    WebRun run;
    const auto count = [&](const std::string &name) {
        const std::string text = "\n" + run.get("/metrics").body;
        return std::stoul(text.substr(text.find("\n" + name + " ") + name.size() + 2));
    };
    const auto encoded = count("arhost_web_encoded_frames_total"), frames = count("arhost_web_frames_total");
    run.wait_for([&] { return count("arhost_web_frames_total") >= frames + 10; });
    EXPECT_EQ(count("arhost_web_encoded_frames_total"), encoded);
    run.expect_quit();
}

TEST(SinkWeb, ExecutesOnlyGrantedCommands) {
    WebRun run("[quit]");
    const HttpAnswer freeze = run.post(R"({"command":"freeze"})");
    EXPECT_EQ(freeze.status, 422);
    EXPECT_THAT(freeze.body, HasSubstr("does not grant 'freeze'"));
    EXPECT_EQ(run.get("/api/status").status, 503);
    const HttpAnswer file = run.get("/files/1");
    EXPECT_EQ(file.status, 403) << "the numbers of files are in the status";
    EXPECT_THAT(file.body, HasSubstr("does not grant 'status'"));
    EXPECT_THAT(run.get("/metrics").body, HasSubstr("arhost_web_frames_total"));
    EXPECT_EQ(run.post("[]").status, 400);
    EXPECT_EQ(run.post("").status, 400);
    EXPECT_EQ(run.post(std::string("{\"command\":\"quit\"}\0x", 20)).status, 400);
    run.expect_quit();
}

TEST(SinkWeb, RejectsOtherHostsOriginsAndTypes) {
    WebRun run("[quit, freeze]", "hosts: lab");
    const auto with_host = [&](const std::string &host) {
        return run.request("GET / HTTP/1.1\r\nHost: " + host + "\r\n\r\n").status;
    };
    EXPECT_EQ(with_host("lab:8080"), 200);
    EXPECT_EQ(with_host("evil.example"), 421);
    const std::string freeze = R"({"command":"freeze"})";
    EXPECT_EQ(run.post(freeze, "Origin: http://localhost\r\n").status, 200);
    EXPECT_EQ(run.post(freeze, "Origin: http://evil.example\r\n").status, 403);
    EXPECT_EQ(run.post(freeze, "Origin: null\r\n").status, 403);
    EXPECT_EQ(run.get("/stream.mjpg", "Origin: http://evil.example\r\n").status, 403);
    const std::string form = "POST /api/control HTTP/1.1\r\nHost: localhost\r\nContent-Length: 20\r\n"
                             "Content-Type: text/plain\r\n\r\n" +
                             freeze;
    EXPECT_EQ(run.request(form).status, 415);
    EXPECT_EQ(run.get("/api/control").status, 405);
    EXPECT_EQ(run.request("OPTIONS /api/control HTTP/1.1\r\nHost: localhost\r\n\r\n").status, 405);
    EXPECT_EQ(run.request("PUT / HTTP/1.1\r\nHost: localhost\r\n\r\n").status, 405);
    run.expect_quit();
}

TEST(SinkWeb, CommandsNeedTheToken) {
    WebRun run("[quit]", "token: \"" + token + "\"");
    const std::string quit = R"({"command":"quit"})";
    EXPECT_EQ(run.post(quit).status, 401);
    EXPECT_EQ(run.post(quit, "Authorization: Bearer 0123456789abcdee\r\n").status, 401);
    EXPECT_EQ(run.get("/snapshot.jpg").status, 200);
    EXPECT_EQ(run.post(quit, "Authorization: Bearer " + token + "\r\n").status, 200);
    EXPECT_EQ(run.wait(), 0) << run.output();
}

TEST(SinkWeb, OtherMachinesNeedATokenOf16Characters) {
    for (const auto &[options, error] : {std::pair{"listen: \"0.0.0.0:0\"", "the option 'token' must be set"},
                                         {"listen: \"127.0.0.1:0\", token: short", "at least 16 characters"}}) {
        ArhostRun run(yaml("[quit]", options));
        run.write("scene.yaml", small_scene);
        EXPECT_NE(run.run(), 0);
        EXPECT_THAT(run.output(), HasSubstr(error));
    }
}

TEST(SinkWeb, NeedsASocket) {
    SinkUnderTest sink("sink_web", {{"listen", ""}});
    EXPECT_EQ(sink.created(), ARHOST_STATUS_ERROR_CONFIGURATION);
}

TEST(SinkWeb, SurvivesMalformedRequests) {
    WebRun run;
    for (const std::string &text :
         {std::string("\r\n\r\n\r\n"), std::string("GET\r\n\r\n"), std::string("GET / HTTP/9.9\r\n\r\n"),
          std::string("GET / HTTP/1.1\r\n\r\n"), std::string("\0\1\2\3", 4) + "\r\n\r\n",
          "GET /" + std::string(100000, 'a') + " HTTP/1.1\r\nHost: localhost\r\n\r\n",
          "GET / HTTP/1.1\r\nHost: localhost\r\nX: " + std::string(100000, 'a') + "\r\n\r\n",
          std::string("POST /api/control HTTP/1.1\r\nHost: localhost\r\nContent-Length: -1\r\n\r\n"),
          std::string(
              "POST /api/control HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99999999999999999999\r\n\r\n")}) {
        HttpClient client = run.connect();
        client.send(text);
        ::shutdown(client.fd(), SHUT_WR);
        const std::string answer = client.receive_all();
        EXPECT_FALSE(answer.starts_with("HTTP/1.1 200")) << answer;
    }
    EXPECT_EQ(run.post(std::string(100000, ' ')).status, 413);
    EXPECT_EQ(run.get("/").status, 200);
    run.expect_quit();
    EXPECT_EQ(run.stats()["restarts"]["sink_web"], 0) << run.output();
}

TEST(SinkWeb, RefusesRequestsWhoseEndOrHostIsAmbiguous) {
    WebRun run;
    const std::string command = R"({"command": "status"})", length = std::to_string(command.size());
    for (const std::string &headers :
         {"Host: localhost\r\nHost: 127.0.0.1\r\nContent-Length: " + length,
          "Host: localhost\r\nContent-Length: " + length + "\r\nContent-Length: 5",
          "Host: localhost\r\nContent-Length: " + length + "\r\nTransfer-Encoding: chunked",
          std::string("Host: localhost\r\nTransfer-Encoding: chunked\r\nTransfer-Encoding: chunked")}) {
        HttpClient client = run.connect();
        client.send("POST /api/control HTTP/1.1\r\n" + headers + "\r\nContent-Type: application/json\r\n\r\n" +
                    command);
        const std::string answer = client.receive_all(); // until the server closes the connection
        EXPECT_THAT(answer, StartsWith("HTTP/1.1 400")) << headers;
        EXPECT_THAT(answer, testing::Not(HasSubstr("\"ok\":true"))) << headers;
    }
    run.expect_quit();
}

TEST(SinkWeb, OneAddressCannotTakeAllViewers) {
    WebRun run;
    std::vector<HttpClient> viewers;
    const auto status_of_stream = [&](std::uint32_t from) {
        HttpClient &client = viewers.emplace_back(run.port(), 0, from);
        client.send("GET /stream.mjpg HTTP/1.1\r\nHost: localhost\r\n\r\n");
        return client.receive_to("\r\n\r\n").substr(9, 3);
    };
    for (const std::uint32_t from : {2u, 3u})
        for (int i = 0; i < 24; ++i)
            ASSERT_EQ(status_of_stream(from), "200") << from << " " << i;
    EXPECT_EQ(status_of_stream(2), "503") << "24 viewers per address";
    for (int i = 0; i < 16; ++i)
        EXPECT_EQ(status_of_stream(4), "200") << "takes the place of a viewer of an address with more, " << i;
    EXPECT_EQ(status_of_stream(4), "503") << "each address has a third";
    EXPECT_EQ(status_of_stream(5), "200");
    EXPECT_NE(viewers.back().receive_frame(), "");
    run.expect_quit();
}

TEST(SinkWeb, AViewerThatDoesNotReadDelaysNobody) {
    WebRun run;
    std::vector<HttpClient> viewers;
    for (int i = 0; i < 10; ++i)
        viewers.push_back(run.watch(4096));
    HttpClient viewer = run.viewer();
    for (int i = 0; i < 50; ++i)
        ASSERT_NE(viewer.receive_frame(), "") << run.output();
    run.expect_quit();
}

TEST(SinkWeb, ClosesConnectionsThatSendTooSlowly) {
    WebRun run;
    HttpClient slow = run.connect();
    std::atomic<bool> is_closed = false;
    std::thread reader([&] { slow.receive_all(), is_closed = true; });
    slow.send("GET / HTTP/1.1\r\nHost: localhost\r\n");
    EXPECT_TRUE(eventually([&] {
        slow.send("X");
        return is_closed.load();
    })) << "the server accepts one byte at a time forever";
    reader.join();
    run.expect_quit();
}

TEST(SinkWeb, ManyConnectionsNeverStopTheVideo) {
    WebRun run;
    HttpClient viewer = run.viewer();
    std::vector<HttpClient> idle;
    for (int i = 0; i < 300; ++i)
        idle.push_back(run.connect());
    for (int i = 0; i < 50; ++i)
        ASSERT_NE(viewer.receive_frame(), "") << run.output();
    idle.clear();
    // The server accepts connections again once it has noticed that clients have left.
    run.wait_for([&] { return run.get("/").status == 200; });
    run.expect_quit();
    EXPECT_EQ(run.stats()["restarts"]["sink_web"], 0) << run.output();
}

TEST(SinkWeb, ARestartedWorkerServesAgain) {
    WebRun run;
    const pid_t worker = run.worker("sink_web");
    send_signal(worker, SIGKILL);
    run.wait_for([&] { return run.get("/snapshot.jpg").status == 200; });
    EXPECT_NE(run.worker("sink_web"), worker);
    run.expect_quit();
}

// Slow readers, malformed requests, partial requests and idle connections, more than the server accepts.
TEST(SinkWeb, HostileClientsCostNoFrameAndLittleMemory) {
    constexpr std::size_t width = 160, height = 120, connections = 2000;
    rlimit limit{};
    ::getrlimit(RLIMIT_NOFILE, &limit);
    limit.rlim_cur = std::min<rlim_t>(limit.rlim_max, connections + 500);
    ::setrlimit(RLIMIT_NOFILE, &limit);
    if (limit.rlim_cur < connections + 500)
        GTEST_SKIP() << "the limit of open files is " << limit.rlim_cur;
    WebRun run(WebRun::Configuration{
        "version: 1\nmode: live\nsource: {plugin: source_synthetic, fps: 30, options: {frames: 0, width: 160, "
        "height: 120}}\noutputs: [{plugin: sink_web, allow: [listen], control: [quit, status], options: {listen: "
        "\"127.0.0.1:0\"}}]\nstats: stats.json\n"});
    const pid_t worker = run.worker("sink_web");
    HttpClient viewer = run.viewer();
    ASSERT_NE(viewer.receive_frame(), "");
    const std::size_t before = 1024 * memory_kib("VmRSS", worker);

    std::vector<AnyConnection> hostile;
    hostile.reserve(connections + 200);
    const auto attack = [&](std::size_t count, const std::string &text, int receive_buffer = 0) {
        for (std::size_t i = 0; i < count; ++i)
            hostile.emplace_back(run.port(), static_cast<int>(hostile.size() / 20), text, receive_buffer);
        for (int i = 0; i < 15; ++i)
            ASSERT_NE(viewer.receive_frame(), "") << run.output();
    };
    const std::string get = "GET / HTTP/1.1\r\nHost: localhost\r\n";
    attack(40, "GET /stream.mjpg HTTP/1.1\r\nHost: localhost\r\n\r\n", 2048);
    run.wait_for([&] { return run.get("/metrics").body.find("arhost_web_viewers 41\n") != std::string::npos; });
    attack(40, "GET \1\2\3 HTTP/7\r\n: \r\n\r\n" + std::string(20000, 'x'));
    attack(40, "POST /api/control HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nContent-Length: " +
                   std::to_string(ARHOST_MAX_COMMAND_SIZE) + "\r\n\r\n" + std::string(16000, ' '));
    attack(500, get + std::string(15000, 'x'));
    attack(connections - 500, "");
    const std::size_t peak = 1024 * memory_kib("VmHWM", worker);
    // The limits in the README: each connection has its headers and a command or a block of the stream, each viewer a
    // frame, which is smaller than its pixels. Then what the library and the allocator need.
    constexpr std::size_t allowed = 128 * ((16 + 64) << 10) + 48 * 3 * width * height + (6 << 20);
#ifdef __SANITIZE_ADDRESS__ // delays freeing memory
    constexpr bool is_exact = false;
#else
    constexpr bool is_exact = true;
#endif
    EXPECT_TRUE(peak < before + allowed || !is_exact) << peak << " bytes, from " << before << " bytes";

    hostile.clear();
    run.wait_for([&] { return run.get("/").status == 200; });
    run.expect_quit();
    const Json stats = run.stats();
    EXPECT_EQ(stats["restarts"]["sink_web"], 0) << run.output(); // no call exceeded its deadline
    EXPECT_EQ(stats["frames"]["dropped"].value("output", 0), 0) << stats["frames"];
}
