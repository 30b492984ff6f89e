// SPDX-License-Identifier: Apache-2.0
//
// Reads a file of the user, which may come from a stranger, in a sandboxed worker. The worker passes what it has read
// to the host in shared memory and exits.
#pragma once

#include "base/limits.hpp"
#include "supervise/process.hpp"

#include <cstddef>
#include <filesystem>
#include <functional>
#include <span>
#include <string>

namespace arhost::supervise {

// Returns the sandbox policy of the scene loader. Which files a scene and its meshes refer to is known only after
// parsing, so the loader may read everything except /proc, /sys and devices. Its only output is the arena.
sandbox::Policy policy_of_scene_loader(sandbox::Mode mode);

class Loading {
public:
    struct Job {
        std::filesystem::path file;
        std::string component; // name in arhost's log
        std::string worker;    // name in error messages
        base::Limits limits{}; // `start`: maximum time between two messages; `start_total`: maximum time of the job
        std::string limit_key = ""; // sets limits.start; "": none
    };
    // The reactor calls exactly one of `loaded` and `failed`, which may destroy the Loading.
    struct Callbacks {
        std::function<void(const ipc::Message &)> message; // all except Log, Progress, Loaded and Failed
        // `memory` is frozen. `bytes`: its contents, which are not validated; mapped until the function returns.
        std::function<void(ipc::SharedMemory memory, std::span<const std::byte> bytes)> loaded;
        std::function<void(const std::string &reason)> failed; // `reason` names the file
    };

    // `first`: the message that describes the job to the worker, a messages::Load or messages::ReadLog.
    template <class T>
    Loading(Context &context, Job job, const T &first, const sandbox::Policy &policy, Callbacks callbacks)
        : context_(context), job_(std::move(job)), callbacks_(std::move(callbacks)),
          budget_(context.log, job_.component),
          process_(context, budget_,
                   {[this](ipc::Message &message) { on_message(message); }, [](const ipc::Result &) {},
                    [this](const Death &death) { on_died(death); }},
                   first, policy) {
        set_deadlines();
    }

    // Ends the worker. The first reason counts, as later failures may only be its consequences.
    void fail(const std::string &reason);

private:
    void set_deadlines();
    void restart_deadline();
    void on_message(ipc::Message &message);
    void on_died(const Death &death);

    Context &context_;
    Job job_;
    Callbacks callbacks_;
    WorkerBudget budget_;
    std::string failure_;
    base::UniqueFd memory_;
    ipc::Reactor::Registration deadline_, total_deadline_;
    Process process_;
};

} // namespace arhost::supervise
