// SPDX-License-Identifier: Apache-2.0
//
// Namespaces: a view of the machine without network, in which all but a few folders is read-only, and only a few
// devices can be opened. That also stops what Landlock knows nothing of: owners, modes, times and attributes of
// files.
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

// False where it can't be had, or not with this user in it.
bool enter_user_namespace() {
    const uid_t user = ::geteuid();
    const gid_t group = ::getegid();
    if (::unshare(CLONE_NEWUSER) != 0)
        return false;
    const auto write = [](const char *file, const std::string &text) {
        return static_cast<bool>(std::ofstream(file) << text << std::flush);
    };
    return write("/proc/self/setgroups", "deny") && // without that no group may be mapped
           write("/proc/self/uid_map", std::to_string(user) + " " + std::to_string(user) + " 1") &&
           write("/proc/self/gid_map", std::to_string(group) + " " + std::to_string(group) + " 1");
}

// Some systems let a process into a user namespace and then map no user, and there is no way back: a child tries.
bool may_enter_user_namespace() {
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

bool mount_anew(const std::filesystem::path &path) {
    return ::mount(path.c_str(), path.c_str(), nullptr, MS_BIND | MS_REC, nullptr) == 0;
}

// False with errno where it can't be had.
bool narrow_mounts(const Policy &policy) {
    if (::mount("", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0) // what is mounted later is not seen in it
        return false;
    // Mounts of their own for what stays as it is; what is on a read-only mount already is left out.
    std::vector<std::filesystem::path> writable;
    for (const std::filesystem::path &folder : policy.writable) {
        struct statvfs found {};
        if (::statvfs(folder.c_str(), &found) == 0 && !(found.f_flag & ST_RDONLY) && mount_anew(folder))
            writable.push_back(folder);
    }
    std::vector<std::filesystem::path> devices = paths_of(policy).devices;
    devices.emplace_back("/dev/zero");
    std::erase_if(devices, [](const std::filesystem::path &device) { return !mount_anew(device); });
    if (set_attributes("/", AT_RECURSIVE, MOUNT_ATTR_RDONLY | MOUNT_ATTR_NOSUID | MOUNT_ATTR_NODEV, 0) != 0)
        return false;
    for (const std::filesystem::path &folder : writable)
        (void)set_attributes(folder, 0, 0, MOUNT_ATTR_RDONLY);
    for (const std::filesystem::path &device : devices)
        (void)set_attributes(device, 0, 0, MOUNT_ATTR_NODEV);
    std::error_code error; // the working directory still is the old mount's
    if (const auto here = std::filesystem::current_path(error); !error)
        (void)!::chdir(here.c_str());
    return true;
}

} // namespace

Layer enter_namespaces(const Policy &policy) {
    Layer layer{"namespaces", "", ""};
    const auto reached = [&](const char *what) { add_to(layer.reached, what); };
    const auto lacks = [&](const char *what) { add_to(layer.lacks, error_text(what)); };
    // Root needs no user namespace, and in one it would lose its rights over other users' files. In one all may
    // unshare.
    const bool is_root = ::geteuid() == 0;
    if (!is_root) {
        if (!may_enter_user_namespace() || !enter_user_namespace()) {
            lacks("user");
            return layer;
        }
        reached("user");
    }
    ::unshare(CLONE_NEWNS) == 0 && narrow_mounts(policy) ? reached("mount") : lacks("mount");
    if (!policy.allows("network"))
        ::unshare(CLONE_NEWNET) == 0 ? reached("net") : lacks("net");
    if (!policy.allows("display")) // X takes pictures through shared memory
        ::unshare(CLONE_NEWIPC) == 0 ? reached("ipc") : lacks("ipc");
    return layer;
}

} // namespace arhost::sandbox
