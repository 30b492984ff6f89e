// SPDX-License-Identifier: Apache-2.0
#include "server.hpp"

#include "checks.hpp"
#include "embedded_files.hpp"
#include "metrics.hpp"
#include "run_files.hpp"

#include <algorithm>
#include <array>
#include <fcntl.h>
#include <microhttpd.h>
#include <netinet/in.h>
#include <random>
#include <strings.h>
#include <sys/socket.h>
#include <utility>

namespace arhost::web {
namespace {

constexpr unsigned max_connections = 128, max_connections_per_address = 64;
constexpr std::size_t max_viewers = 48, max_viewers_per_address = 24;
constexpr std::size_t max_downloads = 16;
constexpr std::ptrdiff_t max_downloads_per_address = 4;
constexpr std::size_t connection_memory = 16384, stream_block = 65536; // bytes
constexpr unsigned inactivity_s = 30;
constexpr auto request_time = std::chrono::seconds(10), response_time = std::chrono::seconds(60),
               frame_time = std::chrono::seconds(30); // a viewer that needs longer for a frame is disconnected
// Time limit for sending the last answers at the end of the run.
constexpr auto last_answer_time = std::chrono::seconds(1);
// After this time without a new frame, viewers receive the last frame again. Sending it shows whether they are still
// connected.
constexpr auto repeat_time = std::chrono::seconds(1);
constexpr std::string_view boundary = "arhostframe", files_path = "/files/";

std::string header(MHD_Connection *connection, const char *name) {
    const char *value = MHD_lookup_connection_value(connection, MHD_HEADER_KIND, name);
    return value ? value : "";
}

// Whether the request has two headers of this name.
bool is_repeated(MHD_Connection *connection, const char *name) {
    std::pair<const char *, int> count{name, 0};
    MHD_get_connection_values(
        connection, MHD_HEADER_KIND,
        [](void *into, MHD_ValueKind, const char *key, const char *) {
            auto &[wanted, found] = *static_cast<std::pair<const char *, int> *>(into);
            found += ::strcasecmp(key, wanted) == 0;
            return MHD_YES;
        },
        &count);
    return count.second > 1;
}

// Returns the client's IPv4 address, or the /64 network of its IPv6 address, in which one client can have any number
// of addresses.
std::string address_of(MHD_Connection *connection) {
    const auto *info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CLIENT_ADDRESS);
    if (!info || !info->client_addr)
        return "";
    if (info->client_addr->sa_family == AF_INET) {
        const auto *v4 = reinterpret_cast<const sockaddr_in *>(info->client_addr);
        return {reinterpret_cast<const char *>(&v4->sin_addr), sizeof v4->sin_addr};
    }
    if (info->client_addr->sa_family != AF_INET6)
        return ""; // a Unix socket, whose address is shorter
    const auto *v6 = reinterpret_cast<const sockaddr_in6 *>(info->client_addr);
    return {reinterpret_cast<const char *>(&v6->sin6_addr), IN6_IS_ADDR_V4MAPPED(&v6->sin6_addr) ? 16u : 8u};
}

std::string make_nonce() {
    std::random_device random;
    std::string nonce;
    for (int i = 0; i < 32; ++i)
        nonce += "0123456789abcdef"[random() % 16];
    return nonce;
}

std::string error_text(const std::string &error) {
    return "{\"ok\":false,\"error\":\"" + error + "\"}\n";
}

// The host's answers begin with the member "ok".
bool has_succeeded(std::string_view answer) {
    return answer.starts_with("{\"ok\":true");
}

} // namespace

struct Server::Request {
    MHD_Connection *connection;
    std::string method, path;
    std::string body{};
    bool has_begun = false, is_too_large = false;
    bool was_suspended = false; // guarded by mutex_
    std::string answer{};       // answer of the host, guarded by mutex_
};

struct Server::Viewer {
    enum class Shows { pictures, poses, end };
    Server *server;
    MHD_Connection *connection;
    std::string address; // of the client (address_of)
    Shows shows;
    bool is_waiting = false;  // suspended, guarded by mutex_
    std::uint64_t number = 0; // of the last frame that was sent
    Clock::time_point sent_at{};
    bool has_end = false; // the last part is being sent
    std::string text{};   // precedes the JPEG
    std::shared_ptr<const Jpeg> jpeg{};
    std::size_t position = 0; // position in the concatenation of text, JPEG and the boundary after it

