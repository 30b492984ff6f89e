// SPDX-License-Identifier: Apache-2.0
//
// Landlock: which files may be opened how, and in newer kernels also TCP, signals and abstract sockets. By
// system calls, and with constants of its own: Debian 12's headers know the first two versions only.
#include "sandbox/layers.hpp"

#include <algorithm>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace arhost::sandbox {
namespace {

namespace fs = std::filesystem;

struct RulesetAttributes {
    std::uint64_t handled_files, handled_network, scoped; // since versions 1, 4, 6
};
struct __attribute__((packed)) PathBeneath {
    std::uint64_t allowed;
    std::int32_t parent_fd;
};
constexpr unsigned create_version = 1, rule_path_beneath = 1;

namespace access {
constexpr std::uint64_t execute = 1 << 0, write_file = 1 << 1, read_file = 1 << 2, read_folder = 1 << 3,
                        remove_folder = 1 << 4, remove_file = 1 << 5, make_folder = 1 << 7, make_file = 1 << 8,
                        rename_elsewhere = 1 << 13, truncate = 1 << 14, ioctl_device = 1 << 15;
// What concerns a file itself; rules for files take no other.
constexpr std::uint64_t of_files = execute | write_file | read_file | truncate | ioctl_device;
constexpr std::uint64_t read = read_file | read_folder;
// No links, pipes or sockets: the host or another program may open what lies there by its name.
constexpr std::uint64_t write =
    read | write_file | truncate | remove_folder | remove_file | make_folder | make_file | rename_elsewhere;
constexpr std::uint64_t device = read | write_file | truncate | ioctl_device;
} // namespace access

// All accesses that a version knows, and so can deny.
std::uint64_t known_to(long version) {
    const int bits = version >= 5 ? 16 : version >= 3 ? 15 : version >= 2 ? 14 : 13;
    return (std::uint64_t(1) << bits) - 1;
}

class Ruleset {
public:
    Ruleset(const RulesetAttributes &attributes, std::size_t size)
        : handled_(attributes.handled_files),
          fd_(static_cast<int>(::syscall(SYS_landlock_create_ruleset, &attributes, size, 0))) {}
    ~Ruleset() {
        if (fd_ >= 0)
            ::close(fd_);
    }
    Ruleset(const Ruleset &) = delete;
    Ruleset &operator=(const Ruleset &) = delete;

    explicit operator bool() const { return fd_ >= 0; }
    // What is not there is left out.
    void allow(const fs::path &path, std::uint64_t access) {
        const int fd = ::open(path.c_str(), O_PATH | O_CLOEXEC);
        struct stat status {};
        if (fd < 0 || ::fstat(fd, &status) != 0)
            return;
        const PathBeneath rule{access & handled_ & (S_ISDIR(status.st_mode) ? ~std::uint64_t(0) : access::of_files),
                               fd};
        (void)::syscall(SYS_landlock_add_rule, fd_, rule_path_beneath, &rule, 0);
        ::close(fd);
    }
    bool enforce() const { return ::syscall(SYS_landlock_restrict_self, fd_, 0) == 0; }

private:
    std::uint64_t handled_;
    int fd_;
};

} // namespace

Layer enter_landlock(const Policy &policy) {
    Layer layer{"landlock", "", ""};
    const long version = ::syscall(SYS_landlock_create_ruleset, nullptr, 0, create_version);
    if (version < 1) {
        layer.lacks = error_text("not in this kernel, or not switched on");
        return layer;
    }
    RulesetAttributes attributes{known_to(version), 0, 0};
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
        layer.lacks = error_text("no ruleset");
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
    if (policy.allows("video"))
        rules.allow("/dev", access::read_folder); // which cameras there are
    if (!rules.enforce()) {
        layer.lacks = error_text("not enforced");
        return layer;
    }
    layer.reached = "version " + std::to_string(version) + ", files";
    if (attributes.handled_network)
        layer.reached += ", TCP";
    if (attributes.scoped)
        layer.reached += ", signals";
    else if (may_start_processes(policy)) // others are kept from signals by the filter of system calls
        layer.lacks = "signals to processes that are not its own, which need version 6";
    return layer;
}

} // namespace arhost::sandbox
