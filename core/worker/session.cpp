// SPDX-License-Identifier: Apache-2.0
#include "worker/session.hpp"

#include "sandbox/sandbox.hpp"
#include "worker/command_sender.hpp"
#include "worker/counters.hpp"
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
using namespace model;

// The arhost_host that is passed to the plugin. Stores the last error that the plugin logged; the messages Failed and
// Stopped contain this error.
class PluginHost {
public:
    PluginHost(Link &link, arhost_kind kind)
        : link_(link), kind_(kind),
          sender_(link), host_{sizeof host_, ARHOST_ABI_VERSION, "arhost",      ARHOST_VERSION, this,
                               &on_log,      &on_progress,       &on_cancelled, &on_extension} {}
    const arhost_host *get() const { return &host_; }
    std::string last_error() const {
        std::lock_guard lock(mutex_);
        return last_error_;
    }
    void accept_commands() { sender_.enable(); }
    void deliver(const messages::Answer &answer) { sender_.deliver(answer); }
    // Returns the message to send after a plugin function has returned the error `status`.
    messages::Failed failed(arhost_status status) const {
        const std::string reason = last_error();
        return {status, reason.empty() ? "the plugin gave no reason" : reason};
    }

private:
    static PluginHost &self(const arhost_host *host) { return *static_cast<PluginHost *>(host->context); }
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
    static const void *on_extension(const arhost_host *host, const char *id) {
        static constexpr arhost_control control = {
            sizeof control, 0,
            [](const arhost_host *sink_host, const char *command, arhost_take_answer take, void *context) {
                return self(sink_host).sender_.send(command, take, context);
            }};
        return id && std::string_view(id) == ARHOST_CONTROL_EXTENSION && self(host).kind_ == ARHOST_KIND_SINK
                   ? &control
                   : nullptr;
    }

    Link &link_;
    arhost_kind kind_;
    CommandSender sender_;
    arhost_host host_;
    mutable std::mutex mutex_;
    std::string last_error_;
};

const arhost_set_option *set_option_of(const arhost_plugin &plugin) {
    return static_cast<const arhost_set_option *>(plugin.get_extension(ARHOST_SET_OPTION_EXTENSION));
}

PluginDescription describe_plugin(const arhost_plugin &plugin) {
    PluginDescription description = describe(*plugin.descriptor);
    if (const auto *extension = set_option_of(plugin))
        for (const char *const *key = extension->keys; *key; ++key)
            description.changeable.emplace_back(*key);
    return description;
}

// The result refers to the strings of `value`.
arhost_option to_abi(const OptionValue &value) {
    return {sizeof(arhost_option), value.type, value.key.c_str(), value.integer, value.real, value.text.c_str()};
}

// A plugin's instance, from create to destroy.
class Session {
public:
    Session(Link &link, PluginHost &host, const arhost_plugin &plugin) : link_(link), host_(host), plugin_(plugin) {}
    ~Session() {
        if (!instance_)
            return;
        Link::InCall call(link_, Call::destroy);
        plugin_.destroy(instance_);
    }
    Session(const Session &) = delete;
    Session &operator=(const Session &) = delete;

    int run(const messages::Create &create, const std::vector<base::UniqueFd> &fds) {
        if (!start(create, fds))
            return EXIT_FAILURE;
        const auto timeout = std::chrono::milliseconds(service_->wants_idle() ? 33 : 1000);
        while (!stopped_) {
            const auto command = link_.next_command(timeout);
            if (!command)
                idle();
            else if (command->kind == CommandKind::control)
                handle_message();
            else
                execute(*command);
        }
        return EXIT_SUCCESS;
    }

private:
    bool start(const messages::Create &create, const std::vector<base::UniqueFd> &fds) {
        std::vector<arhost_option> options;
        options.reserve(create.options.size());
        for (const OptionValue &value : create.options) {
            options.push_back(to_abi(value));
            if (value.type != ARHOST_OPTION_LISTEN || value.integer < 0)
                continue;
            if (std::cmp_greater_equal(value.integer, fds.size()))
                throw ProtocolViolation("'create' was sent without the socket of the option '" + value.key + "'");
            options.back().integer = fds[static_cast<std::size_t>(value.integer)].get();
        }
        arhost_status status;
        {
            Link::InCall call(link_, Call::create);
            status =
                plugin_.create(host_.get(), options.data(), static_cast<std::uint32_t>(options.size()), &instance_);
        }
        if (status == ARHOST_STATUS_OK && !instance_)
            throw std::runtime_error("the plugin's create returned ARHOST_STATUS_OK, but no instance");
        messages::Ready ready;
        if (status == ARHOST_STATUS_OK) {
            service_ = make_service(link_, *host_.get(), plugin_, instance_);
            Link::InCall call(link_, Call::start);
            status = service_->start(create.setup, fds, ready);
        }
        if (status != ARHOST_STATUS_OK) {
            link_.send(host_.failed(status));
            return false;
        }
        link_.send(ready);
        link_.serving = true;
        host_.accept_commands();
        return true;
    }