    bool shows_pictures() const { return shows == Shows::pictures; }
};

struct Server::Download {
    Server *server;
    MHD_Connection *connection;
    std::string address; // of the client (address_of)
    RunFile file;
};

struct Server::Callbacks {
    // Exceptions must not leave the callbacks of libmicrohttpd. An exception closes the connection.
    template <class Call> static MHD_Result guarded(Call &&call) noexcept {
        try {
            return call() ? MHD_YES : MHD_NO;
        } catch (...) {
            return MHD_NO;
        }
    }

    static MHD_Result handle(void *self, MHD_Connection *connection, const char *path, const char *method,
                             const char *, const char *upload, std::size_t *upload_size, void **context) {
        auto &server = *static_cast<Server *>(self);
        return guarded([&] {
            if (!*context) {
                auto request =
                    std::make_unique<SharedRequest>(std::make_shared<Request>(Request{connection, method, path}));
                *context = request.release();
            }
            const SharedRequest &request = *static_cast<SharedRequest *>(*context);
            if (!std::exchange(request->has_begun, true))
                return server.check(*request);
            if (*upload_size == 0)
                return server.process(request);
            if (request->body.size() + *upload_size > ARHOST_MAX_COMMAND_SIZE)
                request->is_too_large = true;
            else
                request->body.append(upload, *upload_size);
            *upload_size = 0;
            return true;
        });
    }

    static void complete(void *self, MHD_Connection *connection, void **context,
                         MHD_RequestTerminationCode) noexcept {
        auto &server = *static_cast<Server *>(self);
        const std::unique_ptr<SharedRequest> request(static_cast<SharedRequest *>(std::exchange(*context, nullptr)));
        server.limit_time(connection, request_time); // time limit for the next request
        const std::lock_guard lock(server.mutex_);
        if (request && (*request)->was_suspended && --server.unsent_answers_ == 0)
            server.was_sent_.notify_all();
    }

    static void notify(void *self, MHD_Connection *connection, void **,
                       MHD_ConnectionNotificationCode what) noexcept {
        auto &server = *static_cast<Server *>(self);
        const std::lock_guard lock(server.mutex_);
        if (what == MHD_CONNECTION_NOTIFY_CLOSED) {
            server.connections_.erase(connection);
            return;
        }
        const auto *info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
        server.connections_[connection] = {info->connect_fd, Clock::now() + request_time};
    }

    static ssize_t read(void *viewer, std::uint64_t, char *to, std::size_t size) noexcept {
        auto &self = *static_cast<Viewer *>(viewer);
        try {
            return self.server->read_stream(self, {to, size});
        } catch (...) {
            return MHD_CONTENT_READER_END_WITH_ERROR;
        }
    }

    static ssize_t read_file(void *download, std::uint64_t offset, char *to, std::size_t size) noexcept {
        auto &self = *static_cast<Download *>(download);
        self.server->limit_time(self.connection, frame_time);
        const std::ptrdiff_t got = self.file.read(offset, to, size);
        return got > 0 ? got : MHD_CONTENT_READER_END_WITH_ERROR; // 0: the file has become shorter
    }

    static void free_download(void *download) noexcept {
        const std::unique_ptr<Download> self(static_cast<Download *>(download));
        const std::lock_guard lock(self->server->mutex_);
        self->server->downloads_.erase(self.get());
    }

    static void free_viewer(void *viewer) noexcept {
        const std::unique_ptr<Viewer> self(static_cast<Viewer *>(viewer));
        const std::lock_guard lock(self->server->mutex_);
        self->server->viewers_.erase(self.get());
        self->server->was_sent_.notify_all();
    }
};

