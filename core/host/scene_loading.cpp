// SPDX-License-Identifier: Apache-2.0
#include "host/scene_loading.hpp"

#include "base/text.hpp"
#include "host/outcome.hpp"
#include "scene/arena_builder.hpp"

#include <arhost/tracker.h>

#include <algorithm>

namespace arhost::host {

using namespace ipc;

namespace {

constexpr std::size_t max_files_read = 4096; // of which `loaded` and `failed` report; the loader is not trusted

// Returns the sandbox policy of the scene loader. Which files a scene and its meshes refer to is known only after
// parsing, so the loader may read everything except /proc, /sys and devices. Its only output is the arena.
sandbox::Policy policy_of(sandbox::Mode mode) {
    sandbox::Policy policy;
    policy.mode = mode;
    policy.makes_shared_memory = true;
    for (const auto &entry : std::filesystem::directory_iterator("/"))
        if (const auto name = entry.path().filename(); name != "proc" && name != "sys" && name != "dev")
            policy.readable.push_back(entry.path());
    policy.readable.push_back("/dev/shm"); // contains files in memory, not devices
    return policy;
}

} // namespace

std::string problem_with(const std::vector<Anchor> &anchors, const run_config::TrackerConfiguration *tracker) {
    for (const Anchor &anchor : anchors) {
        if (!tracker)
            return anchor.where + ": no tracker runs that could find the target '" + base::printable(anchor.target) +
                   "'; remove this key, or run a tracker with this target";
        if (std::ranges::find(tracker->targets, anchor.target, &model::Target::name) == tracker->targets.end())
            return anchor.where + ": there is no target '" + base::printable(anchor.target) +
                   "'; the tracker looks for " + describe_targets(tracker->targets) +
                   "; correct the name, or add the target";
    }
    return "";
}

SceneLoading::SceneLoading(supervise::Context &context, const std::filesystem::path &scene,
                           const sandbox::Policy &raytracer, const base::Limits &limits, run_config::FilesInUse files,
                           Callbacks callbacks)
    : context_(context), callbacks_(std::move(callbacks)), files_(std::move(files)), scene_(scene.string()),
      timeout_(limits.start), budget_(context.log, "scene") {
    supervise::Process::Callbacks process_callbacks;
    process_callbacks.message = [this](Message &message) { on_message(message); };
    process_callbacks.result = [](const Result &) {};
    process_callbacks.died = [this](const supervise::Death &death) { on_died(death); };
    process_ = std::make_unique<supervise::Process>(
        context, budget_, std::move(process_callbacks),
        messages::Load{scene_, {raytracer.readable.begin(), raytracer.readable.end()}}, policy_of(raytracer.mode));
    restart_deadline();
    total_deadline_ = context_.reactor.at(context_.reactor.now() + limits.start_total, [this, limits] {
        process_->end("took longer than " + std::to_string(limits.start_total.count()) +
                      " ms, the limit in total (30 times raytracer.start_deadline_ms)");
    });
}

void SceneLoading::on_message(Message &message) {
    restart_deadline();
    if (is<messages::Failed>(message)) {
        fail(parse<messages::Failed>(message).text);
    } else if (is<messages::Loaded>(message) && message.fds.size() == 1) {
        arena_ = std::move(message.fds[0]);
    } else if (is<messages::Reads>(message)) {
        const auto reads = parse<messages::Reads>(message);
        check_read({reads.path, reads.node});
    } else if (is<messages::AnchorOrigin>(message)) {
        if (anchor_origins_.size() < ARHOST_MAX_TARGETS)
            anchor_origins_.push_back(base::printable(parse<messages::AnchorOrigin>(message).text));
    } else if (is<messages::Progress>(message)) {
        budget_.log(ARHOST_SEVERITY_DEBUG, parse<messages::Progress>(message).what);
    }
}

void SceneLoading::restart_deadline() {
    deadline_ = context_.reactor.at(context_.reactor.now() + timeout_, [this] {
        process_->end("made no progress for " + std::to_string(timeout_.count()) +
                      " ms (raytracer.start_deadline_ms)");
    });
}

void SceneLoading::check_read(const base::FileIdentity &file) {
    if (files_read_.size() < max_files_read && std::filesystem::path(file.path).is_absolute())
        files_read_.insert(file.path);
    try {
        files_.check_read(file);
    } catch (const yaml::Error &error) {
        fail(error.what());
        process_->end("no longer needed");
    }
}

void SceneLoading::fail(const std::string &reason) {
    if (failure_.empty()) // keep the first reason, as later failures may only be its consequences
        failure_ = reason;
}

// The arena is valid.
std::vector<Anchor> SceneLoading::anchors_of(const arhost_scene &scene) const {
    const auto *arena = reinterpret_cast<const char *>(&scene);
    const auto *anchors = reinterpret_cast<const arhost_anchor *>(arena + scene.anchors.offset);
    std::vector<Anchor> all;
    for (std::uint32_t i = 0; i < scene.anchors.count; ++i)
        all.push_back({arena + scene.names.offset + anchors[i].target,
                       i < anchor_origins_.size() ? anchor_origins_[i] : scene_});
    return all;
}

void SceneLoading::on_died(const supervise::Death &death) {
    deadline_.cancel();
    total_deadline_.cancel();
    const Callbacks callbacks = std::move(callbacks_);
    const std::set<std::filesystem::path> files = std::move(files_read_);
    if (!failure_.empty() || !death.clean || !arena_)
        return callbacks.failed(
            failure_.empty() ? scene_ + ": the scene loader failed: " + death.how : std::string(failure_), files);
    try {
        // The loader has exited, so no writable mapping of the arena should exist. adopt_and_freeze throws if one
        // does.
        SharedMemory arena = SharedMemory::adopt_and_freeze(std::move(arena_));
        const Mapping mapping = arena.map(Access::read_only);
        if (const std::string fault = scene::validate(mapping.bytes()); !fault.empty())
            return callbacks.failed(scene_ + ": the loaded scene is invalid, which is a bug in arhost: " + fault,
                                    files);
        callbacks.loaded(std::move(arena), anchors_of(mapping.as<const arhost_scene>()), files);
    } catch (const std::exception &error) {
        callbacks.failed(std::string("the scene loader's memory cannot be used: ") + error.what(), files);
    }
}

} // namespace arhost::host