    void idle() {
        Link::InCall call(link_, Call::idle);
        if (service_->wants_idle() && service_->idle() == ARHOST_STATUS_END)
            link_.send(messages::End{});
    }

    void execute(const Command &command) {
        Result result{};
        result.ticket = command.ticket;
        const auto begin = std::chrono::steady_clock::now();
        {
            Link::InCall call(link_, Call::per_frame);
            result.status = service_->execute(command, memory_, result);
        }
        const auto end = std::chrono::steady_clock::now();
        result.busy_ns = (end - begin).count();
        result.ended_ns = std::chrono::nanoseconds(end.time_since_epoch()).count();
        if (result.status < 0) // the host may then end the process
            report_counters(end);
        link_.send_result(result);
        if (end >= next_counters_)
            report_counters(end);
    }

    // Sends the plugin's counters if they have changed.
    void report_counters(std::chrono::steady_clock::time_point now) {
        next_counters_ = now + std::chrono::milliseconds(500);
        Counters counters;
        {
            const Link::InCall call(link_, Call::counters);
            counters = list_counters(plugin_, instance_);
        }
        if (counters == counters_)
            return;
        counters_ = std::move(counters);
        link_.send(messages::CountersChanged{counters_});
    }

    void handle_message() {
        Message message = link_.receive();
        if (is<messages::Attach>(message)) {
            attach(parse<messages::Attach>(message), std::move(message.fds));
        } else if (is<messages::Detach>(message)) {
            const auto generation = parse<messages::Detach>(message).generation;
            memory_.inputs.erase(generation);
            link_.send(messages::Detached{generation});
        } else if (is<messages::Answer>(message)) {
            Link::InCall call(link_, Call::idle);
            host_.deliver(parse<messages::Answer>(message));
        } else if (is<messages::SetOption>(message)) {
            link_.send(set(parse<messages::SetOption>(message).option));
        } else if (is<messages::Stop>(message)) {
            report_counters(std::chrono::steady_clock::now());
            Link::InCall call(link_, Call::stop);
            const arhost_status status = service_->stop();
            link_.send(messages::Stopped{status, status == ARHOST_STATUS_OK ? std::string() : host_.last_error()});
            stopped_ = true;
        } else {
            throw ProtocolViolation("the host sent a message of unknown type " + message.body["type"].dump());
        }
    }

    messages::OptionSet set(const OptionValue &value) {
        const auto *extension = set_option_of(plugin_);
        if (!extension)
            throw ProtocolViolation("the host sent 'set-option' to a plugin without this extension");
        const arhost_option option = to_abi(value);
        arhost_status status;
        {
            Link::InCall call(link_, Call::set_option);
            status = extension->set(instance_, &option);
        }
        return {status, status == ARHOST_STATUS_OK ? std::string() : host_.last_error()};
    }

    void attach(const messages::Attach &attach, std::vector<base::UniqueFd> fds) {
        if (fds.size() != 1)
            throw ProtocolViolation("'attach' was sent without exactly one memory descriptor");
        const SharedMemory memory = SharedMemory::adopt(std::move(fds[0]));
        Memory::Region region{attach.layout, memory.map(attach.is_output ? Access::read_write : Access::read_only)};
        if (region.layout.byte_size() > memory.size())
            throw ProtocolViolation("the slots do not fit into their memory");
        (attach.is_output ? memory_.output : memory_.inputs[attach.generation]) = std::move(region);
        link_.send(messages::Attached{attach.is_output, attach.generation});
    }

