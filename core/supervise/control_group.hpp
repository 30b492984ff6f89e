// SPDX-License-Identifier: Apache-2.0
//
// Control groups (cgroup v2) of workers. Their limits also cover what no resource limit counts: page tables, memory
// in the kernel, threads of root. Workers get a smaller share of the processors than the host. arhost-launcher uses
// them if the group in which arhost was started is delegated to it.
//
// The kernel applies limits only in a group without processes of its own beside its subgroups ("no internal process
// constraint"), so the launcher moves the host and itself to a subgroup:
//
//   delegated group
//   ├── arhost-host        host and launcher
//   └── arhost-worker-N    a worker and the processes that it starts
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace arhost::supervise {

// The group of one worker. Functions of an empty group do nothing.
class ControlGroup {
public:
    ControlGroup() = default;
    explicit ControlGroup(std::filesystem::path folder) : folder_(std::move(folder)) {}

    void join() const;                 // moves the calling process to the group
    void kill() const;                 // kills all its processes
    bool exceeded_memory() const;      // whether the kernel has killed a process because of the group's memory limit
    [[nodiscard]] bool remove() const; // returns false if a process has not exited yet

private:
    std::filesystem::path folder_;
};

class ControlGroups {
public:
    // To be called by the launcher. Uses the group of the calling process if it is delegated and contains only this
    // process and its parent, the host. Otherwise create() returns empty groups.
    ControlGroups();

    // `memory_bytes`: the limit of the memory that the worker may use; 0: none.
    ControlGroup create(std::uint64_t memory_bytes);
    // Kills all processes of the group and removes it. If one has not exited yet, a later call of remove_ended()
    // removes the group.
    void end(const ControlGroup &group);
    void remove_ended();
    // Moves launcher and host back to the delegated group. All workers must have ended.
    void restore() const;

private:
    std::filesystem::path delegated_; // empty: no group is delegated
    std::vector<ControlGroup> ended_;
    int count_ = 0;
};

} // namespace arhost::supervise
