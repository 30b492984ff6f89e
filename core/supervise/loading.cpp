// SPDX-License-Identifier: Apache-2.0
#include "supervise/loading.hpp"

namespace arhost::supervise {

using namespace ipc;

sandbox::Policy policy_of_scene_loader(sandbox::Mode mode) {
    sandbox::Policy policy;
    policy.mode = mode;
    policy.makes_shared_memory = true;
    for (const auto &entry : std::filesystem::directory_iterator("/"))
        if (const auto name = entry.path().filename(); name != "proc" && name != "sys" && name != "dev")
            policy.readable.push_back(entry.path());
    policy.readable.push_back("/dev/shm"); // contains files in memory, not devices
    return policy;
}

void Loading::set_deadlines() {
    restart_deadline();
    total_deadline_ = context_.reactor.at(context_.reactor.now() + job_.limits.start_total, [this] {
        process_.end("took longer than " + std::to_string(job_.limits.start_total.count()) +
                     " ms, the limit in total" +
                     (job_.limit_key.empty() ? "" : " (30 times " + job_.limit_key + ")"));
    });
}

void Loading::restart_deadline() {
    deadline_ = context_.reactor.at(context_.reactor.now() + job_.limits.start, [this] {
        process_.end("made no progress for " + std::to_string(job_.limits.start.count()) + " ms" +
                     (job_.limit_key.empty() ? "" : " (" + job_.limit_key + ")"));
    });
}

void Loading::fail(const std::string &reason) {
    if (failure_.empty())
        failure_ = reason;
    process_.end("no longer needed");
}

void Loading::on_message(Message &message) {
    restart_deadline();
    if (is<messages::Failed>(message)) {
        if (failure_.empty())
            failure_ = parse<messages::Failed>(message).text;
    } else if (is<messages::Loaded>(message) && message.fds.size() == 1) {
        memory_ = std::move(message.fds[0]);
    } else if (is<messages::Progress>(message)) {
        budget_.log(ARHOST_SEVERITY_DEBUG, parse<messages::Progress>(message).what);
    } else {
        callbacks_.message(message);
    }
}

void Loading::on_died(const Death &death) {
    deadline_.cancel();
    total_deadline_.cancel();
    const Callbacks callbacks = std::move(callbacks_);
    const std::string worker = job_.file.string() + ": the " + job_.worker;
    if (failure_.empty() && (!death.clean || !memory_))
        failure_ = worker + " failed: " + death.how;
    if (!failure_.empty())
        return callbacks.failed(std::string(failure_));
    SharedMemory memory;
    Mapping mapping;
    try {
        // The worker has exited, so no writable mapping should exist. adopt_and_freeze throws if one does.
        memory = SharedMemory::adopt_and_freeze(std::move(memory_));
        mapping = memory.map(Access::read_only);
    } catch (const std::exception &error) {
        return callbacks.failed(worker + " has returned memory that cannot be used: " + error.what());
    }
    callbacks.loaded(std::move(memory), mapping.bytes());
}

} // namespace arhost::supervise
