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
    : callbacks_(std::move(callbacks)), files_(std::move(files)), scene_(scene.string()),
      loading_(context, {scene, "scene", "scene loader", limits, "raytracer.start_deadline_ms"},
               messages::Load{scene_, {raytracer.readable.begin(), raytracer.readable.end()}},
               supervise::policy_of_scene_loader(raytracer.mode),
               {[this](const Message &message) { on_message(message); },
                [this](SharedMemory arena, std::span<const std::byte> bytes) { on_loaded(std::move(arena), bytes); },
                [this](const std::string &reason) {
                    const Callbacks failing = std::move(callbacks_); // may destroy this object
                    failing.failed(reason, Callbacks::Files(files_read_));
                }}) {}

void SceneLoading::on_message(const Message &message) {
    if (is<messages::Reads>(message)) {
        const auto reads = parse<messages::Reads>(message);
        check_read({reads.path, reads.node});
    } else if (is<messages::AnchorOrigin>(message)) {
        if (anchor_origins_.size() < ARHOST_MAX_TARGETS)
            anchor_origins_.push_back(base::printable(parse<messages::AnchorOrigin>(message).text));
    }
}

void SceneLoading::check_read(const base::FileIdentity &file) {
    if (files_read_.size() < max_files_read && std::filesystem::path(file.path).is_absolute())
        files_read_.insert(file.path);
    try {
        files_.check_read(file);
    } catch (const yaml::Error &error) {
        loading_.fail(error.what());
    }
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

void SceneLoading::on_loaded(SharedMemory arena, std::span<const std::byte> bytes) {
    // The callbacks may destroy this object.
    const Callbacks callbacks = std::move(callbacks_);
    const Callbacks::Files files = std::move(files_read_);
    const std::string scene = scene_;
    if (const std::string fault = scene::validate(bytes); !fault.empty())
        return callbacks.failed(scene + ": the loaded scene is invalid, which is a bug in arhost: " + fault, files);
    try {
        callbacks.loaded(std::move(arena), anchors_of(*reinterpret_cast<const arhost_scene *>(bytes.data())), files);
    } catch (const std::exception &error) {
        callbacks.failed(scene + ": the loaded scene cannot be used: " + error.what(), files);
    }
}

} // namespace arhost::host
