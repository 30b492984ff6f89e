// SPDX-License-Identifier: Apache-2.0
#include "host/scene_loading.hpp"

#include "scene/arena.hpp"

namespace arhost::host {

using namespace ipc;

namespace {

// Which files a scene, and the meshes that it names, name in turn is known when they have been parsed. So all
// may be read, but for the kernel's and devices; what comes out is an arena and no file.
sandbox::Policy policy_of(sandbox::Mode mode) {
    sandbox::Policy policy;
    policy.mode = mode;
    policy.makes_shared_memory = true;
    for (const auto &entry : std::filesystem::directory_iterator("/"))
        if (const auto name = entry.path().filename(); name != "proc" && name != "sys" && name != "dev")
            policy.readable.push_back(entry.path());
    policy.readable.push_back("/dev/shm"); // files in memory, not devices
    return policy;
}

} // namespace

SceneLoading::SceneLoading(supervise::Context &context, const std::filesystem::path &scene, sandbox::Mode sandbox,
                           std::chrono::milliseconds timeout, run_config::FilesInUse files, Hooks hooks)
    : context_(context), hooks_(std::move(hooks)), files_(std::move(files)), scene_(scene.string()),
      timeout_(timeout) {
    supervise::Process::Events events;
    events.message = [this](Message &message) {
        const std::string type = message.body.at("type").get<std::string>();
        watch();
        if (type == "failed")
            fail(message.body.at("text").get<std::string>());
        else if (type == "loaded" && message.fds.size() == 1)
            arena_ = std::move(message.fds[0]);
        else if (type == "reads")
            look_at({message.body.at("path").get<std::string>(), message.body.at("node").get<std::string>()});
        else if (type == "progress")
            context_.log(ARHOST_SEVERITY_DEBUG, "scene", message.body.at("what").get<std::string>());
    };
    events.result = [](const Result &) {};
    events.died = [this](const supervise::Death &death) { on_died(death); };
    process_ = std::make_unique<supervise::Process>(
        context, "scene", std::move(events),
        Json{{"type", "load"}, {"scene", scene.string()}, {"sandbox", sandbox::to_json(policy_of(sandbox))}});
    watch();
}

void SceneLoading::watch() {
    deadline_ = context_.reactor.at(Reactor::Clock::now() + timeout_, [this] {
        process_->end("without a word of progress for " + std::to_string(timeout_.count()) +
                      " ms (raytracer.start_deadline_ms)");
    });
}

void SceneLoading::look_at(const base::FileIdentity &file_read) {
    try {
        files_.check_read(file_read);
    } catch (const yaml::Error &error) {
        fail(error.what());
        process_->end("no longer needed");
    }
}

void SceneLoading::fail(const std::string &reason) {
    if (failure_.empty()) // the first is the cause
        failure_ = reason;
}

void SceneLoading::on_died(const supervise::Death &death) {
    deadline_.cancel();
    const Hooks hooks = std::move(hooks_);
    if (!failure_.empty() || !death.clean || !arena_)
        return hooks.failed(failure_.empty() ? scene_ + ": the scene loader was " + death.how : failure_);
    try {
        // The loader is gone, so nobody maps it writable; where somebody does, this throws.
        SharedMemory arena = SharedMemory::adopt_and_freeze(std::move(arena_));
        const Mapping mapping = arena.map(Access::read_only);
        if (const std::string fault = scene::validate(mapping.bytes()); !fault.empty())
            return hooks.failed(scene_ + ": the loaded scene is not valid, which is a fault of arhost: " + fault);
        hooks.loaded(std::move(arena));
    } catch (const std::exception &error) {
        hooks.failed(std::string("the scene loader's memory can't be used: ") + error.what());
    }
}

} // namespace arhost::host
