// SPDX-License-Identifier: Apache-2.0
//
// Namespaces: a view of the machine without network, in which all but a few folders is read-only. That also
// stops what Landlock knows nothing of: owners, modes, times and attributes of files.
#include "sandbox/layers.hpp"

#include <fcntl.h>
#include <fstream>
#include <linux/mount.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace arhost::sandbox {
namespace {

// Root needs no user namespace, and in one it would lose its rights over other users' files.
bool enter_user_namespace() {
    const uid_t user = ::geteuid();
    const gid_t group = ::getegid();
    if (::unshare(CLONE_NEWUSER) != 0)
        return false;
    const auto write = [](const char *file, const std::string &text) { std::ofstream(file) << text << std::flush; };
    write("/proc/self/setgroups", "deny"); // without that no group may be mapped
    write("/proc/self/uid_map", std::to_string(user) + " " + std::to_string(user) + " 1");
    write("/proc/self/gid_map", std::to_string(group) + " " + std::to_string(group) + " 1");
    return true;
}

int set_attributes(const std::filesystem::path &path, unsigned flags, std::uint64_t set, std::uint64_t clear) {
    mount_attr attributes{};
    attributes.attr_set = set;
    attributes.attr_clr = clear;
    return static_cast<int>(
        ::syscall(SYS_mount_setattr, AT_FDCWD, path.c_str(), flags, &attributes, sizeof attributes));
}

// False with errno where it can't be had.
bool make_mounts_read_only(const Policy &policy) {
    if (::mount("", "/", nullptr, MS_REC | MS_SLAVE, nullptr) != 0)
        return false;
    for (const std::filesystem::path &folder : policy.writable)
        (void)::mount(folder.c_str(), folder.c_str(), nullptr, MS_BIND | MS_REC, nullptr);
    if (set_attributes("/", AT_RECURSIVE, MOUNT_ATTR_RDONLY | MOUNT_ATTR_NOSUID, 0) != 0)
        return false;
    for (const std::filesystem::path &folder : policy.writable)
        (void)set_attributes(folder, 0, 0, MOUNT_ATTR_RDONLY);
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
    const bool is_root = ::unshare(CLONE_NEWNS) == 0;
    if (!is_root && !enter_user_namespace()) { // in which all may unshare
        lacks("user");
        return layer;
    }
    if (!is_root)
        reached("user");
    (is_root || ::unshare(CLONE_NEWNS) == 0) && make_mounts_read_only(policy) ? reached("mount") : lacks("mount");
    if (!policy.allows("network"))
        ::unshare(CLONE_NEWNET) == 0 ? reached("net") : lacks("net");
    if (!policy.allows("display")) // X takes pictures through shared memory
        ::unshare(CLONE_NEWIPC) == 0 ? reached("ipc") : lacks("ipc");
    return layer;
}

} // namespace arhost::sandbox
