// SPDX-License-Identifier: Apache-2.0
//
// Two seccomp filters (libseccomp), of which the stricter result counts. The first denies system calls and arguments
// that could harm others, with EPERM. The second allows only the calls that plugins and their libraries need. Others
// fail with EPERM if every kernel has them, otherwise with ENOSYS, so that libraries use older calls instead.
#include "sandbox/layers.hpp"

#include <fcntl.h>
#include <memory>
#include <sched.h>
#include <seccomp.h>
#include <set>
#include <string_view>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <system_error>
#include <unistd.h>

namespace arhost::sandbox {
namespace {

static_assert(sizeof(void *) == 8, "the lists omit the calls that only 32-bit systems have");

// System calls that libseccomp 2.5.0 does not know by name. Their numbers are the same on all architectures.
constexpr std::pair<const char *, int> newer_calls[] = {
    {"process_madvise", 440}, {"epoll_pwait2", 441},     {"mount_setattr", 442}, {"quotactl_fd", 443},
    {"memfd_secret", 447},    {"process_mrelease", 448}, {"futex_waitv", 449},   {"fchmodat2", 452},
    {"setxattrat", 463},      {"getxattrat", 464},       {"listxattrat", 465},   {"removexattrat", 466},
    {"open_tree_attr", 467},  {"file_setattr", 469}};

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
    "mount", "umount2", "pivot_root", "chroot", "mount_setattr", "move_mount", "open_tree", "open_tree_attr",
    "fsopen", "fsconfig", "fsmount", "fspick", "unshare", "setns", "open_by_handle_at", "name_to_handle_at",
    "fanotify_init", "quotactl", "quotactl_fd", "swapon", "swapoff", "acct", "mknod", "mknodat",
    // not handled by Landlock: owners, modes, attributes
    "chmod", "fchmod", "fchmodat", "fchmodat2", "chown", "fchown", "lchown", "fchownat", "setxattr", "fsetxattr",
    "lsetxattr", "setxattrat", "removexattr", "fremovexattr", "lremovexattr", "removexattrat", "file_setattr",
    "utime", "utimes", "futimesat", "truncate", // ftruncate needs a writable descriptor
    "symlink", "symlinkat", // a link in a writable folder could redirect a grant at the next start
    // machine-wide settings and IPC
    "reboot", "settimeofday", "clock_settime", "clock_adjtime", "adjtimex", "sethostname", "setdomainname", "vhangup",
    "mq_open",
    // System V objects and other objects that are counted per user, or that name paths outside of the sandbox
    "msgget", "msgsnd", "msgrcv", "msgctl", "semget", "semop", "semtimedop", "semctl", "shmget", "shmat", "shmctl",
    "shmdt", "inotify_init", "inotify_init1", "inotify_add_watch", "io_setup", "io_submit", "getxattr", "lgetxattr",
    "fgetxattr", "listxattr", "llistxattr", "flistxattr", "getxattrat", "listxattrat"};

// Calls that any plugin may need.
constexpr const char *allowed[] = {
    // files and folders, for reading, and open descriptors
    "access", "close", "close_range", "dup", "dup2", "dup3", "faccessat", "faccessat2", "fadvise64", "fchdir",
    "chdir", "fcntl", "fstat", "fstatfs", "getcwd", "getdents", "getdents64", "ioctl", "lseek", "lstat", "newfstatat",
    "open", "openat", "openat2", "pread64", "preadv", "preadv2", "read", "readahead", "readlink", "readlinkat",
    "readv", "stat", "statfs", "statx", "umask", "write", "writev", "pwrite64", "pwritev", "pwritev2",
    // pipes, events and waiting
    "eventfd", "eventfd2", "pipe", "pipe2", "poll", "ppoll", "pselect6", "select", "signalfd", "signalfd4",
    "timerfd_create", "timerfd_gettime", "timerfd_settime",
    // connected sockets
    "getpeername", "getsockname", "getsockopt", "recvfrom", "recvmmsg", "recvmsg", "sendmmsg", "sendmsg", "sendto",
    "setsockopt", "shutdown", "socket", "socketpair",
    // memory
    "brk", "get_mempolicy", "madvise", "membarrier", "memfd_create", "mincore", "mlock", "mlock2", "mmap", "mprotect",
    "mremap", "msync", "munlock", "munmap", "pkey_alloc", "pkey_free", "pkey_mprotect",
    // threads and processors
    "clone", "exit", "exit_group", "futex", "futex_waitv", "get_robust_list", "getcpu", "getpriority", "gettid",
    "rseq", "sched_get_priority_max", "sched_get_priority_min", "sched_getaffinity", "sched_getattr",
    "sched_getparam", "sched_getscheduler", "sched_setaffinity", "sched_setparam", "sched_setscheduler",
    "set_mempolicy", "sched_yield", "set_robust_list", "set_tid_address", "setpriority",
    // signals
    "kill", "pause", "restart_syscall", "rt_sigaction", "rt_sigpending", "rt_sigprocmask", "rt_sigqueueinfo",
    "rt_sigreturn", "rt_sigsuspend", "rt_sigtimedwait", "rt_tgsigqueueinfo", "sigaltstack", "tgkill",
    // clocks and timers
    "alarm", "clock_getres", "clock_gettime", "clock_nanosleep", "getitimer", "gettimeofday", "nanosleep",
    "setitimer", "time", "timer_create", "timer_delete", "timer_getoverrun", "timer_gettime", "timer_settime",
    "times",
    // this process
    "arch_prctl", "capget", "getegid", "geteuid", "getgid", "getgroups", "getpgid", "getpgrp", "getpid", "getppid",
    "getrandom", "getresgid", "getresuid", "getrlimit", "getrusage", "getsid", "getuid", "prctl", "prlimit64",
    "seccomp", "setrlimit", "sysinfo", "uname"};

// Calls that only plugins with a writable folder need.
constexpr const char *allowed_to_writers[] = {
    "copy_file_range", "fallocate",       "fdatasync",        "fsync",     "ftruncate", "mkdir",
    "mkdirat",         "rename",          "renameat",         "renameat2", "rmdir",     "sendfile",
    "splice",          "sync_file_range", "sync_file_range2", "unlink",    "unlinkat",  "utimensat"};

// Calls that an entry of `allow` adds.
struct CallsOf {
    std::string_view allowance;
    std::initializer_list<const char *> calls;
};
constexpr CallsOf allowed_by[] = {
    {"usb", {"bind"}}, // netlink
    {"network", {"accept", "accept4", "bind", "connect", "listen"}},
    {"listen", {"accept", "accept4"}},
    {"processes", {"execve", "execveat", "fork", "setpgid", "setsid", "vfork", "wait4", "waitid"}},
};

// Calls that fail with EPERM unless they are allowed. Every kernel has them, so libraries take ENOSYS for a defect,
// but handle a missing permission. Not included: epoll, without which libraries fall back to poll, and flock. For
// flock, libraries take other errors than ENOSYS for a lock that another process holds, and wait for it.
constexpr const char *refused[] = {"accept", "accept4", "bind", "connect", "fallocate", "fdatasync", "fsync",
                                   "ftruncate", "link", "linkat", "listen", "mkdir", "mkdirat", "mlockall",
                                   "munlockall", "personality", "rename", "renameat", "rmdir", "sync", "syncfs",
                                   "unlink", "unlinkat", "utimensat", "wait4", "waitid",
                                   // the user and the machine
                                   "capset", "setfsgid", "setfsuid", "setgid", "setgroups", "setregid", "setresgid",
                                   "setresuid", "setreuid", "setuid"};

// Allowed with `network`, `listen` and `processes`; without epoll, libraries fall back to poll. Reason: the kernel
// counts epoll watches per user. Watches on shared files also slow down the host, because the kernel calls or frees
// each watch when the host uses or releases a file.
constexpr const char *epoll_calls[] = {"epoll_create", "epoll_create1", "epoll_ctl",
                                       "epoll_pwait",  "epoll_pwait2",  "epoll_wait"};

class Filter {
public:
    // The filter applies `default_action` to calls without a rule.
    explicit Filter(std::uint32_t default_action) : context_(seccomp_init(default_action)) {
        if (!context_)
            throw std::runtime_error("seccomp_init");
        (void)seccomp_attr_set(context_.get(), SCMP_FLTATR_CTL_OPTIMIZE, 2); // binary search
        (void)seccomp_attr_set(context_.get(), SCMP_FLTATR_CTL_TSYNC, 1);    // all threads
    }
    void deny(const char *name, std::initializer_list<scmp_arg_cmp> when = {}, int error = EPERM) {
        add(SCMP_ACT_ERRNO(static_cast<unsigned>(error)), name, when);
    }
    void allow(const char *name) { add(SCMP_ACT_ALLOW, name, {}); }
    void load() const { check(seccomp_load(context_.get()), "load"); }

private:
    // `result`: 0 or a negative errno, as libseccomp returns it.
    static void check(int result, const char *what) {
        if (result != 0)
            throw std::system_error(-result, std::generic_category(), what);
    }
    void add(std::uint32_t action, const char *name, std::initializer_list<scmp_arg_cmp> when) {
        int call = seccomp_syscall_resolve_name(name);
        if (call == __NR_SCMP_ERROR)
            for (const auto &[newer, number] : newer_calls)
                if (!std::strcmp(newer, name))
                    call = number;
        if (call == __NR_SCMP_ERROR)
            throw std::runtime_error(std::string(name) + ": unknown to libseccomp");
        check(seccomp_rule_add_array(context_.get(), action, call, static_cast<unsigned>(when.size()), when.begin()),
              name);
    }

