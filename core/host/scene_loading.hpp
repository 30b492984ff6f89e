// SPDX-License-Identifier: Apache-2.0
//
// Loads a scene in a sandboxed worker, as mesh parsers are attack surface, and validates the arena before others use
// it.
#pragma once

#include "base/limits.hpp"
#include "run_config/configuration.hpp"
#include "sandbox/sandbox.hpp"
#include "supervise/loading.hpp"

#include <arhost/scene.h>

#include <cstddef>
#include <filesystem>
#include <functional>
#include <set>
#include <span>
#include <string>
#include <vector>

namespace arhost::host {

// A target that objects belong to.
struct Anchor {
    std::string target;
    std::string where; // of the first object's key `on`: "scene.yaml:6:40: objects[0].on"
};

// Returns why objects cannot belong to the targets of a tracker; empty if they can. `tracker`: null if none runs.
std::string problem_with(const std::vector<Anchor> &anchors, const run_config::TrackerConfiguration *tracker);

class SceneLoading {
public:
    // The reactor calls exactly one of these callbacks, which may destroy the SceneLoading.
    struct Callbacks {
        // The files that the loader has read: the scene and those to which it refers. The loader is not trusted, so
        // these may be any absolute paths.
        using Files = std::set<std::filesystem::path>;
        // `arena` is frozen and validated.
        std::function<void(ipc::SharedMemory arena, const std::vector<Anchor> &anchors, const Files &files)> loaded;
        std::function<void(const std::string &reason, const Files &files)> failed;
    };
    // `limits.start` is the maximum time between two messages of the loader, `limits.start_total` the maximum time of
    // loading. Loading fails if the scene refers to a file that the run writes, according to `files`. glTF files may
    // refer to the files outside their folders that `raytracer`, the policy of the ray tracer, makes readable to it.
    SceneLoading(supervise::Context &context, const std::filesystem::path &scene, const sandbox::Policy &raytracer,
                 const base::Limits &limits, run_config::FilesInUse files, Callbacks callbacks);

private:
    void on_message(const ipc::Message &message);
    void check_read(const base::FileIdentity &file);
    std::vector<Anchor> anchors_of(const arhost_scene &scene) const;
    void on_loaded(ipc::SharedMemory arena, std::span<const std::byte> bytes);

    Callbacks callbacks_;
    run_config::FilesInUse files_;
    std::set<std::filesystem::path> files_read_;
    std::vector<std::string> anchor_origins_; // from the loader
    std::string scene_;
    supervise::Loading loading_;
};

} // namespace arhost::host
