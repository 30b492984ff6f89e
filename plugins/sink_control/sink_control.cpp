// SPDX-License-Identifier: Apache-2.0
//
// sink_control: transfers commands from `arhost ctl` and other programs of the same user to the host. Each line from
// a client is a command; each line to a client is the answer to one command. The plugin serves its clients between
// frames, so it needs no thread.
#include <arhost-cpp/plugin.hpp>

#include <fcntl.h>
#include <memory>
#include <sys/socket.h>
#include <unistd.h>
#include <utility>

namespace {

constexpr std::size_t max_clients = 16, max_unsent = 1 << 20; // bytes

class Client {
public:
    explicit Client(int fd) : fd_(fd) {}
    ~Client() { ::close(fd_); }
    Client(const Client &) = delete;
    Client &operator=(const Client &) = delete;

    // Receives commands and sends answers without waiting. Returns false if the client has disconnected or is too
    // slow.
    bool serve(arhost::HostControl &control, const std::shared_ptr<Client> &self) {
        char buffer[4096];
        const ssize_t size = ::recv(fd_, buffer, sizeof buffer, MSG_DONTWAIT);
        if (size == 0)
            has_left_ = true;
        else if (size > 0)
            received_.append(buffer, static_cast<std::size_t>(size));
        else if (errno != EAGAIN && errno != EINTR)
            return false;
        while (pending_ < max_pending) {
            const std::size_t end = received_.find('\n');
            if (end == std::string::npos)
                break;
            send_command(control, received_.substr(0, end), self);
            received_.erase(0, end + 1);
        }
        if (received_.size() > ARHOST_MAX_COMMAND_SIZE + sizeof buffer)
            return false;
        return flush() && !(has_left_ && pending_ == 0);
    }

private:
    static constexpr int max_pending = 2; // maximum number of unanswered commands of this client

    void send_command(arhost::HostControl &control, const std::string &command, const std::shared_ptr<Client> &self) {
        ++pending_;
        const arhost_status status = control.send(command, [self](const std::string &answer) {
            --self->pending_;
            self->unsent_ += answer + "\n";
            self->flush();
        });
        if (status == ARHOST_STATUS_OK)
            return;
        --pending_;
        unsent_ += status == ARHOST_STATUS_ERROR_INVALID_ARGUMENT
                       ? "{\"ok\":false,\"error\":\"a command must be a JSON object in one line\"}\n"
                       : "{\"ok\":false,\"error\":\"the host is busy; retry later\"}\n";
    }

    bool flush() {
        const ssize_t sent = ::send(fd_, unsent_.data(), unsent_.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
        if (sent > 0)
            unsent_.erase(0, static_cast<std::size_t>(sent));
        return (sent >= 0 || errno == EAGAIN || errno == EINTR) && unsent_.size() < max_unsent;
    }

    int fd_;
    bool has_left_ = false; // whether the client has sent its last command
    int pending_ = 0;
    std::string received_, unsent_;
};

class ControlSink {
public:
    ControlSink(const arhost::Host &host, const arhost::Options &options)
        : host_(host), control_(host), socket_(static_cast<int>(options.integer("listen"))) {
        if (socket_ < 0)
            throw arhost::Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "the option 'listen' must not be empty");
        host.info("listens at " + options.text("listen"));
    }

    void start(const arhost_sink_setup &) {
        if (!control_)
            throw arhost::Failure(ARHOST_STATUS_ERROR_UNSUPPORTED, "this host does not accept commands");
    }

    arhost_status write(const arhost_output &) { return idle(); }

    arhost_status idle() {
        while (clients_.size() < max_clients) {
            const int client = ::accept4(socket_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
            if (client < 0)
                break;
            if (is_own(client))
                clients_.push_back(std::make_shared<Client>(client));
            else
                ::close(client);
        }
        std::erase_if(clients_, [this](const auto &client) { return !client->serve(control_, client); });
        return ARHOST_STATUS_OK;
    }

private:
    // Returns whether the client is a process of the same user or of root.
    bool is_own(int client) const {
        ucred peer{};
        socklen_t size = sizeof peer;
        if (::getsockopt(client, SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0 &&
            (peer.uid == ::geteuid() || peer.uid == 0))
            return true;
        host_.warn("rejected a connection of user " + std::to_string(peer.uid));
        return false;
    }

    arhost::Host host_;
    arhost::HostControl control_;
    int socket_;
    std::vector<std::shared_ptr<Client>> clients_;
};

constexpr arhost_option_descriptor options[] = {
    arhost::option(ARHOST_OPTION_LISTEN, "listen", "arhost",
                   "Name of this run for `arhost ctl --name NAME`, or the absolute path of a Unix socket."),
};

constexpr const char *needs[] = {"listen", nullptr};

constexpr arhost_descriptor descriptor = {
    .struct_size = sizeof(arhost_descriptor),
    .kind = ARHOST_KIND_SINK,
    .id = "org.arhost.sink_control",
    .name = "Control socket",
    .version = "0.1.0",
    .vendor = "arhost",
    .licence = "Apache-2.0",
    .description = "Passes commands from `arhost ctl` to the host.",
    .capabilities = ARHOST_SINK_CAPABILITY_REALTIME,
    .option_count = std::size(options),
    .options = options,
    .needs = needs,
};

} // namespace

ARHOST_SINK(ControlSink, descriptor)
