// SPDX-License-Identifier: Apache-2.0
//
// A root folder that contains only what the policy grants: bind mounts in an otherwise empty file system. Other paths
// do not exist, so not even their names and attributes can be read.
#include "sandbox/layers.hpp"

#include "base/unique_fd.hpp"

#include <deque>
#include <fcntl.h>
#include <linux/mount.h>
#include <map>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace arhost::sandbox {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t of_devices = MOUNT_ATTR_RDONLY | MOUNT_ATTR_NOSUID, // devices ignore RDONLY
    of_writable = MOUNT_ATTR_NOSUID | MOUNT_ATTR_NODEV, of_readable = of_writable | MOUNT_ATTR_RDONLY;

// The new root is mounted on this folder before it becomes the root. Every system has it, and it is not /proc, which
// must remain visible so that a user namespace may mount another one.
constexpr const char *staging = "/dev";

struct Mount {
    fs::path path; // without symbolic links
    std::uint64_t attributes;
    base::UniqueFd tree;
};

base::UniqueFd clone_tree(const fs::path &path) {
    return base::UniqueFd(static_cast<int>(
        ::syscall(SYS_open_tree, AT_FDCWD, path.c_str(), OPEN_TREE_CLONE | OPEN_TREE_CLOEXEC | AT_RECURSIVE)));
}

bool set_attributes(int tree, const char *path, unsigned flags, std::uint64_t attributes) {
    mount_attr change{};
    change.attr_set = attributes;
    return ::syscall(SYS_mount_setattr, tree, path, flags, &change, sizeof change) == 0;
}

// The paths of the new root.
class Contents {
public:
    void grant(const fs::path &path, std::uint64_t attributes) {
        if (contains("/proc", path))
            return;
        std::error_code ignored;
        const fs::path real = resolve(path);
        if (real.has_relative_path() && !contains("/proc", real) && fs::exists(real, ignored))
            if (const auto [entry, is_new] = attributes_.emplace(real, attributes); !is_new)
                entry->second &= attributes;
    }
    void link(const fs::path &path, const fs::path &target) { links_.emplace(path, target); }
    const std::map<fs::path, fs::path> &links() const { return links_; }

    // Clones the mounts. Omits a path that a folder already contains with the same attributes, and one that cannot be
    // cloned.
    std::vector<Mount> clone() const {
        std::vector<Mount> mounts;
        for (const auto &[path, attributes] : attributes_) { // each folder comes before its contents
            const Mount *parent = nullptr;
            for (const Mount &mount : mounts)
                if (contains(mount.path, path))
                    parent = &mount;
            if (parent && (parent->attributes & ~attributes) == 0)
                continue;
            base::UniqueFd tree = clone_tree(path);
            if (tree && set_attributes(tree.get(), "", AT_EMPTY_PATH | AT_RECURSIVE, attributes))
                mounts.push_back({path, attributes, std::move(tree)});
        }
        return mounts;
    }

private:
    // Resolves the symbolic links in an absolute path and records them, so that the path is valid in the new root.
    // Returns an empty path if there are too many links.
    fs::path resolve(const fs::path &path) {
        fs::path real;
        std::deque<fs::path> rest(path.begin(), path.end());
        for (int links = 0; !rest.empty();) {
            const fs::path part = rest.front();
            rest.pop_front();
            std::error_code ignored;
            if (part == "..")
                real = real.parent_path();
            else if (part != "." && !fs::is_symlink(real / part, ignored))
                real /= part; // an absolute part replaces the path
            else if (part != ".") {
                const fs::path target = fs::read_symlink(real / part, ignored);
                link(real / part, target);
                rest.insert(rest.begin(), target.begin(), target.end());
                if (++links > 40)
                    return {};
            }
        }
        return real;
    }

    std::map<fs::path, std::uint64_t> attributes_;
    std::map<fs::path, fs::path> links_; // path of a symbolic link → its target
};

