// SPDX-License-Identifier: Apache-2.0
//
// seccomp filter (libseccomp): system calls that no plugin needs fail with EPERM. This is a deny list, because an
// allow list would break with new drivers and C libraries.
#include "sandbox/layers.hpp"

#include <fcntl.h>
#include <memory>
#include <sched.h>
#include <seccomp.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

namespace arhost::sandbox {
namespace {

// System calls that Debian 12's libseccomp does not know by name. Their numbers are the same on all architectures.
constexpr std::pair<const char *, int> newer_calls[] = {
    {"fchmodat2", 452}, {"setxattrat", 463}, {"removexattrat", 466}, {"open_tree_attr", 467}, {"file_setattr", 469}};

constexpr const char *denied[] = {
    // access to other processes
    "ptrace", "process_vm_readv", "process_vm_writev", "process_madvise", "process_mrelease", "kcmp", "pidfd_open",
    "pidfd_getfd", "pidfd_send_signal", "tkill", "move_pages", "migrate_pages", "perf_event_open", "lookup_dcookie",
    // access to the kernel
    "bpf", "userfaultfd", "io_uring_setup", "io_uring_enter", "io_uring_register", "kexec_load", "kexec_file_load",
    "init_module", "finit_module", "delete_module", "iopl", "ioperm", "modify_ldt", "syslog", "nfsservctl",
    // keyrings, which namespaces do not isolate
    "keyctl", "add_key", "request_key",
    // changes to the view of the file system
    "mount", "umount", "umount2", "pivot_root", "chroot", "mount_setattr", "move_mount", "open_tree",
    "open_tree_attr", "fsopen", "fsconfig", "fsmount", "fspick", "unshare", "setns", "open_by_handle_at",
    "name_to_handle_at", "fanotify_init", "quotactl", "quotactl_fd", "swapon", "swapoff", "acct", "mknod", "mknodat",
    // not handled by Landlock: owners, modes, attributes
    "chmod", "fchmod", "fchmodat", "fchmodat2", "chown", "fchown", "lchown", "fchownat", "setxattr", "fsetxattr",
    "lsetxattr", "setxattrat", "removexattr", "fremovexattr", "lremovexattr", "removexattrat", "file_setattr",
    "utime", "utimes", "futimesat", "truncate", // ftruncate needs a writable descriptor
    // machine-wide settings and IPC
    "reboot", "settimeofday", "clock_settime", "clock_settime64", "clock_adjtime", "clock_adjtime64", "adjtimex",
    "stime", "sethostname", "setdomainname", "vhangup", "mq_open", "msgget", "semget"};

class Filter {
public:
    Filter() : context_(seccomp_init(SCMP_ACT_ALLOW)) {
        if (!context_)
            return;
        (void)seccomp_attr_set(context_.get(), SCMP_FLTATR_CTL_OPTIMIZE, 2); // binary search
        (void)seccomp_attr_set(context_.get(), SCMP_FLTATR_CTL_TSYNC, 1);    // all threads
    }
    bool valid() const { return context_ && !failed_; }

