// SPDX-License-Identifier: Apache-2.0
#include "host/probe.hpp"

namespace arhost::host {

using namespace ipc;

namespace {

// Opens the plugin in a worker, and hands its messages to `take` until that returns true: "". Otherwise the reason
// why it never did. `late`: the reason where `timeout` is over.
std::string converse(supervise::Context &context, const std::filesystem::path &plugin, const sandbox::Policy &policy,
                     std::chrono::seconds timeout, const std::string &late,
                     const std::function<bool(supervise::Process &, const Json &)> &take) {
    std::string reason;
    bool taken = false, dead = false;
    supervise::Process *running = nullptr;
    supervise::Process::Events events;
    events.message = [&](Message &message) {
        try {
            if (message.body.at("type") == "failed")
                reason = message.body.at("text").get<std::string>();
            else if (!taken)
                taken = take(*running, message.body);
        } catch (const std::exception &error) {
            reason = std::string("what it tells is not valid: ") + error.what();
        }
        if (taken || !reason.empty())
            running->kill_now();
    };
    events.result = [](const Result &) {};
    events.died = [&](const supervise::Death &death) {
        if (!taken && reason.empty())
            reason = death.how;
        dead = true;
    };
    supervise::Process process(
        context, plugin.stem().string(), std::move(events),
        Json{{"type", "open"}, {"plugin", plugin.string()}, {"sandbox", sandbox::to_json(policy)}});
    running = &process;
    const auto deadline = context.reactor.at(Reactor::Clock::now() + timeout, [&] {
        process.end(late + " within " + std::to_string(timeout.count()) + " s");
    });
    while (!dead)
        context.reactor.run_once();
    return taken ? "" : reason;
}

} // namespace

ProbeResult probe(supervise::Context &context, const std::filesystem::path &plugin, sandbox::Policy policy,
                  std::string *level) {
    policy.writable.clear();
    PluginDescription description;
    std::string reason = converse(context, plugin, policy, std::chrono::seconds(10), "did not say hello",
                                  [&](supervise::Process &, const Json &message) {
                                      if (message.at("type") != "hello")
                                          return false;
                                      description = description_from_json(message.at("descriptor"));
                                      if (level)
                                          *level = message.at("sandbox").get<std::string>();
                                      return true;
                                  });
    if (!reason.empty())
        return reason;
    return description;
}

DevicesResult list_devices(supervise::Context &context, const std::filesystem::path &plugin, sandbox::Policy policy,
                           const std::vector<std::string> &needs, std::chrono::seconds timeout) {
    policy.writable.clear();
    for (const std::string &need : needs)
        if (need == "video" || need == "usb" || need == "gpu")
            policy.allow.insert(need);
    std::optional<DeviceList> list;
    std::string reason = converse(context, plugin, policy, timeout, "no answer",
                                  [&](supervise::Process &process, const Json &message) {
                                      if (message.at("type") == "hello")
                                          process.send({{"type", "devices"}});
                                      if (message.at("type") != "devices")
                                          return false;
                                      if (message.contains("devices"))
                                          list = devices_from_json(message);
                                      return true;
                                  });
    if (!reason.empty())
        return reason;
    return list;
}

} // namespace arhost::host
