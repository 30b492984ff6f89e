// SPDX-License-Identifier: Apache-2.0
#include "supervise/probe.hpp"

namespace arhost::supervise {

std::string query(Context &context, const std::filesystem::path &plugin, sandbox::Policy policy,
                  std::chrono::seconds timeout,
                  const std::function<bool(Process &, const ipc::Message &)> &on_message) {
    policy.writable.clear();
    std::string reason;
    bool done = false, dead = false;
    Process *running = nullptr;
    Process::Callbacks callbacks;
    callbacks.message = [&](ipc::Message &message) {
        try {
            if (ipc::is<ipc::messages::Failed>(message))
                reason = ipc::parse<ipc::messages::Failed>(message).text;
            else if (!done)
                done = on_message(*running, message);
        } catch (const std::exception &error) {
            reason = std::string("the worker's response is invalid: ") + error.what();
        }
        if (done || !reason.empty())
            running->kill_now();
    };
    callbacks.result = [](const ipc::Result &) {};
    callbacks.died = [&](const Death &death) {
        if (!done && reason.empty())
            reason = death.how;
        dead = true;
    };
    WorkerBudget budget(context.log, plugin.stem().string());
    Process process(context, budget, std::move(callbacks), ipc::messages::Open{plugin.string()}, policy);
    running = &process;
    const auto deadline = context.reactor.at(context.reactor.now() + timeout, [&] {
        process.end("did not respond within " + std::to_string(timeout.count()) + " s");
    });
    while (!dead)
        context.reactor.run_once();
    return done ? "" : reason;
}

ProbeResult probe(Context &context, const std::filesystem::path &plugin, const sandbox::Policy &policy,
                  std::string *level) {
    ipc::messages::Hello hello;
    const std::string reason =
        query(context, plugin, policy, std::chrono::seconds(10), [&](Process &, const ipc::Message &message) {
            if (!ipc::is<ipc::messages::Hello>(message))
                return false;
            hello = ipc::parse<ipc::messages::Hello>(message);
            return true;
        });
    if (!reason.empty())
        return reason;
    if (const std::string problem = model::problem_with_id(hello.descriptor.id, plugin); !problem.empty())
        return plugin.string() + ": " + problem;
    if (level)
        *level = hello.sandbox;
    return hello.descriptor;
}

} // namespace arhost::supervise
