// SPDX-License-Identifier: Apache-2.0
#include "worker/session.hpp"

#include "sandbox/sandbox.hpp"
#include "worker/devices.hpp"
#include "worker/library.hpp"
#include "worker/loader.hpp"
#include "worker/services.hpp"

#include <cstdlib>
#include <ctime>
#include <malloc.h>
#include <sys/prctl.h>

namespace arhost::worker {
namespace {

using namespace ipc;

// The host's callbacks for a plugin, and the last error that it logged, for `failed`.
class HostSide {
public:
    explicit HostSide(Link &link)
        : link_(link), host_{sizeof host_, ARHOST_ABI_VERSION, "arhost",      ARHOST_VERSION, this,
                             &on_log,      &on_progress,       &on_cancelled, &on_extension} {}
    const arhost_host *get() const { return &host_; }
    std::string last_error() const {
        std::lock_guard lock(mutex_);
        return last_error_;
    }
    // The message for a call that the plugin has failed in.
    Json failed(arhost_status status) const {
        const std::string reason = last_error();
        return {
            {"type", "failed"}, {"status", status}, {"text", reason.empty() ? "the plugin gave no reason" : reason}};
    }

private:
    static HostSide &self(const arhost_host *host) { return *static_cast<HostSide *>(host->context); }
    static void on_log(const arhost_host *host, arhost_severity severity, const char *text) {
        const std::string copy = text ? text : "";
        if (severity == ARHOST_SEVERITY_ERROR) {
            std::lock_guard lock(self(host).mutex_);
            self(host).last_error_ = copy;
        }
        self(host).link_.log(severity, copy);
    }
    static void on_progress(const arhost_host *host, double fraction, const char *what) {
        self(host).link_.progress(fraction, what);
    }
    static std::int32_t on_cancelled(const arhost_host *host) { return self(host).link_.cancelled(); }
    static const void *on_extension(const arhost_host *, const char *) { return nullptr; }

    Link &link_;
    arhost_host host_;
    mutable std::mutex mutex_;
    std::string last_error_;
};

// One plugin, from `create` to `destroy`.
class Session {
public:
    Session(Link &link, const HostSide &host, const arhost_plugin &plugin)
        : link_(link), host_(host), plugin_(plugin) {}
    ~Session() {
        if (!instance_)
            return;
        Link::InCall call(link_, Call::destroy);
        plugin_.destroy(instance_);
    }
    Session(const Session &) = delete;
    Session &operator=(const Session &) = delete;

    int run(const Message &create) {
        if (!make(create))
            return EXIT_FAILURE;
        const auto timeout = std::chrono::milliseconds(service_->wants_idle() ? 33 : 1000);
        while (!stopped_) {
            const auto command = link_.next(timeout);
            if (!command)
                idle();
            else if (command->kind == CommandKind::control)
                take_message();
            else
                execute(*command);
        }
        return EXIT_SUCCESS;
    }

private:
    bool make(const Message &create) {
        const std::vector<OptionValue> values = options_from_json(create.body.at("options"));
        std::vector<arhost_option> options;
        options.reserve(values.size());
        for (const OptionValue &v : values)
            options.push_back({sizeof(arhost_option), v.type, v.key.c_str(), v.integer, v.real, v.text.c_str()});
        arhost_status status;
        {
            Link::InCall call(link_, Call::create);
            status =
                plugin_.create(host_.get(), options.data(), static_cast<std::uint32_t>(options.size()), &instance_);
        }
        if (status == ARHOST_STATUS_OK && !instance_)
            throw std::runtime_error("the plugin's create succeeded without an instance");
        Json ready = {{"type", "ready"}};
        if (status == ARHOST_STATUS_OK) {
            service_ = make_service(plugin_, instance_);
            Link::InCall call(link_, Call::start);
            status = service_->start(create, ready);
        }
        if (status != ARHOST_STATUS_OK) {
            link_.send(host_.failed(status));
            return false;
        }
        link_.send(ready);
        link_.serving = true;
        return true;
    }

    void idle() {
        Link::InCall call(link_, Call::idle);
        if (service_->wants_idle() && service_->idle() == ARHOST_STATUS_END)
            link_.send({{"type", "end"}});
    }

    void execute(const Command &command) {
        Result result{};
        result.ticket = command.ticket;
        const auto begin = std::chrono::steady_clock::now();
        {
            Link::InCall call(link_, Call::per_frame);
            result.status = service_->execute(command, memory_, result);
        }
        result.busy_ns = (std::chrono::steady_clock::now() - begin).count();
        link_.answer(result);
    }

