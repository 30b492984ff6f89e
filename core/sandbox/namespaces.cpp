// SPDX-License-Identifier: Apache-2.0
//
// Namespaces: no network, a file system that is read-only except for a few folders, and only a few devices. This also
// prevents changes to owners, modes, times and attributes of files, which Landlock cannot restrict.
#include "sandbox/layers.hpp"

#include <fcntl.h>
#include <fstream>
#include <linux/mount.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/statvfs.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

namespace arhost::sandbox {
namespace {

// Returns false if the user namespace is unavailable or the user cannot be mapped.
bool enter_user_namespace() {
    const uid_t user = ::geteuid();
    const gid_t group = ::getegid();
    if (::unshare(CLONE_NEWUSER) != 0)
        return false;
    const auto write = [](const char *file, const std::string &text) {
        return static_cast<bool>(std::ofstream(file) << text << std::flush);
    };
    return write("/proc/self/setgroups", "deny") && // required before a group can be mapped
           write("/proc/self/uid_map", std::to_string(user) + " " + std::to_string(user) + " 1") &&
           write("/proc/self/gid_map", std::to_string(group) + " " + std::to_string(group) + " 1");
}

// Tries it in a child process: some systems allow the namespace but not the mapping, and a process cannot leave the
// namespace again.
bool can_enter_user_namespace() {
    const pid_t child = ::fork();
    if (child == 0)
        ::_exit(enter_user_namespace() ? 0 : 1);
    int status = 1;
    return child > 0 && ::waitpid(child, &status, 0) == child && status == 0;
}

int set_attributes(const std::filesystem::path &path, unsigned flags, std::uint64_t set, std::uint64_t clear) {
    mount_attr attributes{};
    attributes.attr_set = set;
    attributes.attr_clr = clear;
    return static_cast<int>(
        ::syscall(SYS_mount_setattr, AT_FDCWD, path.c_str(), flags, &attributes, sizeof attributes));
}

bool bind_mount(const std::filesystem::path &path) {
    return ::mount(path.c_str(), path.c_str(), nullptr, MS_BIND | MS_REC, nullptr) == 0;
}

// Makes the mounts read-only except for the folders and devices of `policy`. Returns false and sets errno on failure.
bool restrict_mounts(const Policy &policy) {
    if (::mount("", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0) // no propagation of mounts
        return false;
    // Creates separate mounts for the folders and devices, so that they can have other flags than the rest. Skips
    // folders in read-only file systems.
    std::vector<std::filesystem::path> writable;
    for (const std::filesystem::path &folder : policy.writable) {
        struct statvfs found {};
        if (::statvfs(folder.c_str(), &found) == 0 && !(found.f_flag & ST_RDONLY) && bind_mount(folder))
            writable.push_back(folder);
    }
    std::vector<std::filesystem::path> devices = paths_of(policy).devices;
    devices.emplace_back("/dev/zero");
    std::erase_if(devices, [](const std::filesystem::path &device) { return !bind_mount(device); });
    if (set_attributes("/", AT_RECURSIVE, MOUNT_ATTR_RDONLY | MOUNT_ATTR_NOSUID | MOUNT_ATTR_NODEV, 0) != 0)
        return false;
    for (const std::filesystem::path &folder : writable)
        (void)set_attributes(folder, 0, 0, MOUNT_ATTR_RDONLY);
    for (const std::filesystem::path &device : devices)
        (void)set_attributes(device, 0, 0, MOUNT_ATTR_NODEV);
    std::error_code error; // the working directory still refers to the old mount
    if (const auto here = std::filesystem::current_path(error); !error)
        (void)!::chdir(here.c_str());
    return true;
}

} // namespace

Layer enter_namespaces(const Policy &policy) {
    Layer layer{"namespaces", "", ""};
    const auto active = [&](const char *what) { add_to(layer.active, what); };
    const auto missing = [&](const char *what) { add_to(layer.missing, error_text(what)); };
    // Root does not need a user namespace, and in one it would lose access to the files of other users.
    const bool is_root = ::geteuid() == 0;
    if (!is_root) {
        if (!can_enter_user_namespace() || !enter_user_namespace()) {
            missing("user");
            return layer;
        }
        active("user");
    }
    ::unshare(CLONE_NEWNS) == 0 && restrict_mounts(policy) ? active("mount") : missing("mount");
    if (!policy.allows("network"))
        ::unshare(CLONE_NEWNET) == 0 ? active("net") : missing("net");
    if (!policy.allows("display")) // X11 uses System V shared memory
        ::unshare(CLONE_NEWIPC) == 0 ? active("ipc") : missing("ipc");
    return layer;
}

} // namespace arhost::sandbox