Contents contents_of(const Policy &policy) {
    Contents contents;
    const Paths paths = paths_of(policy);
    for (const fs::path &path : paths.readable)
        contents.grant(path, of_readable);
    for (const fs::path &path : paths.devices)
        contents.grant(path, of_devices);
    if (may_share_memory(policy)) // RLIMIT_DATA does not count shared mappings of this device
        contents.grant("/dev/zero", of_devices);
    for (const fs::path &path : paths.sockets)
        contents.grant(path, of_writable);
    for (const fs::path &path : policy.writable)
        contents.grant(path, of_writable);
    contents.link("/dev/fd", "/proc/self/fd");
    return contents;
}

bool attach(const base::UniqueFd &tree, const fs::path &path) {
    std::error_code ignored;
    struct stat status {};
    const bool is_folder = ::fstat(tree.get(), &status) == 0 && S_ISDIR(status.st_mode);
    fs::create_directories(is_folder ? path : path.parent_path(), ignored);
    if (!is_folder)
        base::UniqueFd(::open(path.c_str(), O_CREAT | O_WRONLY | O_EXCL | O_CLOEXEC, 0444));
    return ::syscall(SYS_move_mount, tree.get(), "", AT_FDCWD, path.c_str(), MOVE_MOUNT_F_EMPTY_PATH) == 0;
}

// Mounts the /proc of this PID namespace, or the existing one: in a container, /proc may be covered in part, and then
// the kernel refuses another one.
bool mount_proc(const fs::path &path) {
    const base::UniqueFd existing = clone_tree("/proc");
    std::error_code ignored;
    fs::create_directories(path, ignored);
    return ::mount("proc", path.c_str(), "proc", MS_RDONLY | MS_NOSUID | MS_NODEV | MS_NOEXEC, nullptr) == 0 ||
           (existing && set_attributes(existing.get(), "", AT_EMPTY_PATH | AT_RECURSIVE, of_readable) &&
            attach(existing, path));
}

// Makes the folder `staging` the root and detaches the old root.
bool enter_staging() {
    // The second call of pivot_root(2)'s idiom for a new root without a folder for the old one: both are mounted at
    // ".", the old root on top.
    return ::chdir(staging) == 0 && ::syscall(SYS_pivot_root, ".", ".") == 0 && ::umount2(".", MNT_DETACH) == 0 &&
           ::chdir("/") == 0;
}

} // namespace

bool enter_root(const Policy &policy) {
    if (!set_attributes(AT_FDCWD, "/", 0, 0)) // changes nothing; fails before Linux 5.12
        return false;
    rlimit files{}; // the mounts need one descriptor each; set_limits lowers the limit later
    ::getrlimit(RLIMIT_NOFILE, &files);
    files.rlim_cur = files.rlim_max;
    ::setrlimit(RLIMIT_NOFILE, &files);
    if (::mount("", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0) // no propagation of mounts
        return false;
    const Contents contents = contents_of(policy);
    std::error_code ignored;
    const fs::path working_directory = fs::current_path(ignored);
    const std::vector<Mount> mounts = contents.clone();
    if (::mount("tmpfs", staging, "tmpfs", MS_NOSUID | MS_NODEV, "mode=755,size=1m") != 0)
        return false;
    const auto in_staging = [](const fs::path &path) { return staging / path.relative_path(); };
    bool is_complete = mount_proc(in_staging("/proc"));
    for (const Mount &mount : mounts)
        is_complete &= attach(mount.tree, in_staging(mount.path));
    for (const auto &[path, target] : contents.links()) {
        fs::create_directories(in_staging(path).parent_path(), ignored);
        fs::create_symlink(target, in_staging(path), ignored); // fails if a bind mount contains the link
    }
    if (!is_complete || !enter_staging()) {
        const int error = errno;
        ::umount2(staging, MNT_DETACH);
        (void)!::chdir(working_directory.c_str());
        errno = error;
        return false;
    }
    (void)!::chdir(working_directory.c_str()); // "/" if the new root does not contain it
    return set_attributes(AT_FDCWD, "/", 0, MOUNT_ATTR_RDONLY);
}

} // namespace arhost::sandbox