Server::Server(Settings settings, NewestFrame &frame, HostControl &control)
    : settings_(std::move(settings)), frame_(frame), control_(control) {
    daemon_ = MHD_start_daemon(MHD_USE_EPOLL_INTERNAL_THREAD | MHD_ALLOW_SUSPEND_RESUME, 0, nullptr, nullptr,
                               Callbacks::handle, this, MHD_OPTION_LISTEN_SOCKET, settings_.socket,
                               MHD_OPTION_CONNECTION_LIMIT, max_connections, MHD_OPTION_PER_IP_CONNECTION_LIMIT,
                               max_connections_per_address, MHD_OPTION_CONNECTION_MEMORY_LIMIT, connection_memory,
                               MHD_OPTION_CONNECTION_TIMEOUT, inactivity_s, MHD_OPTION_NOTIFY_COMPLETED,
                               Callbacks::complete, this, MHD_OPTION_NOTIFY_CONNECTION, Callbacks::notify, this,
                               MHD_OPTION_STRICT_FOR_CLIENT, 1, MHD_OPTION_END);
    if (!daemon_)
        throw Failure(ARHOST_STATUS_ERROR_IO, "cannot start the web server");
}

Server::~Server() {
    {
        const std::lock_guard lock(mutex_);
        stop();
    }
    MHD_stop_daemon(daemon_);
}

void Server::end_run() {
    std::unique_lock lock(mutex_);
    has_run_ended_ = true;
    stop();
    // The answer to `quit` may have arrived only now, and pages wait for the event `end`.
    was_sent_.wait_for(lock, last_answer_time, [this] {
        return unsent_answers_ == 0 && std::ranges::all_of(viewers_, &Viewer::shows_pictures);
    });
}

// Resumes all connections, because libmicrohttpd cannot stop while one is suspended. Needs the lock.
void Server::stop() {
    if (std::exchange(is_stopping_, true))
        return;
    MHD_quiesce_daemon(daemon_); // the listening socket stays open for the next worker
    for (Viewer *viewer : viewers_)
        if (std::exchange(viewer->is_waiting, false))
            MHD_resume_connection(viewer->connection);
    while (!suspended_.empty()) {
        const SharedRequest request = *suspended_.begin();
        resume(request);
    }
}

void Server::tick() {
    const std::lock_guard lock(mutex_);
    const auto now = Clock::now();
    for (Viewer *viewer : viewers_)
        if (viewer->is_waiting && ((viewer->shows != Viewer::Shows::end && viewer->number != frame_.number()) ||
                                   now - viewer->sent_at >= repeat_time)) {
            viewer->is_waiting = false;
            MHD_resume_connection(viewer->connection);
        }
    for (auto &[connection, each] : connections_)
        if (now > each.deadline) {
            each.deadline = Clock::time_point::max();
            ::shutdown(each.fd, SHUT_RDWR); // the server's thread then closes it
        }
}

void Server::limit_time(MHD_Connection *connection, std::chrono::seconds time) {
    const std::lock_guard lock(mutex_);
    if (const auto found = connections_.find(connection); found != connections_.end())
        found->second.deadline = Clock::now() + time;
}

// Checks the headers of a request, before its body arrives. Returns whether the connection remains usable.
bool Server::check(const Request &request) {
    // A proxy in front of this server could find another end of the request, or another host.
    if (is_repeated(request.connection, "Host") || is_repeated(request.connection, "Content-Length") ||
        is_repeated(request.connection, "Transfer-Encoding") ||
        (!header(request.connection, "Content-Length").empty() &&
         !header(request.connection, "Transfer-Encoding").empty()))
        return refuse(request, MHD_HTTP_BAD_REQUEST,
                      "give one header Host, and one header Content-Length or Transfer-Encoding");
    const std::string host = header(request.connection, "Host"), origin = header(request.connection, "Origin");
    if (!is_own_host(host, settings_.hosts))
        return refuse(request, MHD_HTTP_MISDIRECTED_REQUEST,
                      "use the server's IP address, or add the name in the header Host to the option 'hosts'");
    if (!origin.empty() && !is_own_origin(origin, host))
        return refuse(request, MHD_HTTP_FORBIDDEN, "requests of pages of other servers are not allowed");
    const bool is_command = request.path == "/api/control";
    if (is_command ? request.method != "POST" : request.method != "GET" && request.method != "HEAD")
        return refuse(request, MHD_HTTP_METHOD_NOT_ALLOWED, is_command ? "use POST" : "use GET");
    if (!is_command)
        return true;
    if (!settings_.token.empty() && !has_token(header(request.connection, "Authorization"), settings_.token))
        return refuse(request, MHD_HTTP_UNAUTHORIZED, "commands need the token: 'Authorization: Bearer TOKEN'");
    // Pages of other servers cannot send this content type without a CORS preflight request.
    if (!header(request.connection, "Content-Type").starts_with("application/json"))
        return refuse(request, MHD_HTTP_UNSUPPORTED_MEDIA_TYPE, "the type must be application/json");
    return true;
}