    void deny(const char *name, std::initializer_list<scmp_arg_cmp> when = {}, int error = EPERM) {
        int call = seccomp_syscall_resolve_name(name);
        if (call == __NR_SCMP_ERROR)
            for (const auto &[newer, number] : newer_calls)
                if (!std::strcmp(newer, name))
                    call = number;
        if (call == __NR_SCMP_ERROR)
            return;
        failed_ |= seccomp_rule_add_array(context_.get(), SCMP_ACT_ERRNO(static_cast<unsigned>(error)), call,
                                          static_cast<unsigned>(when.size()), when.begin()) != 0;
    }
    bool load() const { return seccomp_load(context_.get()) == 0; }

private:
    struct Release {
        void operator()(void *context) const { seccomp_release(context); }
    };
    std::unique_ptr<void, Release> context_;
    bool failed_ = false;
};

// Compares only the lower 32 bits: the kernel ignores the upper bits of these arguments.
scmp_arg_cmp equals(unsigned argument, std::uint64_t value) {
    return {argument, SCMP_CMP_MASKED_EQ, 0xffffffffu, value & 0xffffffffu};
}
scmp_arg_cmp has_bits(unsigned argument, std::uint64_t mask, std::uint64_t value) {
    return {argument, SCMP_CMP_MASKED_EQ, mask, value};
}
scmp_arg_cmp differs(unsigned argument, std::uint64_t value) {
    return {argument, SCMP_CMP_NE, value, 0};
}
scmp_arg_cmp from(unsigned argument, std::uint64_t value) {
    return {argument, SCMP_CMP_GE, value, 0};
}

// Denies calls that could affect other processes: the target must be this process. Other ids are denied, because they
// could belong to threads or groups of other processes.
void deny_reaching_others(Filter &filter, bool has_children) {
    const auto self = static_cast<std::uint64_t>(::getpid());
    if (!has_children) {
        for (const char *call : {"kill", "tgkill", "rt_sigqueueinfo", "rt_tgsigqueueinfo"})
            filter.deny(call, {differs(0, self)});
        for (const char *call : {"setpgid", "setsid"}) // a signal to the process group must reach only this worker
            filter.deny(call);
    } else {
        filter.deny("kill", {equals(0, 0xffffffff)}); // -1: all processes. Landlock restricts others
    }
    // 0 means the calling process. Other values could change other processes of the same user.
    for (const char *call :
         {"prlimit64", "sched_setaffinity", "sched_setscheduler", "sched_setparam", "sched_setattr"})
        filter.deny(call, {differs(0, 0)});
    filter.deny("setpriority", {differs(0, PRIO_PROCESS)});
    filter.deny("setpriority", {differs(1, 0)});
    filter.deny("ioprio_set", {differs(0, 1 /* IOPRIO_WHO_PROCESS */)});
    filter.deny("ioprio_set", {differs(1, 0)});
    // F_SETOWN with F_SETSIG sends arbitrary signals; a lease blocks other openers of the file.
    for (const int command : {F_SETOWN, F_SETOWN_EX, F_SETSIG, F_SETLEASE, F_NOTIFY})
        filter.deny("fcntl", {equals(1, static_cast<unsigned>(command))});
    for (const unsigned long request :
         {0x8901ul /* FIOSETOWN */, 0x8902ul /* SIOCSPGRP */, std::uint64_t(TIOCSTI), std::uint64_t(TIOCLINUX)})
        filter.deny("ioctl", {equals(1, request)});
    for (const unsigned long request : {0x40086602ul /* FS_IOC_SETFLAGS */, 0x401c5820ul /* FS_IOC_FSSETXATTR */})
        filter.deny("ioctl", {equals(1, request)});
    // The tracer process of LeakSanitizer needs PR_SET_PDEATHSIG: if the tracer survived the worker, it would wait
    // forever for a lock, and the traced worker could not be reaped.
    if (!under_sanitizer)
        filter.deny("prctl", {equals(0, PR_SET_PDEATHSIG)});
}

void deny_new_processes(Filter &filter, bool may_fork) {
    // The filter cannot see the flags of clone3, because they are in memory. After ENOSYS, libraries use clone
    // instead.
    filter.deny("clone3", {}, ENOSYS);
    for (const std::uint64_t flag :
         {CLONE_NEWNS, CLONE_NEWCGROUP, CLONE_NEWUTS, CLONE_NEWIPC, CLONE_NEWUSER, CLONE_NEWPID, CLONE_NEWNET})
        filter.deny("clone", {has_bits(0, flag, flag)});
    if (may_fork)
        return;
    filter.deny("clone", {has_bits(0, CLONE_THREAD, 0)});
    for (const char *call : {"fork", "vfork", "execve", "execveat"})
        filter.deny(call);
}

void deny_sockets(Filter &filter, const Policy &policy) {
    std::set<unsigned> families;
    if (policy.allows("display") || policy.allows("network"))
        families.insert(AF_UNIX);
    if (policy.allows("network"))
        families.insert({AF_INET, AF_INET6, AF_NETLINK}); // getaddrinfo uses netlink
    if (policy.allows("usb"))
        families.insert(AF_NETLINK); // hot-plug events
    constexpr unsigned end = 64;     // higher than all address families
    for (unsigned family = 0; family < end; ++family)
        if (!families.contains(family))
            filter.deny("socket", {equals(0, family)});
    filter.deny("socket", {from(0, end)});
    if (!families.contains(AF_UNIX))
        for (const int type : {SOCK_DGRAM, SOCK_RAW}) // sockets of these types can send to any socket
            filter.deny("socketpair", {has_bits(1, 0xf, static_cast<unsigned>(type))});
}

// Denies calls that allocate memory that RLIMIT_DATA does not count.
void deny_uncounted_memory(Filter &filter) {
    for (const char *call : {"memfd_create", "memfd_secret", "shmget"})
        filter.deny(call);
    filter.deny("mmap", {has_bits(3, MAP_SHARED | MAP_ANONYMOUS, MAP_SHARED | MAP_ANONYMOUS)});
    filter.deny("mmap", {has_bits(3, MAP_GROWSDOWN, MAP_GROWSDOWN)}); // such a mapping would count as stack
}

} // namespace

Layer filter_system_calls(const Policy &policy) {
    Layer layer{"seccomp", "", ""};
    Filter filter;
    for (const char *call : denied)
        if (!(under_sanitizer && !std::strcmp(call, "ptrace")))
            filter.deny(call);
    filter.deny("utimensat", {differs(1, 0)}); // futimens passes a null path and remains allowed
    deny_reaching_others(filter, may_start_processes(policy));
    deny_new_processes(filter, may_start_processes(policy));
    deny_sockets(filter, policy);
    if (has_memory_limit(policy) && !may_share_memory(policy))
        deny_uncounted_memory(filter);
    if (!filter.valid() || !filter.load())
        layer.missing = error_text("cannot load the filter");
    else
        layer.active = "yes";
    return layer;
}

} // namespace arhost::sandbox
