// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "newest_frame.hpp"

#include <condition_variable>
#include <map>
#include <set>
#include <span>

struct MHD_Connection;
struct MHD_Daemon;
struct MHD_Response;

namespace arhost::web {

struct Settings {
    int socket;                          // a listening socket
    std::string token;                   // "": none
    std::string hosts;                   // see is_own_host
    std::uint32_t width = 0, height = 0; // size of the frames
};

// Serves the page, the live picture and the commands, in a thread of libmicrohttpd.
class Server {
public:
    // `control` may lack its functions; in that case the server offers no status and no commands.
    Server(Settings settings, NewestFrame &frame, HostControl &control);
    ~Server();
    Server(const Server &) = delete;
    Server &operator=(const Server &) = delete;

    // Call on the plugin's thread after each frame, and 30 times per second while there are no frames. Sends new
    // frames and closes the connections of clients that exceed their time limit.
    void tick();

    // Call when the run ends: the event `end` tells the pages. A server that is destroyed without this call only
    // closes its connections, because its host was lost or restarts the plugin.
    void end_run();

private:
    using Clock = std::chrono::steady_clock;
    struct Callbacks; // callbacks of libmicrohttpd
    struct Request;
    struct Viewer;
    struct Download;
    using SharedRequest = std::shared_ptr<Request>;
    struct Connection {
        int fd;
        Clock::time_point deadline;
    };

    void stop();
    bool check(const Request &request);
    bool process(const SharedRequest &request);
    bool send_command(const SharedRequest &request);
    bool ask_status(const SharedRequest &request);
    bool suspend_until_answer(const SharedRequest &request);
    void take(const SharedRequest &request, const std::string &answer);
    void take_status(const std::string &answer);
    void resume(const SharedRequest &request);

    bool respond_with_answer(const Request &request);
    bool respond_with_page(const Request &request);
    bool respond_with_snapshot(const Request &request);
    bool respond_with_file(const Request &request);
    bool respond_with_targets(const Request &request);
    bool respond_with_stream(const Request &request);
    bool respond_with_events(const Request &request);
    bool respond_to_viewer(const Request &request, std::unique_ptr<Viewer> viewer, const std::string &type);
    bool admit(Viewer &viewer);
    bool admit(Download &download);
    bool respond(const Request &request, unsigned status, const char *type, std::string_view body,
                 const std::string &nonce = "");
    bool refuse(const Request &request, unsigned status, const std::string &error);
    bool queue(const Request &request, unsigned status, MHD_Response *response, const std::string &nonce = "");
    void limit_time(MHD_Connection *connection, std::chrono::seconds time);
    std::ptrdiff_t read_stream(Viewer &viewer, std::span<char> to);
    enum class Next { ready, wait, end };
    Next prepare_next(Viewer &viewer);

    Settings settings_;
    NewestFrame &frame_;
    HostControl &control_;
    MHD_Daemon *daemon_ = nullptr;
    std::mutex mutex_; // guards the following members
    bool is_stopping_ = false, has_run_ended_ = false, is_status_pending_ = false;
    std::map<MHD_Connection *, Connection> connections_;
    std::set<Viewer *> viewers_;
    std::set<Download *> downloads_;
    std::set<SharedRequest> suspended_, waiting_for_status_;
    std::size_t unsent_answers_ = 0;   // answers to requests that were suspended
    std::condition_variable was_sent_; // an answer, or the end of a stream
};

} // namespace arhost::web
