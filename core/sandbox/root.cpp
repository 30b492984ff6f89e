// SPDX-License-Identifier: Apache-2.0
//
// A root folder that contains only what the policy grants: bind mounts in an otherwise empty file system. Other paths
// do not exist, so not even their names and attributes can be read.
#include "sandbox/layers.hpp"

#include "base/unique_fd.hpp"

#include <deque>
#include <fcntl.h>
#include <functional>
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

// The new root is mounted on this folder before it becomes the root. Every system has /dev. /proc is unsuitable: it
// must remain visible so that a user namespace may mount another /proc.
constexpr const char *staging = "/dev";
constexpr const char *control_groups = "/sys/fs/cgroup";

struct Mount {
    fs::path path; // without symbolic links
    std::uint64_t attributes;
    base::UniqueFd tree;
};

bool set_attributes(int tree, const char *path, unsigned flags, std::uint64_t attributes) {
    mount_attr change{};
    change.attr_set = attributes;
    return ::syscall(SYS_mount_setattr, tree, path, flags, &change, sizeof change) == 0;
}

// Clones the mounts at and below `path`. On failure returns an empty descriptor and sets errno.
base::UniqueFd clone_tree(const fs::path &path, std::uint64_t attributes) {
    base::UniqueFd tree(static_cast<int>(
        ::syscall(SYS_open_tree, AT_FDCWD, path.c_str(), OPEN_TREE_CLONE | OPEN_TREE_CLOEXEC | AT_RECURSIVE)));
    if (tree && !set_attributes(tree.get(), "", AT_EMPTY_PATH | AT_RECURSIVE, attributes))
        tree.reset(); // close(2) succeeds and leaves errno as it is
    return tree;
}

using Report = std::function<void(const fs::path &path)>; // reports a path that cannot be cloned; errno: the reason

// The paths of the new root.
class Contents {
public:
    void grant(const fs::path &path, std::uint64_t attributes) {
        std::error_code ignored;
        const fs::path real = resolve(path);
        if (contains(real, "/proc") || contains("/proc/self", real) || real == control_groups)
            return; // the new root has its own
        if (fs::exists(real, ignored))
            if (const auto [entry, is_new] = attributes_.emplace(real, attributes); !is_new)
                // Writable if one of the grants permits it, and then not executable if one of them forbids it.
                entry->second = (entry->second & attributes) | ((entry->second | attributes) & MOUNT_ATTR_NOEXEC);
    }
    void link(const fs::path &path, const fs::path &target) { links_.emplace(path, target); }
    const std::map<fs::path, fs::path> &links() const { return links_; }

