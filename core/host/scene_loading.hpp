// SPDX-License-Identifier: Apache-2.0
//
// Has a scene loaded by a worker of its own, since parsers of meshes are attack surface, and checks what
// comes back before anyone else sees it.
#pragma once

#include "run_config/files_in_use.hpp"
#include "sandbox/sandbox.hpp"
#include "supervise/process.hpp"

#include <arhost/scene.h>

#include <filesystem>
#include <functional>
#include <memory>

namespace arhost::host {

class SceneLoading {
public:
    // Exactly one of the two is called, from the reactor; the SceneLoading may be destroyed in it.
    struct Hooks {
        std::function<void(ipc::SharedMemory arena)> loaded; // frozen and valid
        std::function<void(const std::string &reason)> failed;
    };
    // `timeout`: the longest time without a word of progress. Fails where one of `files` that is written is read.
    SceneLoading(supervise::Context &context, const std::filesystem::path &scene, sandbox::Mode sandbox,
                 std::chrono::milliseconds timeout, run_config::FilesInUse files, Hooks hooks);

private:
    void watch();
    void look_at(const base::FileIdentity &file_read);
    void fail(const std::string &reason);
    void on_died(const supervise::Death &death);

    supervise::Context &context_;
    Hooks hooks_;
    run_config::FilesInUse files_;
    std::string scene_, failure_;
    base::UniqueFd arena_;
    std::chrono::milliseconds timeout_;
    ipc::Reactor::Registration deadline_;
    std::unique_ptr<supervise::Process> process_;
};

} // namespace arhost::host