// Answers a request that has arrived completely.
bool Server::process(const SharedRequest &request) {
    if (request->is_too_large)
        return refuse(*request, MHD_HTTP_CONTENT_TOO_LARGE, "the command is too long");
    {
        const std::lock_guard lock(mutex_);
        if (const auto found = connections_.find(request->connection); found != connections_.end())
            found->second.deadline = Clock::time_point::max();
        if (is_stopping_ && request->answer.empty())
            request->answer = error_text("the run is ending");
    }
    const std::string &path = request->path;
    if (path == "/stream.mjpg")
        return respond_with_stream(*request);
    if (path == "/api/events")
        return respond_with_events(*request);
    if (path == "/api/targets")
        return respond_with_targets(*request);
    if (path == "/snapshot.jpg")
        return respond_with_snapshot(*request);
    if (path == "/openapi.json")
        return respond(*request, MHD_HTTP_OK, "application/json", openapi_json());
    if (path != "/" && !path.starts_with(files_path) && path != "/api/status" && path != "/api/control" &&
        path != "/metrics")
        return refuse(*request, MHD_HTTP_NOT_FOUND, "there is no such resource");
    if (!request->answer.empty())
        return respond_with_answer(*request);
    return path == "/api/control" ? send_command(request) : ask_status(request);
}

bool Server::send_command(const SharedRequest &request) {
    if (!control_)
        return refuse(*request, MHD_HTTP_SERVICE_UNAVAILABLE, "this host does not accept commands");
    const arhost_status status =
        request->body.find('\0') != std::string::npos
            ? ARHOST_STATUS_ERROR_INVALID_ARGUMENT
            : control_.send(request->body, [this, request](const std::string &answer) { take(request, answer); });
    if (status == ARHOST_STATUS_ERROR_INVALID_ARGUMENT)
        return refuse(*request, MHD_HTTP_BAD_REQUEST, "a command must be a JSON object");
    if (status != ARHOST_STATUS_OK)
        return refuse(*request, MHD_HTTP_SERVICE_UNAVAILABLE, "the host is busy; retry later");
    return suspend_until_answer(request);
}

// All requests that arrive while the host answers receive the same answer. The host thus handles one command at a
// time, for any number of clients.
bool Server::ask_status(const SharedRequest &request) {
    bool sends = false;
    {
        const std::lock_guard lock(mutex_);
        waiting_for_status_.insert(request);
        sends = control_ && !std::exchange(is_status_pending_, true);
    }
    if (!control_)
        take_status(error_text("this host does not give its status"));
    else if (sends && control_.send(R"({"command":"status"})",
                                    [this](const std::string &answer) { take_status(answer); }) != ARHOST_STATUS_OK)
        take_status(error_text("the host is busy; retry later"));
    return suspend_until_answer(request);
}

bool Server::suspend_until_answer(const SharedRequest &request) {
    {
        const std::lock_guard lock(mutex_);
        if (request->answer.empty() && !is_stopping_) {
            suspended_.insert(request);
            request->was_suspended = true;
            ++unsent_answers_;
            MHD_suspend_connection(request->connection);
            return true;
        }
    }
    return process(request);
}

void Server::take(const SharedRequest &request, const std::string &answer) {
    const std::lock_guard lock(mutex_);
    request->answer = answer;
    resume(request);
}

void Server::take_status(const std::string &answer) {
    const std::lock_guard lock(mutex_);
    is_status_pending_ = false;
    for (const SharedRequest &request : std::exchange(waiting_for_status_, {})) {
        request->answer = answer;
        resume(request);
    }
}

void Server::resume(const SharedRequest &request) {
    if (suspended_.erase(request) > 0)
        MHD_resume_connection(request->connection);
}