    // Clones the mounts. Omits a path if a folder already contains it with the same attributes. Omits and reports a
    // path that cannot be cloned.
    std::vector<Mount> clone(const Report &missing) const {
        std::vector<Mount> mounts;
        for (const auto &[path, attributes] : attributes_) { // each folder comes before its contents
            const Mount *parent = nullptr;
            for (const Mount &mount : mounts)
                if (contains(mount.path, path))
                    parent = &mount;
            if (parent && (parent->attributes & ~attributes) == 0)
                continue;
            if (base::UniqueFd tree = clone_tree(path, attributes))
                mounts.push_back({path, attributes, std::move(tree)});
            else
                missing(path);
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
            else if (part != "." && (contains("/proc", real) || !fs::is_symlink(real / part, ignored)))
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
    for (const fs::path &path : paths.sockets)
        contents.grant(path, of_writable);
    const bool may_execute = policy.may_generate_code() || may_start_processes(policy);
    for (const fs::path &path : policy.writable)
        contents.grant(path, of_writable | (may_execute ? 0 : MOUNT_ATTR_NOEXEC));
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

// Makes the plugin's own folder in /proc visible, but not that of PID 1. `proc`: the path of /proc.
bool mount_own_processes(const fs::path &proc) {
    const fs::path processes = proc / "pids";
    std::error_code ignored;
    fs::create_directories(processes, ignored);
    if (!has_pid_namespace() ||
        ::mount("proc", processes.c_str(), "proc", MS_RDONLY | MS_NOSUID | MS_NODEV | MS_NOEXEC,
                "subset=pid,hidepid=ptraceable") != 0) {
        // In a container, parts of /proc may be covered; the kernel then refuses to mount another /proc.
        const fs::path self = fs::read_symlink("/proc/self", ignored);
        const base::UniqueFd tree = self.empty() ? base::UniqueFd() : clone_tree("/proc" / self, of_readable);
        if (!tree || !attach(tree, processes / self))
            return false;
        fs::create_symlink(self, processes / "self", ignored);
    }
    fs::create_symlink("pids/self", proc / "self", ignored);
    fs::create_symlink("pids/thread-self", proc / "thread-self", ignored);
    const std::string pid = std::to_string(::getpid());
    fs::create_symlink("pids" / fs::read_symlink(processes / "self", ignored), proc / pid, ignored);
    return true;
}

// Shows only the control group of this process and those below it. Libraries read the limits of the group there.
void mount_own_control_groups(const fs::path &path) {
    std::error_code ignored;
    fs::create_directories(path, ignored);
    if (::mount("cgroup2", path.c_str(), "cgroup2", MS_NOSUID | MS_NODEV | MS_NOEXEC, nullptr) == 0 &&
        !set_attributes(AT_FDCWD, path.c_str(), 0, of_readable))
        ::umount2(path.c_str(), MNT_DETACH);
}

// Makes the folder `staging` the root and detaches the old root.
bool enter_staging() {
    // Second part of the idiom in pivot_root(2) for a new root without a folder for the old one. pivot_root mounts
    // the old root on top of the new one; umount2 then detaches the old root.
    return ::chdir(staging) == 0 && ::syscall(SYS_pivot_root, ".", ".") == 0 && ::umount2(".", MNT_DETACH) == 0 &&
           ::chdir("/") == 0;
}

} // namespace

void enter_root(const Policy &policy, Layer &layer, bool has_control_group_namespace) {
    const auto missing = [&](const fs::path &what) { add_to(layer.missing, error_text("mount: " + what.string())); };
    if (!set_attributes(AT_FDCWD, "/", 0, 0)) // changes nothing; fails before Linux 5.12
        return missing("mount_setattr");
    rlimit files{}; // the mounts need one descriptor each; set_limits lowers the limit later
    ::getrlimit(RLIMIT_NOFILE, &files);
    files.rlim_cur = files.rlim_max;
    ::setrlimit(RLIMIT_NOFILE, &files);
    if (::mount("", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0) // no propagation of mounts
        return missing("/");
    const Contents contents = contents_of(policy);
    std::error_code ignored;
    const fs::path working_directory = fs::current_path(ignored);
    const std::vector<Mount> mounts = contents.clone(missing);
    if (::mount("tmpfs", staging, "tmpfs", MS_NOSUID | MS_NODEV, "mode=755,size=1m") != 0)
        return missing("tmpfs");
    const auto in_staging = [](const fs::path &path) { return staging / path.relative_path(); };
    for (const Mount &mount : mounts)
        if (!attach(mount.tree, in_staging(mount.path)))
            missing(mount.path);
    if (!mount_own_processes(in_staging("/proc")))
        missing("/proc/self");
    if (!policy.scratch.empty() &&
        !mount_scratch(in_staging(policy.scratch), policy.may_generate_code() || may_start_processes(policy)))
        missing(policy.scratch);
    if (has_control_group_namespace) // otherwise this would change options of the existing mount
        mount_own_control_groups(in_staging(control_groups));
    for (const auto &[path, target] : contents.links()) {
        fs::create_directories(in_staging(path).parent_path(), ignored);
        fs::create_symlink(target, in_staging(path), ignored); // fails if a bind mount contains the link
    }
    if (enter_staging()) {
        add_to(layer.active, "mount");
        layer.confines_files = true;
    } else {
        missing("pivot_root");
        ::umount2(staging, MNT_DETACH);
    }
    (void)!::chdir(working_directory.c_str()); // "/" if the new root does not contain it
    if (layer.confines_files && !set_attributes(AT_FDCWD, "/", 0, MOUNT_ATTR_RDONLY))
        missing("/");
}

} // namespace arhost::sandbox