    void take_message() {
        Message message = link_.receive();
        const std::string type = message.body.at("type").get<std::string>();
        if (type == "attach") {
            const bool output = message.body.at("role") == "output";
            const auto generation = message.body.at("generation").get<std::uint32_t>();
            if (message.fds.size() != 1)
                throw HostGone("no memory came with 'attach'");
            const SharedMemory memory = SharedMemory::adopt(std::move(message.fds[0]));
            Memory::Region region{layout_from_json(message.body.at("layout")),
                                  memory.map(output ? Access::read_write : Access::read_only)};
            if (region.layout.byte_size() > memory.size())
                throw HostGone("the slots do not fit into their memory");
            (output ? memory_.output : memory_.inputs[generation]) = std::move(region);
            link_.send({{"type", "attached"}, {"role", message.body.at("role")}, {"generation", generation}});
        } else if (type == "detach") {
            const auto generation = message.body.at("generation").get<std::uint32_t>();
            memory_.inputs.erase(generation);
            link_.send({{"type", "detached"}, {"generation", generation}});
        } else if (type == "stop") {
            Link::InCall call(link_, Call::stop);
            const arhost_status status = service_->stop();
            link_.send({{"type", "stopped"},
                        {"status", status},
                        {"text", status == ARHOST_STATUS_OK ? std::string() : host_.last_error()}});
            stopped_ = true;
        } else {
            throw HostGone("the host sent a message of unknown type '" + type + "'");
        }
    }

    Link &link_;
    const HostSide &host_;
    const arhost_plugin &plugin_;
    Memory memory_;
    arhost_instance *instance_ = nullptr;
    std::unique_ptr<Service> service_;
    bool stopped_ = false;
};

// Whoever reads the log sees what this machine lacks.
sandbox::Level tell(const Link &link, sandbox::Level level) {
    link.log(sandbox::complete(level) ? ARHOST_SEVERITY_DEBUG : ARHOST_SEVERITY_INFO,
             "sandbox: " + sandbox::to_text(level));
    return level;
}

Json answer_devices(const Link &link, const HostSide &host, const arhost_plugin &plugin) {
    Json answer = {{"type", "devices"}};
    const Link::InCall call(link, Call::devices);
    const arhost_status status = list_devices(plugin, *host.get(), answer);
    return status == ARHOST_STATUS_OK ? answer : host.failed(status);
}

int serve(Link &link) {
    Message open = link.receive();
    const std::string type = open.body.at("type").get<std::string>();
    const sandbox::Policy policy = sandbox::policy_from_json(open.body.at("sandbox"));
    if (type == "load") {
        tell(link, sandbox::enter(policy));
        return load_scene_for(link, open);
    }
    if (type != "open")
        throw HostGone("the host's first message is not 'open'");
    link.map_pages(open);
    const std::string file = open.body.at("plugin").get<std::string>();
    // Before anything is opened that nobody vouches for: a library's constructors run when it is loaded.
    const sandbox::Level level = tell(link, sandbox::enter_for(file, policy));
    const arhost_entry_point *entry = nullptr;
    {
        Link::InCall call(link, Call::load);
        entry = &open_library(file);
    }
    const arhost_plugin *plugin = nullptr;
    {
        Link::InCall call(link, Call::negotiate);
        plugin = &negotiate(file, *entry);
    }
    ::prctl(PR_SET_NAME, plugin->descriptor->id);
    link.send(
        {{"type", "hello"}, {"descriptor", to_json(*plugin->descriptor)}, {"sandbox", sandbox::to_text(level)}});
    HostSide host(link);
    Message next = link.receive();
    for (; next.body.at("type") == "devices"; next = link.receive())
        link.send(answer_devices(link, host, *plugin));
    return Session(link, host, *plugin).run(next);
}

} // namespace

void keep_freed_memory() {
#ifdef __GLIBC__
    constexpr int mib = 1 << 20;
    ::mallopt(M_MMAP_THRESHOLD, 32 * mib); // the most that it takes
    ::mallopt(M_TRIM_THRESHOLD, 64 * mib);
#endif
}

int work(Link &link) {
    try {
        return serve(link);
    } catch (const HostGone &) {
        return EXIT_FAILURE; // nobody is left to tell
    } catch (const std::exception &error) {
        try {
            const arhost_status status =
                link.serving ? ARHOST_STATUS_ERROR_INTERNAL : ARHOST_STATUS_ERROR_CONFIGURATION;
            link.send({{"type", "failed"}, {"status", status}, {"text", error.what()}});
        } catch (const HostGone &) {
        }
        return EXIT_FAILURE;
    }
}

} // namespace arhost::worker