bool Server::respond_with_answer(const Request &request) {
    if (request.path == "/")
        return respond_with_page(request);
    if (request.path.starts_with(files_path))
        return respond_with_file(request);
    if (request.path == "/metrics") {
        OwnCounts own{frame_.number(), frame_.encoded(), 0, 0};
        {
            const std::lock_guard lock(mutex_);
            own.viewers = static_cast<std::size_t>(std::ranges::count_if(viewers_, &Viewer::shows_pictures));
            own.connections = connections_.size();
        }
        return respond(request, MHD_HTTP_OK, "text/plain; version=0.0.4; charset=utf-8",
                       metrics(request.answer, own));
    }
    const bool is_ok = has_succeeded(request.answer);
    const unsigned failed =
        request.path == "/api/status" ? MHD_HTTP_SERVICE_UNAVAILABLE : MHD_HTTP_UNPROCESSABLE_CONTENT;
    return respond(request, is_ok ? MHD_HTTP_OK : failed, "application/json", request.answer);
}

bool Server::respond_with_page(const Request &request) {
    const std::string nonce = make_nonce();
    std::string status;
    for (const char c : request.answer)
        status += c == '<' ? "\\u003c" : std::string(1, c); // in JSON, '<' occurs only in strings
    const std::map<std::string_view, std::string> values = {
        {"nonce", nonce},
        {"status", status},
        {"width", std::to_string(settings_.width)},
        {"height", std::to_string(settings_.height)},
        {"needs_token", settings_.token.empty() ? "false" : "true"}};
    std::string page;
    std::string_view rest = page_html();
    for (std::size_t at = 0; (at = rest.find("{{")) != std::string_view::npos;) {
        const std::size_t end = rest.find("}}", at);
        page += rest.substr(0, at);
        page += values.at(rest.substr(at + 2, end - at - 2));
        rest.remove_prefix(end + 2);
    }
    page += rest;
    return respond(request, MHD_HTTP_OK, "text/html; charset=utf-8", page, nonce);
}

bool Server::respond_with_snapshot(const Request &request) {
    const std::shared_ptr<const Jpeg> jpeg = frame_.newest();
    if (!jpeg)
        return refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "there is no picture yet");
    return respond(request, MHD_HTTP_OK, "image/jpeg",
                   {reinterpret_cast<const char *>(jpeg->bytes.data()), jpeg->bytes.size()});
}

// The number in the request selects a file of the host's list, so the client cannot name any other file.
bool Server::respond_with_file(const Request &request) {
    if (!has_succeeded(request.answer)) {
        // Only if `status` is not granted, the host lists what is.
        const bool is_granted = request.answer.find("\"granted\":") == std::string::npos;
        return respond(request, is_granted ? MHD_HTTP_SERVICE_UNAVAILABLE : MHD_HTTP_FORBIDDEN, "application/json",
                       request.answer);
    }
    const auto path = path_of_file(request.answer, request.path.substr(files_path.size()));
    if (!path)
        return refuse(request, MHD_HTTP_NOT_FOUND, "the run has not written a file with this number");
    std::unique_ptr<Download> download;
    try {
        download.reset(new Download{this, request.connection, address_of(request.connection), RunFile(*path)});
    } catch (const std::exception &) {
        return refuse(request, MHD_HTTP_FORBIDDEN,
                      "this output cannot read the file: list its folder in the key 'reads' of the output sink_web");
    }
    if (!admit(*download))
        return refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "there are too many downloads; retry later");
    const std::uint64_t size = download->file.size();
    MHD_Response *response = MHD_create_response_from_callback(size, stream_block, Callbacks::read_file,
                                                               download.get(), Callbacks::free_download);
    if (!response) {
        Callbacks::free_download(download.release());
        return false;
    }
    download.release(); // NOLINT(bugprone-unused-return-value): the response owns it
    MHD_add_response_header(response, MHD_HTTP_HEADER_CONTENT_TYPE, "application/octet-stream");
    MHD_add_response_header(response, MHD_HTTP_HEADER_CONTENT_DISPOSITION, disposition_of(*path).c_str());
    return queue(request, MHD_HTTP_OK, response);
}

bool Server::respond_with_targets(const Request &request) {
    const NewestFrame::Poses poses = frame_.newest_poses();
    if (poses.number == 0)
        return refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "there is no frame yet");
    return respond(request, MHD_HTTP_OK, "application/json", poses.line);
}

bool Server::respond_with_stream(const Request &request) {
    auto viewer = std::make_unique<Viewer>(
        Viewer{this, request.connection, address_of(request.connection), Viewer::Shows::pictures});
    viewer->text = "--" + std::string(boundary) + "\r\n";
    return respond_to_viewer(request, std::move(viewer),
                             "multipart/x-mixed-replace; boundary=" + std::string(boundary));
}

