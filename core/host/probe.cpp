// SPDX-License-Identifier: Apache-2.0
#include "host/probe.hpp"

namespace arhost::host {

using namespace ipc;

namespace {

// Opens the plugin in a worker and passes the worker's messages to `on_message` until it returns true. Returns "" or
// the reason for the failure; if the timeout expires, the reason starts with `late`.
std::string query(supervise::Context &context, const std::filesystem::path &plugin, const sandbox::Policy &policy,
                  std::chrono::seconds timeout, const std::string &late,
                  const std::function<bool(supervise::Process &, const Message &)> &on_message) {
    std::string reason;
    bool done = false, dead = false;
    supervise::Process *running = nullptr;
    supervise::Process::Callbacks callbacks;
    callbacks.message = [&](Message &message) {
        try {
            if (is<messages::Failed>(message))
                reason = parse<messages::Failed>(message).text;
            else if (!done)
                done = on_message(*running, message);
        } catch (const std::exception &error) {
            reason = std::string("the worker's response is invalid: ") + error.what();
        }
        if (done || !reason.empty())
            running->kill_now();
    };
    callbacks.result = [](const Result &) {};
    callbacks.died = [&](const supervise::Death &death) {
        if (!done && reason.empty())
            reason = death.how;
        dead = true;
    };
    supervise::WorkerBudget budget(context.log, plugin.stem().string());
    supervise::Process process(context, budget, std::move(callbacks), messages::Open{plugin.string(), policy});
    running = &process;
    const auto deadline = context.reactor.at(Reactor::Clock::now() + timeout, [&] {
        process.end(late + " within " + std::to_string(timeout.count()) + " s");
    });
    while (!dead)
        context.reactor.run_once();
    return done ? "" : reason;
}

} // namespace

ProbeResult probe(supervise::Context &context, const std::filesystem::path &plugin, sandbox::Policy policy,
                  std::string *level) {
    policy.writable.clear();
    messages::Hello hello;
    const std::string reason = query(context, plugin, policy, std::chrono::seconds(10), "did not respond",
                                     [&](supervise::Process &, const Message &message) {
                                         if (!is<messages::Hello>(message))
                                             return false;
                                         hello = parse<messages::Hello>(message);
                                         return true;
                                     });
    if (!reason.empty())
        return reason;
    if (level)
        *level = hello.sandbox;
    return hello.descriptor;
}

DevicesResult list_devices(supervise::Context &context, const std::filesystem::path &plugin, sandbox::Policy policy,
                           const std::vector<std::string> &needs, std::chrono::seconds timeout) {
    policy.writable.clear();
    for (const std::string &need : needs)
        if (need == "video" || need == "usb" || need == "gpu" || need == "display")
            policy.allow.insert(need);
    std::string text;
    std::optional<DeviceList> list;
    const std::string reason = query(context, plugin, policy, timeout, "did not respond",
                                     [&](supervise::Process &process, const Message &message) {
                                         if (is<messages::Hello>(message))
                                             process.send(messages::ListDevices{});
                                         if (!is<messages::Devices>(message))
                                             return false;
                                         const auto devices = parse<messages::Devices>(message);
                                         text += devices.part;
                                         if (text.size() > max_device_list_size)
                                             throw std::runtime_error("its list of devices is too long");
                                         if (devices.is_last)
                                             list = devices_from_text(text);
                                         return devices.is_last;
                                     });
    if (!reason.empty())
        return reason;
    return list;
}

} // namespace arhost::host
