// SPDX-License-Identifier: Apache-2.0
#include "host/probe.hpp"

namespace arhost::host {

using namespace ring;

ProbeResult probe(supervise::Context &context, const std::filesystem::path &plugin, sandbox::Policy policy,
                  std::string *level) {
    policy.writable.clear();
    ProbeResult result = std::string();
    bool done = false;
    supervise::Process *running = nullptr;
    supervise::Process::Events events;
    events.message = [&](Message &message) {
        const std::string type = message.body.at("type").get<std::string>();
        try {
            if (type == "hello") {
                result = description_from_json(message.body.at("descriptor"));
                if (level)
                    *level = message.body.at("sandbox").get<std::string>();
            } else if (type == "failed") {
                result = message.body.at("text").get<std::string>();
            }
        } catch (const std::exception &error) {
            result = std::string("its descriptor is not valid: ") + error.what();
        }
        running->kill_now();
    };
    events.result = [](const Result &) {};
    events.died = [&](const supervise::Death &death) {
        if (std::string *reason = std::get_if<std::string>(&result); reason && reason->empty())
            *reason = death.how;
        done = true;
    };
    supervise::Process process(
        context, plugin.stem().string(), std::move(events),
        Json{{"type", "open"}, {"plugin", plugin.string()}, {"sandbox", sandbox::to_json(policy)}});
    running = &process;
    const auto deadline = context.reactor.at(Reactor::Clock::now() + std::chrono::seconds(10),
                                             [&] { process.end("did not say hello within 10 s"); });
    while (!done)
        context.reactor.run_once();
    return result;
}

} // namespace arhost::host