    Link &link_;
    PluginHost &host_;
    const arhost_plugin &plugin_;
    Memory memory_;
    arhost_instance *instance_ = nullptr;
    std::unique_ptr<Service> service_;
    Counters counters_; // the values that were last sent
    std::chrono::steady_clock::time_point next_counters_;
    bool stopped_ = false;
};

sandbox::Level log_level(const Link &link, sandbox::Level level) {
    link.log(sandbox::complete(level) ? ARHOST_SEVERITY_DEBUG : ARHOST_SEVERITY_INFO,
             "sandbox: " + sandbox::to_text(level));
    return level;
}

void send_devices(const Link &link, const PluginHost &host, const arhost_plugin &plugin) {
    std::optional<devices::DeviceList> list;
    arhost_status status;
    {
        const Link::InCall call(link, Call::devices);
        status = list_devices(plugin, *host.get(), list);
    }
    if (status != ARHOST_STATUS_OK) {
        link.send(host.failed(status));
        return;
    }
    const std::string text = devices::to_text(list);
    for (std::size_t at = 0; at < text.size(); at += messages::Devices::max_part)
        link.send(messages::Devices{text.substr(at, messages::Devices::max_part),
                                    at + messages::Devices::max_part >= text.size()});
}

int serve_plugin(Link &link, const messages::Open &open) {
    // Enters the sandbox before the library is loaded, because loading runs the constructors of the library.
    const sandbox::Level level =
        log_level(link, sandbox::enter_for(open.plugin, sandbox::policy_from_json(open.sandbox)));
    const arhost_entry_point *entry = nullptr;
    {
        Link::InCall call(link, Call::load);
        entry = &open_library(open.plugin);
    }
    const arhost_plugin *plugin = nullptr;
    {
        Link::InCall call(link, Call::negotiate);
        plugin = &negotiate(open.plugin, *entry);
    }
    const PluginDescription description = describe_plugin(*plugin);
    ::prctl(PR_SET_NAME, description.short_name().c_str());
    link.send(messages::Hello{description, sandbox::to_text(level)});
    PluginHost host(link, plugin->descriptor->kind);
    Message next = link.receive();
    for (; is<messages::ListDevices>(next); next = link.receive())
        send_devices(link, host, *plugin);
    if (!is<messages::Create>(next))
        throw ProtocolViolation("the host's message after 'hello' is not 'create'");
    return Session(link, host, *plugin).run(parse<messages::Create>(next), next.fds);
}

int serve(Link &link) {
    Message first = link.receive();
    if (is<messages::Load>(first)) {
        const auto load = parse<messages::Load>(first);
        log_level(link, sandbox::enter(sandbox::policy_from_json(load.sandbox)));
        return load_scene(link, load);
    }
    if (is<messages::ReadLog>(first)) {
        const auto request = parse<messages::ReadLog>(first);
        log_level(link, sandbox::enter(sandbox::policy_from_json(request.sandbox)));
        return read_log(link, request);
    }
    if (!is<messages::Open>(first))
        throw ProtocolViolation("the host's first message is not 'open', 'load' or 'read-log'");
    link.map_pages(first);
    return serve_plugin(link, parse<messages::Open>(first));
}

} // namespace

void retain_freed_memory() {
#ifdef __GLIBC__
    constexpr int mib = 1 << 20;
    ::mallopt(M_MMAP_THRESHOLD, 32 * mib); // glibc's maximum
    ::mallopt(M_TRIM_THRESHOLD, 64 * mib);
#endif
}

int run(Link &link) {
    messages::Failed failed;
    try {
        return serve(link);
    } catch (const HostLost &) {
        return EXIT_FAILURE;
    } catch (const ProtocolViolation &error) {
        failed = {ARHOST_STATUS_ERROR_INTERNAL, std::string("protocol violation: ") + error.what()};
    } catch (const std::exception &error) {
        failed = {link.serving ? ARHOST_STATUS_ERROR_INTERNAL : ARHOST_STATUS_ERROR_CONFIGURATION, error.what()};
    }
    try {
        link.send(failed);
    } catch (const HostLost &) {
    }
    return EXIT_FAILURE;
}

} // namespace arhost::worker