    struct Release {
        void operator()(void *context) const { seccomp_release(context); }
    };
    std::unique_ptr<void, Release> context_;
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

// Denies calls that could affect other processes: the target must be this process. Ids other than its own are denied,
// because they could belong to threads or groups of other processes.
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
        families.insert(AF_NETLINK); // libusb does not start without it
    constexpr unsigned end = 64;     // higher than all address families
    for (unsigned family = 0; family < end; ++family)
        if (!families.contains(family))
            filter.deny("socket", {equals(0, family)});
    filter.deny("socket", {from(0, end)});
    filter.deny("socketpair", {differs(0, AF_UNIX)});
    // Denies the ioctl requests for network interfaces. The inherited sockets belong to the host's network namespace,
    // so these requests would return the addresses of that namespace.
    if (!policy.allows("network"))
        for (const std::uint64_t requests : {0x8900ul /* SIOC… */, 0x8b00ul /* wireless */})
            filter.deny("ioctl", {has_bits(1, 0xffffff00u, requests)});
    // After a shutdown, an inherited listening socket could connect by sending its first data (TCP Fast Open).
    if (!policy.allows("network")) {
        filter.deny("sendto", {has_bits(3, MSG_FASTOPEN, MSG_FASTOPEN)});
        filter.deny("sendmsg", {has_bits(2, MSG_FASTOPEN, MSG_FASTOPEN)});
        filter.deny("sendmmsg", {has_bits(3, MSG_FASTOPEN, MSG_FASTOPEN)});
    }
    if (!families.contains(AF_UNIX))
        for (const int type : {SOCK_DGRAM, SOCK_RAW}) // sockets of these types can send to any socket
            filter.deny("socketpair", {has_bits(1, 0xf, static_cast<unsigned>(type))});
}

// Denies three kinds of socket options: kernel buffers larger than the default, which RLIMIT_DATA does not count;
// programs for the kernel (BPF); and descriptors of the process at the other end.
void deny_socket_options(Filter &filter, const Policy &policy) {
    constexpr int pass_pidfd = 76, peer_pidfd = 77; // not in Debian 12's headers
    std::set<int> options = {SO_SNDBUF,        SO_RCVBUF,     SO_SNDBUFFORCE,           SO_RCVBUFFORCE,
                             SO_ATTACH_FILTER, SO_ATTACH_BPF, SO_ATTACH_REUSEPORT_CBPF, SO_ATTACH_REUSEPORT_EBPF,
                             SO_LINGER, // the last close of a socket would wait, even in the host
                             pass_pidfd};
    if (policy.allows("usb"))
        options.erase(SO_ATTACH_FILTER); // libudev uses it to filter events
    for (const int option : options)
        filter.deny("setsockopt", {equals(1, SOL_SOCKET), equals(2, static_cast<unsigned>(option))});
    filter.deny("getsockopt", {equals(1, SOL_SOCKET), equals(2, peer_pidfd)});
}

// Denies calls that allocate memory that RLIMIT_DATA does not count.
void deny_uncounted_memory(Filter &filter) {
    for (const char *call : {"memfd_create", "memfd_secret"})
        filter.deny(call);
    filter.deny("mmap", {has_bits(3, MAP_SHARED | MAP_ANONYMOUS, MAP_SHARED | MAP_ANONYMOUS)});
    filter.deny("mmap", {has_bits(3, MAP_GROWSDOWN, MAP_GROWSDOWN)}); // such a mapping would count as stack
}

// Denies executing memory that the plugin has written, as attacks on a plugin's parsers do. Libraries are not
// affected, because the dynamic linker maps their code from files.
void deny_generated_code(Filter &filter) {
    constexpr std::uint64_t write_execute = PROT_WRITE | PROT_EXEC;
    const scmp_arg_cmp executable = has_bits(2, PROT_EXEC, PROT_EXEC);
    filter.deny("mmap", {has_bits(2, write_execute, write_execute)});
    for (const std::uint64_t kind : {MAP_ANONYMOUS, MAP_SHARED}) // can become writable or is so elsewhere
        filter.deny("mmap", {executable, has_bits(3, kind, kind)});
    for (const char *call : {"mprotect", "pkey_mprotect"})
        filter.deny(call, {executable});
}

void deny_harmful_calls(const Policy &policy) {
    Filter filter(SCMP_ACT_ALLOW);
    for (const char *call : denied)
        if (!(under_sanitizer && !std::strcmp(call, "ptrace")))
            filter.deny(call);
    filter.deny("utimensat", {differs(1, 0)}); // futimens passes a null path and remains allowed
    deny_reaching_others(filter, may_start_processes(policy));
    deny_new_processes(filter, may_start_processes(policy));
    deny_sockets(filter, policy);
    deny_socket_options(filter, policy);
    filter.deny("fcntl", {equals(1, F_SETPIPE_SZ)}); // RLIMIT_DATA does not count pipe buffers
    if (has_memory_limit(policy) && !may_share_memory(policy))
        deny_uncounted_memory(filter);
    if (!policy.may_generate_code())
        deny_generated_code(filter);
    filter.load();
}

// Does not apply to GPU drivers, whose needs vary, nor to sanitizers.
void allow_needed_calls(const Policy &policy) {
    std::set<std::string_view> needed(std::begin(allowed), std::end(allowed));
    if (!policy.writable.empty() || !policy.scratch.empty() || policy.makes_shared_memory)
        needed.insert(std::begin(allowed_to_writers), std::end(allowed_to_writers));
    for (const CallsOf &added : allowed_by)
        if (policy.allows(added.allowance))
            needed.insert(added.calls.begin(), added.calls.end());
    if (policy.allows("network") || policy.allows("listen") || policy.allows("processes"))
        needed.insert(std::begin(epoll_calls), std::end(epoll_calls));
    Filter filter(SCMP_ACT_ERRNO(ENOSYS));
    for (const std::string_view call : needed)
        filter.allow(call.data());
    for (const char *call : refused)
        if (!needed.contains(call))
            filter.deny(call);
    filter.load();
}

} // namespace

Layer filter_system_calls(const Policy &policy) {
    const bool has_allow_list = !policy.allows("gpu") && !policy.allows("display") && !under_sanitizer;
    Layer layer{"seccomp", "", ""};
    try {
        deny_harmful_calls(policy);
        layer.active = "deny list";
        if (has_allow_list) {
            allow_needed_calls(policy);
            layer.active = "allow list";
        }
    } catch (const std::exception &error) {
        layer.missing = std::string("cannot load the filters: ") + error.what();
    }
    return layer;
}

} // namespace arhost::sandbox