bool Server::respond_with_events(const Request &request) {
    const char *const only = MHD_lookup_connection_value(request.connection, MHD_GET_ARGUMENT_KIND, "only");
    if (only && only != std::string_view("end"))
        return refuse(request, MHD_HTTP_BAD_REQUEST, "the value of 'only' must be 'end'");
    auto viewer = std::make_unique<Viewer>(Viewer{this, request.connection, address_of(request.connection),
                                                  only ? Viewer::Shows::end : Viewer::Shows::poses});
    return respond_to_viewer(request, std::move(viewer), "text/event-stream");
}

bool Server::respond_to_viewer(const Request &request, std::unique_ptr<Viewer> viewer, const std::string &type) {
    if (!admit(*viewer))
        return refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "there are too many viewers");
    MHD_Response *response = MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, stream_block, Callbacks::read,
                                                               viewer.get(), Callbacks::free_viewer);
    if (!response) {
        Callbacks::free_viewer(viewer.release());
        return false;
    }
    viewer.release(); // NOLINT(bugprone-unused-return-value): the response owns it
    MHD_add_response_header(response, MHD_HTTP_HEADER_CONTENT_TYPE, type.c_str());
    return queue(request, MHD_HTTP_OK, response);
}

// Registers a viewer of pictures or of events, for each of which the limits apply. If there are too many viewers, the
// address with the most of them loses one to an address with fewer. Returns false if this viewer has to wait.
bool Server::admit(Viewer &viewer) {
    const std::lock_guard lock(mutex_);
    std::vector<Viewer *> others;
    std::ranges::copy_if(viewers_, std::back_inserter(others),
                         [&](const Viewer *each) { return each->shows_pictures() == viewer.shows_pictures(); });
    std::map<std::string_view, std::size_t> counts;
    for (const Viewer *each : others)
        ++counts[each->address];
    if (counts[viewer.address] >= max_viewers_per_address)
        return false;
    if (others.size() >= max_viewers) {
        const auto count_of = [&](const Viewer *each) { return counts[each->address]; };
        Viewer *loser = *std::ranges::max_element(others, {}, count_of);
        if (count_of(loser) <= counts[viewer.address] + 1)
            return false;
        viewers_.erase(loser);
        ::shutdown(connections_.at(loser->connection).fd, SHUT_RDWR); // the server's thread then closes it
        if (std::exchange(loser->is_waiting, false))
            MHD_resume_connection(loser->connection);
    }
    viewers_.insert(&viewer);
    return true;
}

// Registers a download. Returns false if there are too many.
bool Server::admit(Download &download) {
    const std::lock_guard lock(mutex_);
    const auto same = std::ranges::count(downloads_, download.address, &Download::address);
    return downloads_.size() < max_downloads && same < max_downloads_per_address &&
           downloads_.insert(&download).second;
}

// Sets what the viewer receives next, unless it must wait for that.
Server::Next Server::prepare_next(Viewer &viewer) {
    bool has_new = false;
    {
        const std::lock_guard lock(mutex_);
        if (viewer.has_end || (is_stopping_ && (viewer.shows_pictures() || !has_run_ended_)))
            return Next::end;
        viewer.position = 0;
        if (is_stopping_) {
            viewer.has_end = true;
            viewer.text = "event: end\ndata: {}\n\n";
            return Next::ready;
        }
        const std::uint64_t number = frame_.number();
        const auto now = Clock::now();
        auto &deadline = connections_.at(viewer.connection).deadline;
        has_new = number > 0 && number != viewer.number && viewer.shows != Viewer::Shows::end;
        if (!has_new && ((number == 0 && viewer.shows_pictures()) || now - viewer.sent_at < repeat_time)) {
            deadline = Clock::time_point::max();
            viewer.is_waiting = true;
            viewer.text.clear();
            viewer.jpeg.reset();
            MHD_suspend_connection(viewer.connection);
            return Next::wait;
        }
        deadline = now + frame_time;
        viewer.sent_at = now;
    }
    if (viewer.shows_pictures()) {
        viewer.jpeg = frame_.newest();
        if (!viewer.jpeg)
            throw std::runtime_error("the encoder has failed");
        viewer.number = viewer.jpeg->number;
        viewer.text = "Content-Type: image/jpeg\r\nX-Received-Ns: " + std::to_string(viewer.jpeg->received.count()) +
                      "\r\nContent-Length: " + std::to_string(viewer.jpeg->bytes.size()) + "\r\n\r\n";
    } else if (has_new) {
        NewestFrame::Poses poses = frame_.newest_poses();
        viewer.number = poses.number;
        viewer.text = "event: frame\ndata: " + poses.line + "\n"; // the line ends with a line break
    } else {
        viewer.text = ":\n\n"; // a comment, which shows whether the client is still connected
    }
    return Next::ready;
}

