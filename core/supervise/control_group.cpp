// SPDX-License-Identifier: Apache-2.0
#include "supervise/control_group.hpp"

#include "sandbox/sandbox.hpp"

#include <cerrno>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <string>
#include <sys/sysinfo.h>
#include <sys/xattr.h>
#include <unistd.h>

namespace arhost::supervise {
namespace {

namespace fs = std::filesystem;

constexpr const char *host_group = "arhost-host";
constexpr const char *controllers[] = {"memory", "pids", "cpu"};

// memory_mb limits private memory. A group also counts the worker's code, its page tables and the frames that it
// writes to shared memory.
constexpr std::uint64_t other_memory_bytes = 256 << 20;
// Enough for libraries that start several threads for each processor.
int max_threads() {
    return 512 + 4 * ::get_nprocs_conf();
}

bool write(const fs::path &file, const std::string &text) {
    return static_cast<bool>(std::ofstream(file) << text << std::flush);
}

std::set<pid_t> processes_of(const fs::path &group) {
    std::ifstream file(group / "cgroup.procs");
    return {std::istream_iterator<pid_t>(file), {}};
}

bool move_to(const fs::path &group, pid_t process) {
    return write(group / "cgroup.procs", std::to_string(process));
}

bool has_mark(const fs::path &group, const char *attribute) {
    char value = 0;
    return ::getxattr(group.c_str(), attribute, &value, 1) == 1 && value == '1';
}

// Whether this process may create subgroups in `group`. Root may write to every group, but systemd manages the groups
// that it has not marked as delegated. Two kinds of group have no other manager: a group whose parent belongs to
// another user, and the topmost group of a container.
bool is_delegated(const fs::path &group) {
    const auto is_writable = [](const fs::path &folder) {
        return ::access((folder / "cgroup.subtree_control").c_str(), W_OK) == 0 &&
               ::access((folder / "cgroup.procs").c_str(), W_OK) == 0;
    };
    // The topmost group of the machine has no file cgroup.type.
    return is_writable(group) && ::access((group / "cgroup.type").c_str(), F_OK) == 0 &&
           (has_mark(group, "user.delegate") || has_mark(group, "trusted.delegate") ||
            !is_writable(group.parent_path()));
}

// Undoes the constructor of ControlGroups.
void restore_processes(const fs::path &delegated) {
    for (const char *controller : controllers)
        write(delegated / "cgroup.subtree_control", std::string("-") + controller);
    for (const pid_t process : processes_of(delegated / host_group))
        move_to(delegated, process);
    ::rmdir((delegated / host_group).c_str());
}

} // namespace

void ControlGroup::join() const {
    if (!folder_.empty())
        move_to(folder_, 0);
}

void ControlGroup::kill() const {
    if (!folder_.empty())
        write(folder_ / "cgroup.kill", "1"); // since Linux 5.14
}

bool ControlGroup::exceeded_memory() const {
    if (folder_.empty())
        return false;
    std::ifstream file(folder_ / "memory.events");
    std::map<std::string, int> events;
    std::string name;
    for (int count = 0; file >> name >> count;)
        events[name] = count;
    // The counter oom counts how often the group reached its own limit. The counter oom_kill also includes kills
    // because the machine ran out of memory.
    return events["oom"] > 0 && events["oom_kill"] > 0;
}

bool ControlGroup::remove() const {
    return folder_.empty() || ::rmdir(folder_.c_str()) == 0 || errno != EBUSY;
}

ControlGroups::ControlGroups() {
    const fs::path own = sandbox::control_group();
    if (own.filename() == host_group) { // an earlier launcher of this host has died
        delegated_ = own.parent_path();
        std::error_code ignored;
        for (const fs::directory_entry &entry : fs::directory_iterator(delegated_, ignored))
            if (entry.path().filename().string().starts_with(sandbox::worker_group))
                end(ControlGroup(entry.path()));
        return;
    }
    const pid_t host = ::getppid();
    if (own.empty() || !is_delegated(own) || processes_of(own) != std::set<pid_t>{host, ::getpid()})
        return;
    std::error_code ignored;
    fs::create_directory(own / host_group, ignored);
    if (!move_to(own / host_group, host) || !move_to(own / host_group, 0)) {
        restore_processes(own);
        return;
    }
    delegated_ = own;
    for (const char *controller : controllers) // separate writes, because an unavailable controller makes one fail
        write(delegated_ / "cgroup.subtree_control", std::string("+") + controller);
    write(delegated_ / host_group / "cpu.weight", "1000"); // the default of workers is 100
}

ControlGroup ControlGroups::create(std::uint64_t memory_bytes) {
    if (delegated_.empty())
        return {};
    fs::path folder;
    std::error_code error;
    do // a group of an earlier launcher may still exist
        folder = delegated_ / (std::string(sandbox::worker_group) + std::to_string(++count_));
    while (!fs::create_directory(folder, error) && !error);
    if (error)
        return {};
    if (memory_bytes) {
        write(folder / "memory.max", std::to_string(memory_bytes + other_memory_bytes));
        write(folder / "memory.swap.max", "0");
        write(folder / "memory.oom.group", "1"); // kills the worker and its processes together
    }
    write(folder / "pids.max", std::to_string(max_threads()));
    return ControlGroup(folder);
}

void ControlGroups::end(const ControlGroup &group) {
    group.kill();
    ended_.push_back(group);
    remove_ended();
}

void ControlGroups::remove_ended() {
    std::erase_if(ended_, [](const ControlGroup &group) { return group.remove(); });
}

void ControlGroups::restore() const {
    if (!delegated_.empty())
        restore_processes(delegated_);
}

} // namespace arhost::supervise
