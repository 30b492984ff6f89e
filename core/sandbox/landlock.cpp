// SPDX-License-Identifier: Apache-2.0
//
// Landlock: restricts file access, and in newer kernels TCP, signals and abstract sockets. Uses raw system calls and
// defines the constants here, because Debian 12's headers contain only versions 1 and 2 of Landlock.
#include "sandbox/layers.hpp"

#include "base/unique_fd.hpp"

#include <algorithm>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace arhost::sandbox {
namespace {

namespace fs = std::filesystem;

struct RulesetAttributes {
    std::uint64_t handled_files, handled_network, scoped; // available since version 1, 4 and 6, respectively
};
struct __attribute__((packed)) PathBeneath {
    std::uint64_t allowed;
    std::int32_t parent_fd;
};
constexpr unsigned create_version = 1, rule_path_beneath = 1;

namespace access {
constexpr std::uint64_t execute = 1 << 0, write_file = 1 << 1, read_file = 1 << 2, read_folder = 1 << 3,
                        remove_folder = 1 << 4, remove_file = 1 << 5, make_folder = 1 << 7, make_file = 1 << 8,
                        refer = 1 << 13, truncate = 1 << 14, ioctl_device = 1 << 15;
// The accesses that are valid in rules for files (not folders).
constexpr std::uint64_t of_files = execute | write_file | read_file | truncate | ioctl_device;
constexpr std::uint64_t read = read_file | read_folder;
// Does not include the creation of links, pipes and sockets, which could harm other programs that open files there.
constexpr std::uint64_t write =
    read | write_file | truncate | remove_folder | remove_file | make_folder | make_file | refer;
constexpr std::uint64_t device = read | write_file | truncate | ioctl_device;
} // namespace access

// Returns all file accesses that a version of Landlock can restrict.
std::uint64_t handled_by(long version) {
    const int bits = version >= 5 ? 16 : version >= 3 ? 15 : version >= 2 ? 14 : 13;
    return (std::uint64_t(1) << bits) - 1;
}

class Ruleset {
public:
    Ruleset(const RulesetAttributes &attributes, std::size_t size)
        : handled_(attributes.handled_files),
          fd_(static_cast<int>(::syscall(SYS_landlock_create_ruleset, &attributes, size, 0))) {}

    explicit operator bool() const { return static_cast<bool>(fd_); }
    // Allows `access` to `path` and everything below it. Ignores paths that do not exist.
    void allow(const fs::path &path, std::uint64_t access) {
        const base::UniqueFd fd(::open(path.c_str(), O_PATH | O_CLOEXEC));
        struct stat status {};
        if (!fd || ::fstat(fd.get(), &status) != 0)
            return;
        const PathBeneath rule{access & handled_ & (S_ISDIR(status.st_mode) ? ~std::uint64_t(0) : access::of_files),
                               fd.get()};
        (void)::syscall(SYS_landlock_add_rule, fd_.get(), rule_path_beneath, &rule, 0);
    }
    bool enforce() const { return ::syscall(SYS_landlock_restrict_self, fd_.get(), 0) == 0; }

private:
    std::uint64_t handled_;
    base::UniqueFd fd_;
};

} // namespace

Layer enter_landlock(const Policy &policy) {
    Layer layer{"landlock", "", ""};
    const long version = ::syscall(SYS_landlock_create_ruleset, nullptr, 0, create_version);
    if (version < 1) {
        layer.missing = error_text(errno == EOPNOTSUPP ? "disabled at boot" : "not in this kernel");
        return layer;
    }
    RulesetAttributes attributes{handled_by(version), 0, 0};
    std::size_t size = sizeof(attributes.handled_files);
    if (version >= 4) {
        attributes.handled_network = policy.allows("network") ? 0 : 3; // TCP: bind, connect
        size += sizeof(attributes.handled_network);
    }
    if (version >= 6) {
        constexpr std::uint64_t abstract_sockets = 1, signals = 2;
        attributes.scoped = signals | (policy.allows("network") || policy.allows("display") ? 0 : abstract_sockets);
        size += sizeof(attributes.scoped);
    }
    Ruleset rules(attributes, size);
    if (!rules) {
        layer.missing = error_text("cannot create the ruleset");
        return layer;
    }
    const std::uint64_t execute = may_start_processes(policy) ? access::execute : 0;
    const Paths paths = paths_of(policy);
    for (const fs::path &path : paths.readable)
        rules.allow(path, access::read | execute);
    for (const fs::path &path : paths.devices)
        rules.allow(path, access::device);
    for (const fs::path &path : policy.writable)
        rules.allow(path, access::write | execute);
    if (!policy.scratch.empty())
        rules.allow(policy.scratch, access::write | execute);
    if (policy.allows("video"))
        rules.allow("/dev", access::read_folder); // to enumerate cameras
    if (!policy.usb_device.empty())
        rules.allow("/dev/bus/usb", access::read_folder);
    if (!rules.enforce()) {
        layer.missing = error_text("cannot enforce the ruleset");
        return layer;
    }
    layer.active = "version " + std::to_string(version) + ", files";
    layer.confines_files = true;
    if (attributes.handled_network)
        layer.active += ", TCP";
    if (attributes.scoped)
        layer.active += ", signals";
    else if (may_start_processes(policy) && !has_pid_namespace()) // otherwise seccomp or the namespace blocks signals
        layer.missing = "blocking signals to other processes (needs version 6)";
    return layer;
}

} // namespace arhost::sandbox