// Copies the next bytes of the stream. Browsers show a frame only when they receive the boundary after it, so the
// boundary is sent with the frame.
std::ptrdiff_t Server::read_stream(Viewer &viewer, std::span<char> to) {
    static const std::string end = "\r\n--" + std::string(boundary) + "\r\n";
    const auto parts = [&]() -> std::array<std::string_view, 3> {
        if (!viewer.jpeg)
            return {viewer.text, {}, {}};
        return {
            viewer.text, {reinterpret_cast<const char *>(viewer.jpeg->bytes.data()), viewer.jpeg->bytes.size()}, end};
    };
    std::size_t size = 0;
    for (const std::string_view part : parts())
        size += part.size();
    if (viewer.position == size)
        if (const Next next = prepare_next(viewer); next != Next::ready)
            return next == Next::wait ? 0 : MHD_CONTENT_READER_END_OF_STREAM;
    std::size_t copied = 0, begin = 0; // position of the current part within the whole
    for (const std::string_view part : parts()) {
        if (viewer.position < begin + part.size() && copied < to.size()) {
            const std::string_view rest = part.substr(viewer.position - begin, to.size() - copied);
            std::ranges::copy(rest, to.data() + copied);
            copied += rest.size();
            viewer.position += rest.size();
        }
        begin += part.size();
    }
    return static_cast<std::ptrdiff_t>(copied);
}

bool Server::refuse(const Request &request, unsigned status, const std::string &error) {
    return respond(request, status, "application/json", error_text(error));
}

bool Server::respond(const Request &request, unsigned status, const char *type, std::string_view body,
                     const std::string &nonce) {
    limit_time(request.connection, response_time);
    MHD_Response *response =
        MHD_create_response_from_buffer(body.size(), const_cast<char *>(body.data()), MHD_RESPMEM_MUST_COPY);
    if (!response)
        return false;
    MHD_add_response_header(response, MHD_HTTP_HEADER_CONTENT_TYPE, type);
    if (status == MHD_HTTP_BAD_REQUEST) // where the next request begins is unknown
        MHD_add_response_header(response, MHD_HTTP_HEADER_CONNECTION, "close");
    if (status == MHD_HTTP_UNAUTHORIZED)
        MHD_add_response_header(response, MHD_HTTP_HEADER_WWW_AUTHENTICATE, "Bearer");
    if (status == MHD_HTTP_METHOD_NOT_ALLOWED)
        MHD_add_response_header(response, MHD_HTTP_HEADER_ALLOW,
                                request.path == "/api/control" ? "POST" : "GET, HEAD");
    return queue(request, status, response, nonce);
}

bool Server::queue(const Request &request, unsigned status, MHD_Response *response, const std::string &nonce) {
    const std::string policy =
        nonce.empty()
            ? "default-src 'none'; frame-ancestors 'none'"
            : "default-src 'none'; img-src 'self' data:; connect-src 'self'; style-src 'nonce-" + nonce +
                  "'; script-src 'nonce-" + nonce + "'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
    for (const auto &[name, value] : {std::pair{"Content-Security-Policy", policy.c_str()},
                                      {"X-Content-Type-Options", "nosniff"},
                                      {"X-Frame-Options", "DENY"},
                                      {"Cross-Origin-Resource-Policy", "same-origin"},
                                      {"Cross-Origin-Opener-Policy", "same-origin"},
                                      {"Referrer-Policy", "no-referrer"},
                                      {"Cache-Control", "no-store"}})
        MHD_add_response_header(response, name, value);
    const MHD_Result queued = MHD_queue_response(request.connection, status, response);
    MHD_destroy_response(response);
    return queued == MHD_YES;
}

} // namespace arhost::web
