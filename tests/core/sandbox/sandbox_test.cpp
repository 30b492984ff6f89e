// SPDX-License-Identifier: Apache-2.0
//
// Tests each layer separately and all layers together, in child processes: what they must block, and what must still
// work.
#include "plugin_under_test.hpp"
#include "sandbox/layers.hpp"

#include <csignal>
#include <fcntl.h>
#include <fstream>
#include <functional>
#include <linux/capability.h>
#include <linux/filter.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <thread>

using namespace arhost::sandbox;
namespace fs = std::filesystem;

namespace {

constexpr int layer_is_missing = 77;

// Checks in a child process, which cannot use GoogleTest's expectations: a failed check is identified by its number.
class Checks {
public:
    void that(bool holds) {
        ++count_;
        if (!holds && first_failed_ == 0)
            first_failed_ = count_;
    }
    // Ends the process if a layer is not available on this machine.
    void needs(bool has_layer) const {
        if (!has_layer)
            ::_exit(layer_is_missing);
    }
    int result() const { return first_failed_; }

private:
    int count_ = 0, first_failed_ = 0;
};

using Run = std::function<void(Checks &)>;

// Runs `checks` in a child process; returns the number of the first failed check, or 0.
int in_child(const Run &checks) {
    const pid_t child = ::fork();
    if (child == 0) {
        Checks check;
        checks(check);
        ::_exit(check.result());
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

// Like in_child, in process 2 of a PID namespace, as arhost-launcher starts workers.
int in_pid_namespace(const Run &checks) {
    return in_child([&](Checks &check) {
        check.needs(::unshare(CLONE_NEWPID) == 0 || (enter_user_namespace().empty() && ::unshare(CLONE_NEWPID) == 0));
        const pid_t first = ::fork();
        if (first == 0)
            for (;;)
                ::pause();
        const int result = in_child(checks);
        ::kill(first, SIGKILL);
        ::_exit(result);
    });
}

bool has(const Layer &layer, const char *name) {
    return layer.active.find(name) != std::string::npos;
}
bool enters_landlock(const Policy &policy) {
    ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
    return !enter_landlock(policy).active.empty();
}
bool filters_system_calls(const Policy &policy) {
    ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
    return !filter_system_calls(policy).active.empty();
}

bool opens(const fs::path &file, int flags) {
    const int fd = ::open(file.c_str(), flags | O_CLOEXEC, 0600);
    if (fd >= 0)
        ::close(fd);
    return fd >= 0;
}
bool opens_socket(int family, int type = SOCK_STREAM) {
    const int fd = ::socket(family, type | SOCK_CLOEXEC, 0);
    if (fd >= 0)
        ::close(fd);
    return fd >= 0;
}
bool forks() {
    const pid_t child = ::fork();
    if (child == 0)
        ::_exit(0);
    return child > 0 && ::waitpid(child, nullptr, 0) == child;
}

struct Sandbox : testing::Test {
    void SetUp() override {
        for (const char *folder : {"inside", "outside"})
            fs::create_directories(scratch.path() / folder);
        std::ofstream(inside / "old") << "old";
        std::ofstream(outside / "old") << "old";
        policy.writable = {inside};
    }
    arhost::test::ScratchFolder scratch;
    const fs::path inside = scratch.path() / "inside", outside = scratch.path() / "outside";
    Policy policy;
};

#define EXPECT_CHECKS(result)                                                                                        \
    if (const int failed = (result); failed == layer_is_missing)                                                     \
        GTEST_SKIP() << "the layer is not available on this machine";                                                \
    else                                                                                                             \
        EXPECT_EQ(failed, 0) << "the number of the check that failed"

} // namespace

TEST_F(Sandbox, NamespacesHideAllPathsThatAreNotGranted) {
    fs::create_symlink(outside / "old", scratch.path() / "link");
    std::ofstream(outside / "hidden") << "hidden";
    policy.readable = {scratch.path() / "link"};
    EXPECT_CHECKS(in_child([&](Checks &check) {
        check.needs(has(enter_namespaces(policy), "mount"));
        check.that(opens(inside / "new", O_WRONLY | O_CREAT));
        check.that(opens(inside / "old", O_RDWR));
        check.that(!opens(outside / "new", O_WRONLY | O_CREAT));
        check.that(!opens(outside / "old", O_WRONLY));
        check.that(::chmod((outside / "old").c_str(), 0700) != 0);
        check.that(opens(outside / "old", O_RDONLY));
        check.that(opens(scratch.path() / "link", O_RDONLY));
        struct stat status {};
        check.that(::lstat((outside / "hidden").c_str(), &status) != 0 && errno == ENOENT);
        check.that(::lstat("/home", &status) != 0 && errno == ENOENT);
        check.that(opens("/usr/bin/env", O_RDONLY));
        check.that(opens("/lib64", O_RDONLY | O_DIRECTORY) || !fs::exists("/usr/lib64"));
        check.that(opens("/proc/self/status", O_RDONLY));
        check.that(opens("/dev/fd/0", O_RDONLY) || errno != ENOENT);
        check.that(opens("/dev/null", O_WRONLY));
    }));
}

TEST_F(Sandbox, NamespacesShowOnlyTheOwnProcessInProc) {
    const auto checks = [&](Checks &check) {
        const bool is_second = ::getppid() == 0;
        check.needs(has(enter_namespaces(policy), "mount"));
        drop_capabilities(); // with those of PID 1, this process could trace it
        for (const char *file : {"/proc/1/status", "/proc/keys", "/proc/cmdline", "/proc/sys/kernel/hostname"})
            check.that(!opens(file, O_RDONLY) && errno == ENOENT);
        for (const char *file : {"/proc/cpuinfo", "/proc/meminfo", "/proc/stat", "/proc/sys/vm/max_map_count"})
            check.that(opens(file, O_RDONLY));
        const std::string self = "/proc/" + std::to_string(::getpid());
        check.that(fs::equivalent("/proc/self/maps", self + "/maps"));
        if (is_second) {
            check.that(!fs::exists("/proc/pids/1"));
            check.that(opens("/proc/thread-self/comm", O_RDONLY));
            check.that(in_child([&](Checks &child) {
                           child.that(!fs::equivalent("/proc/self/maps", self + "/maps"));
                       }) == 0);
        }
    };
    EXPECT_CHECKS(in_child(checks));
    EXPECT_CHECKS(in_pid_namespace(checks));
    // The kernel refuses another /proc to a user who does not own the PID namespace.
    EXPECT_CHECKS(in_pid_namespace([&](Checks &check) {
        check.needs(::geteuid() == 0 && ::setuid(65534) == 0 && ::prctl(PR_SET_DUMPABLE, 1, 0, 0, 0) == 0);
        check.needs(has(enter_namespaces(policy), "mount"));
        check.that(!opens("/proc/1/status", O_RDONLY) && errno == ENOENT);
        check.that(opens("/proc/self/status", O_RDONLY));
        check.that(opens("/proc/2/status", O_RDONLY));
    }));
}

TEST_F(Sandbox, NamespacesHideOtherControlGroups) {
    EXPECT_CHECKS(in_child([&](Checks &check) {
        std::vector<fs::path> others;
        std::error_code ignored;
        std::string line;
        std::ifstream groups("/proc/self/cgroup");
        const bool is_root = std::getline(groups, line) && line == "0::/";
        for (fs::directory_iterator entry("/sys/fs/cgroup", ignored), end; !is_root && entry != end; ++entry)
            if (entry->is_directory())
                others.push_back(entry->path());
        check.needs(!others.empty() && has(enter_namespaces(policy), "cgroup, mount"));
        for (const fs::path &other : others)
            check.that(!fs::exists(other));
        groups = std::ifstream("/proc/self/cgroup");
        while (std::getline(groups, line))
            check.that(line.ends_with(":/"));
    }));
}

TEST_F(Sandbox, NamespacesReportPathsThatCannotBeShown) {
    EXPECT_CHECKS(in_child([&](Checks &check) {
        const rlimit few{16, 16}; // each path needs a descriptor
        check.needs(::setrlimit(RLIMIT_NOFILE, &few) == 0);
        const Layer layer = enter_namespaces(policy);
        check.needs(has(layer, "mount"));
        check.that(layer.missing.find("mount: " + inside.string() + ": Too many open files") != std::string::npos);
    }));
}

TEST_F(Sandbox, NamespacesReportAUserNamespaceOfRoot) {
    EXPECT_CHECKS(in_child([&](Checks &check) {
        __user_cap_header_struct header{_LINUX_CAPABILITY_VERSION_3, 0};
        __user_cap_data_struct data[2] = {};
        ::syscall(SYS_capget, &header, data);
        for (std::uint32_t *set : {&data[0].effective, &data[0].permitted})
            *set &= ~(1u << CAP_SYS_ADMIN);
        check.needs(::geteuid() == 0 && ::syscall(SYS_capset, &header, data) == 0);
        const Layer layer = enter_namespaces(policy);
        check.needs(has(layer, "mount"));
        check.that(layer.active.starts_with("user, "));
        check.that(layer.missing.starts_with("pid: "));
    }));
}

TEST_F(Sandbox, ExplainsWhyUserNamespacesAreMissing) {
    using Step = UserNamespaceFailure::Step;
    const auto reason = [&](Step step, int error) { return to_text({step, error}, scratch.path()); };
    const auto set = [&](const char *name, const char *value) {
        fs::create_directories((scratch.path() / name).parent_path());
        std::ofstream(scratch.path() / name) << value;
    };
    EXPECT_EQ(reason(Step::none, 0), "");
    EXPECT_EQ(reason(Step::trial, EAGAIN), "no process could try it (Resource temporarily unavailable)");
    EXPECT_EQ(reason(Step::trial, 0), "no process could try it (it was killed)");
    EXPECT_EQ(reason(Step::mapping, EPERM), "the user cannot be mapped (Operation not permitted)");
    EXPECT_EQ(reason(Step::creation, EPERM), "forbidden, for example by the container that arhost runs in");
    EXPECT_EQ(reason(Step::creation, ENOSPC),
              "the limit of user namespaces is reached; raise the sysctl user.max_user_namespaces");
    EXPECT_EQ(reason(Step::creation, EINVAL), "not in this kernel (Invalid argument)");
    set("kernel/unprivileged_userns_clone", "0\n");
    EXPECT_EQ(reason(Step::creation, EPERM), "disabled; set the sysctl kernel.unprivileged_userns_clone to 1");
    set("user/max_user_namespaces", "0\n");
    EXPECT_EQ(reason(Step::creation, EPERM), reason(Step::creation, ENOSPC));
    set("kernel/apparmor_restrict_unprivileged_userns", "1\n");
    for (const Step step : {Step::creation, Step::mapping})
        for (const int error : {EPERM, EACCES})
            EXPECT_TRUE(reason(step, error)
                            .starts_with("forbidden by AppArmor; set the sysctl "
                                         "kernel.apparmor_restrict_unprivileged_userns to 0"));
}

TEST_F(Sandbox, LibraryPathsGrantOnlyLibraries) {
    for (const char *name : {"liba.so", "liba.so.1", "notes.social", "a.so_and_secrets"})
        std::ofstream(outside / name) << "";
    ::setenv("LD_LIBRARY_PATH", outside.c_str(), 1);
    std::set<std::string> found;
    for (const fs::path &path : paths_of(policy).readable)
        if (contains(outside, path))
            found.insert(path.filename());
    ::unsetenv("LD_LIBRARY_PATH");
    EXPECT_EQ(found, (std::set<std::string>{"liba.so", "liba.so.1"}));
}

TEST_F(Sandbox, NetworkDoesNotGrantPrivateKeys) {
    policy.allow = {"network"};
    for (const fs::path &path : paths_of(policy).readable)
        EXPECT_FALSE(contains(path, "/etc/ssl/private")) << path;
}

TEST_F(Sandbox, NamespacesBlockUnlistedDevices) {
    EXPECT_CHECKS(in_child([&](Checks &check) {
        check.needs(opens("/dev/ptmx", O_RDWR | O_NOCTTY) && has(enter_namespaces(policy), "mount"));
        check.that(!opens("/dev/ptmx", O_RDWR | O_NOCTTY));
        check.that(opens("/dev/null", O_RDWR));
        check.that(opens("/dev/urandom", O_RDONLY));
        check.that(!opens("/dev/zero", O_RDWR));
    }));
}

TEST_F(Sandbox, EnvironmentKeepsStandardAndGrantedVariables) {
    EXPECT_CHECKS(in_child([&](Checks &check) {
        constexpr const char *secrets[] = {"A_TOKEN",        "NVIDIA_API_KEY", "LD_ACCESS_TOKEN", "VK_TOKEN",
                                           "LP_API_KEY",     "MESA_TOKEN",     "LC_SECRET",       "OMP_KEY",
                                           "PYTHON_API_KEY", "OPENCV_TOKEN",   "ARHOST_TOKEN",    "PATHS"};
        for (const char *variable : secrets)
            ::setenv(variable, "value", 1);
        for (const char *variable : {"GIVEN", "LC_NUMERIC", "XDG_CACHE_HOME", "LD_LIBRARY_PATH"})
            ::setenv(variable, "value", 1);
        policy.environment = {"GIVEN"};
        char *const secret = ::getenv("A_TOKEN");
        drop_environment(policy);
        check.that(!::getenv("A_TOKEN"));
        check.that(*secret == '\0');
        for (const char *variable : secrets)
            check.that(!::getenv(variable));
        for (const char *variable : {"GIVEN", "LC_NUMERIC", "XDG_CACHE_HOME", "LD_LIBRARY_PATH", "PATH"})
            check.that(::getenv(variable));
    }));
}

TEST_F(Sandbox, NamespacesKeepAWritableWorkingDirectoryWritable) {
    EXPECT_CHECKS(in_child([&](Checks &check) {
        fs::current_path(inside);
        check.needs(has(enter_namespaces(policy), "mount"));
        check.that(opens("new", O_WRONLY | O_CREAT));
    }));
}

TEST_F(Sandbox, NamespacesBlockTheNetworkUnlessAllowed) {
    EXPECT_CHECKS(in_child([&](Checks &check) {
        check.needs(has(enter_namespaces(policy), "net"));
        std::ifstream devices("/proc/self/net/dev");
        int lines = 0;
        for (std::string line; std::getline(devices, line);)
            ++lines;
        check.that(lines <= 3); // two header lines and lo
    }));
}

// A plugin could otherwise write a library and load it.
TEST_F(Sandbox, FilesThatThePluginCanWriteCannotBeExecuted) {
    for (const char *allow : {"video", "jit", "gpu", "processes", "reads"}) {
        policy.allow = {allow};
        if (std::string(allow) == "reads") { // a folder that both keys grant
            policy.allow = {"video"};
            policy.readable.push_back(inside);
        }
        EXPECT_CHECKS(in_child([&](Checks &check) {
            check.needs(has(enter_namespaces(policy), "mount"));
            const auto executes = [](const fs::path &file) {
                const int fd = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
                return ::mmap(nullptr, 1, PROT_READ | PROT_EXEC, MAP_PRIVATE, fd, 0) != MAP_FAILED;
            };
            check.that(executes(inside / "old") == (policy.allow != std::set<std::string, std::less<>>{"video"}) ||
                       under_sanitizer);
            check.that(executes("/bin/true"));
        })) << allow;
    }
}

TEST_F(Sandbox, OnlyGeneratedCodeNeedsAPermission) {
    for (const char *allow : {"video", "network", "processes", "jit", "gpu", "display"}) {
        policy.allow = {allow};
        EXPECT_CHECKS(in_child([&](Checks &check) {
            const bool may = policy.allows("jit") || policy.allows("gpu") || policy.allows("display");
            check.that(policy.meets("jit") == may);
            check.needs(filters_system_calls(policy));
            const auto map = [](int protection) {
                return ::mmap(nullptr, 4096, protection, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
            };
            void *const data = map(PROT_READ | PROT_WRITE);
            check.that((map(PROT_WRITE | PROT_EXEC) != MAP_FAILED) == may);
            check.that((::mprotect(data, 4096, PROT_READ | PROT_EXEC) == 0) == may);
            check.that(::mprotect(data, 4096, PROT_READ) == 0);
            std::thread([] {}).join(); // its stack is not executable
        })) << allow;
    }
}

TEST_F(Sandbox, LandlockAllowsOnlyListedPaths) {
    policy.readable = {outside / "old"};
    EXPECT_CHECKS(in_child([&](Checks &check) {
        check.needs(enters_landlock(policy));
        check.that(opens(outside / "old", O_RDONLY));
        check.that(!opens(outside / "old", O_WRONLY));
        check.that(!opens(outside / "new", O_WRONLY | O_CREAT));
        check.that(opens(inside / "new", O_RDWR | O_CREAT));
        check.that(::rename((inside / "new").c_str(), (inside / "old").c_str()) == 0);
        check.that(::unlink((inside / "old").c_str()) == 0);
        check.that(::mkdir((inside / "folder").c_str(), 0700) == 0);
        check.that(!opens("/etc/passwd", O_RDONLY));
        check.that(!opens("/proc/1/status", O_RDONLY));
        for (const char *own : {"status", "maps", "smaps_rollup", "stat", "cgroup", "fd"})
            check.that(opens(fs::path("/proc/self") / own, O_RDONLY));
        for (const char *of_network : {"net/tcp", "net/unix"})
            check.that(!opens(fs::path("/proc/self") / of_network, O_RDONLY));
        check.that(!opens("/proc/self/task", O_RDONLY) || under_sanitizer);
        check.that(!opens("/proc/thread-self/net/tcp", O_RDONLY) || under_sanitizer);
        check.that(opens("/usr/bin/env", O_RDONLY));
        check.that(opens("/dev/null", O_RDWR));
    }));
}

TEST_F(Sandbox, LandlockBlocksMakingLinksAndPipes) {
    EXPECT_CHECKS(in_child([&](Checks &check) {
        check.needs(enters_landlock(policy));
        check.that(::symlink("/etc/passwd", (inside / "link").c_str()) != 0);
        check.that(::mkfifo((inside / "pipe").c_str(), 0600) != 0);
        check.that(::link((outside / "old").c_str(), (inside / "link").c_str()) != 0);
    }));
}

TEST_F(Sandbox, APluginHasAPrivateScratchFolderOfLimitedSize) {
    policy = {.mode = Mode::permissive};
    ::signal(SIGXFSZ, SIG_IGN);
    const auto fills = [](const fs::path &file) { // writes the maximum size of a file
        const std::vector<char> block(1 << 20);
        const int fd = ::open(file.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
        std::uint64_t size = 0;
        for (ssize_t count = 1; count > 0 && size <= scratch_bytes;
             size += count > 0 ? static_cast<std::uint64_t>(count) : 0)
            count = ::write(fd, block.data(), block.size());
        ::close(fd);
        return size >= scratch_bytes;
    };
    for (const uid_t user : {0u, 65534u})
        for (int start = 0; start < 2; ++start) // the second one finds nothing of the first one
            EXPECT_CHECKS(in_child([&](Checks &check) {
                ::setenv("HOME", scratch.path().c_str(), 1);
                check.needs(user == ::geteuid() ||
                            (::setuid(user) == 0 && ::prctl(PR_SET_DUMPABLE, 1, 0, 0, 0) == 0));
                const Level level = enter_for("/usr/lib/none.so", policy);
                check.needs(std::ranges::any_of(level, [](const Layer &layer) { return has(layer, "mount"); }));
                const char *folder_name = ::getenv("TMPDIR");
                check.that(folder_name != nullptr);
                const fs::path folder = folder_name ? folder_name : "/none";
                for (const char *variable : {"HOME", "XDG_CACHE_HOME", "MPLCONFIGDIR", "NUMBA_CACHE_DIR"})
                    check.that(::getenv(variable) && ::getenv(variable) == folder);
                check.that(::getenv("PYTHONUSERBASE") == scratch.path().string() + "/.local");
                check.that(fs::is_empty(folder));
                check.that(::mkdir((folder / "cache").c_str(), 0700) == 0);
                check.that(opens(folder / "cache" / "new", O_RDWR | O_CREAT | O_EXCL));
                check.that(opens(folder, O_RDWR | O_TMPFILE));
                check.that(::rename((folder / "cache" / "new").c_str(), (folder / "old").c_str()) == 0);
                check.that(::unlink((folder / "old").c_str()) == 0);
                check.that(!opens(folder / ".." / "new", O_RDWR | O_CREAT));
                check.that(fills(folder / "large"));
                check.that(!fills(folder / "another") && errno == ENOSPC);
            }));
    EXPECT_FALSE(fs::exists("/arhost-scratch"));
}

TEST_F(Sandbox, TheSceneLoaderHasNoScratchFolder) {
    EXPECT_CHECKS(in_child([&](Checks &check) {
        ::unsetenv("TMPDIR");
        enter(policy);
        check.that(!::getenv("TMPDIR"));
        check.that(!fs::exists("/arhost-scratch"));
    }));
}

TEST_F(Sandbox, SystemCallsThatEveryKernelHasFailWithEperm) {
    policy.writable.clear();
    EXPECT_CHECKS(in_child([&](Checks &check) {
        check.needs(!under_sanitizer && filters_system_calls(policy));
        const auto is_refused = [](long result) { return result != 0 && errno == EPERM; };
        check.that(is_refused(::mkdir((inside / "new").c_str(), 0700)));
        check.that(is_refused(::unlink((inside / "old").c_str())));
        check.that(is_refused(::rename((inside / "old").c_str(), (inside / "new").c_str())));
        check.that(is_refused(::link((inside / "old").c_str(), (inside / "new").c_str())));
        check.that(is_refused(::listen(0, 1)));
        check.that(is_refused(::setuid(::getuid())));
        check.that(::syscall(SYS_epoll_create1, 0) != 0 && errno == ENOSYS); // libraries use poll instead
        check.that(::syscall(462 /* mseal */, 0, 0, 0) != 0 && errno == ENOSYS);
    }));
}

TEST_F(Sandbox, SystemCallsCannotAffectOtherProcesses) {
    EXPECT_CHECKS(in_child([&](Checks &check) {
        check.needs(filters_system_calls(policy));
        const rlimit limit{1000, 1000};
        check.that(::kill(::getpid(), 0) == 0);
        check.that(::getrlimit(RLIMIT_CPU, const_cast<rlimit *>(&limit)) == 0);
        check.that(::fcntl(0, F_GETFD) >= 0);
        check.that(::fcntl(0, F_SETOWN, ::getpid()) != 0);
        check.that(::syscall(SYS_fcntl, 0, 0x100000000ul | F_SETOWN, ::getpid()) != 0);
        check.that(::prlimit(::getppid(), RLIMIT_CPU, &limit, nullptr) != 0);
        check.that(under_sanitizer || ::prctl(PR_SET_PDEATHSIG, 0) != 0);
        check.that(::chmod((inside / "old").c_str(), 0777) != 0);
        check.that(::truncate((inside / "old").c_str(), 0) != 0);
        const int old = ::open((inside / "old").c_str(), O_RDWR);
        check.that(::fchmod(old, 04777) != 0);
        check.that(::fchown(old, ::getuid(), ::getgid()) != 0);
        check.that(::ftruncate(old, 1) == 0);
        check.that(::ioctl(old, TIOCSTI, "x") != 0 && errno == EPERM); // not ENOTTY
        if (!under_sanitizer) {
            check.that(::kill(::getppid(), 0) != 0);
            check.that(::kill(0, 0) != 0);
            check.that(::kill(-1, 0) != 0);
        }
    }));
}

TEST_F(Sandbox, SystemCallListsContainOnlyKnownNames) {
    std::vector<std::set<std::string, std::less<>>> all = {{}};
    for (const std::string_view allowance : allowances)
        all.push_back({std::string(allowance)});
    for (const auto &allow : all) {
        policy.allow = allow;
        EXPECT_CHECKS(in_child([&](Checks &check) {
            ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
            const std::string missing = filter_system_calls(policy).missing;
            check.that(missing.find("unknown to libseccomp") == std::string::npos);
        }));
    }
}

TEST_F(Sandbox, SystemCallsBlockFiltersAndProcessDescriptorsOfSockets) {
    for (const char *allow : {"video", "network", "usb"}) {
        policy.allow = {allow};
        EXPECT_CHECKS(in_child([&](Checks &check) {
            int ends[2];
            ::socketpair(AF_UNIX, SOCK_STREAM, 0, ends);
            check.needs(filters_system_calls(policy));
            const bool has_usb = policy.allows("usb");
            sock_filter all{BPF_RET | BPF_K, 0, 0, 0xffffffff};
            const sock_fprog program{1, &all};
            check.that((::setsockopt(ends[0], SOL_SOCKET, SO_ATTACH_FILTER, &program, sizeof program) == 0) ==
                       has_usb); // libudev
            const int bpf = -1, on = 1;
            for (const int option : {50, 51, 52}) // BPF
                check.that(::setsockopt(ends[0], SOL_SOCKET, option, &bpf, sizeof bpf) != 0 && errno == EPERM);
            check.that(::setsockopt(ends[0], SOL_SOCKET, 76 /* SO_PASSPIDFD */, &on, sizeof on) != 0 &&
                       errno == EPERM);
            int pidfd;
            socklen_t size = sizeof pidfd;
            check.that(::getsockopt(ends[0], SOL_SOCKET, 77 /* SO_PEERPIDFD */, &pidfd, &size) != 0 &&
                       errno == EPERM);
            check.that(under_sanitizer || (::syscall(SYS_flock, 0, 0) != 0 && errno == ENOSYS));
        }));
    }
}

TEST_F(Sandbox, SystemCallsAllowThreadsButNotProcesses) {
    EXPECT_CHECKS(in_child([&](Checks &check) {
        check.needs(filters_system_calls(policy));
        bool ran = false;
        std::thread([&] { ran = true; }).join();
        check.that(ran);
        check.that(under_sanitizer || !forks());
        check.that(::unshare(CLONE_NEWNS) != 0);
    }));
}

TEST_F(Sandbox, SystemCallsBlockSocketsToOtherProcesses) {
    EXPECT_CHECKS(in_child([&](Checks &check) {
        check.needs(filters_system_calls(policy));
        int ends[2];
        for (const int family : {AF_UNIX, AF_INET, AF_INET6, AF_NETLINK, AF_PACKET, AF_VSOCK, 63, 64, 1000})
            check.that(!opens_socket(family));
        check.that(::socketpair(AF_UNIX, SOCK_STREAM, 0, ends) == 0);
        check.that(::socketpair(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0, ends) != 0);
    }));
}

TEST_F(Sandbox, AllowancesGrantWhatTheyName) {
    struct Case {
        const char *allow;
        bool forks, unix, internet;
    };
    for (const Case &c : {Case{"processes", true, false, false}, Case{"display", false, true, false},
                          Case{"network", false, true, true}, Case{"gpu", false, false, false},
                          Case{"video", false, false, false}, Case{"usb", false, false, false}}) {
        policy.allow = {c.allow};
        EXPECT_CHECKS(in_child([&](Checks &check) {
            enter(policy);
            check.that((forks() == c.forks) || under_sanitizer);
            check.that(opens_socket(AF_UNIX) == c.unix);
            check.that(opens_socket(AF_INET) == c.internet);
        })) << c.allow;
    }
}

TEST_F(Sandbox, SetsTheHighestOomScore) {
    EXPECT_CHECKS(in_child([&](Checks &check) {
        const Level level = enter(policy);
        int score = 0;
        std::ifstream("/proc/self/oom_score_adj") >> score;
        check.that((score == 1000) == level.front().missing.empty());
    }));
}

TEST_F(Sandbox, LimitsMemoryFilesAndDescriptors) {
    policy.writable.clear();
    policy.memory_bytes = 256u << 20;
    EXPECT_CHECKS(in_child([&](Checks &check) {
        enter(policy);
        const auto map = [](std::size_t size, int flags) {
            return ::mmap(nullptr, size, PROT_READ | PROT_WRITE, flags | MAP_ANONYMOUS, -1, 0) != MAP_FAILED;
        };
        check.that(map(64u << 20, MAP_PRIVATE));
        check.that(!map(512u << 20, MAP_PRIVATE) || under_sanitizer);
        check.that(!map(64u << 20, MAP_SHARED) || under_sanitizer);
        check.that(!map(64u << 20, MAP_PRIVATE | MAP_GROWSDOWN) || under_sanitizer);
        check.that(::memfd_create("mine", 0) < 0 || under_sanitizer);
        int held = 0;
        while (held < 2000 && ::open("/dev/null", O_RDONLY) >= 0)
            ++held;
        check.that(held < 512);
        rlimit priority{1, 1};
        ::getrlimit(RLIMIT_RTPRIO, &priority);
        check.that(priority.rlim_max == 0);
    }));
}

TEST_F(Sandbox, DoesNotLimitMemoryForAGpu) {
    policy.allow = {"gpu"};
    policy.memory_bytes = 256u << 20;
    EXPECT_CHECKS(in_child([&](Checks &check) {
        enter(policy);
        check.that(::mmap(nullptr, 512u << 20, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE,
                          -1, 0) != MAP_FAILED);
        check.that(::memfd_create("mine", 0) >= 0);
        check.that(::mmap(nullptr, 4096, PROT_READ | PROT_WRITE | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) !=
                   MAP_FAILED); // a shader compiler
    }));
}

TEST_F(Sandbox, CreatesWritableFolders) {
    policy.writable = {outside / "a/b"};
    EXPECT_CHECKS(in_child([&](Checks &check) {
        enter(policy);
        check.that(opens(outside / "a/b/new", O_WRONLY | O_CREAT));
    }));
}

TEST_F(Sandbox, KeepsTheParentDeathSignal) {
    EXPECT_CHECKS(in_child([&](Checks &check) {
        ::prctl(PR_SET_PDEATHSIG, SIGKILL);
        enter(policy);
        int signal = 0;
        ::prctl(PR_GET_PDEATHSIG, &signal);
        check.that(signal == SIGKILL);
    }));
}

TEST_F(Sandbox, ReportsEachLayer) {
    EXPECT_CHECKS(in_child([&](Checks &check) {
        const Level level = enter(policy);
        check.that(level.size() == 8);
        for (const Layer &layer : level)
            check.that(!layer.active.empty() || !layer.missing.empty());
    }));
    const Level level = {{"a", "x, y", ""}, {"b", "z", "no w"}, {"c", "", "no v"}};
    EXPECT_EQ(to_text(level), "a: x, y; b: z; MISSING b: no w; c: no v");
    EXPECT_FALSE(complete(level));
    EXPECT_TRUE(complete({level.front()}));
}

TEST_F(Sandbox, ModeNoneRestrictsNothing) {
    policy.mode = Mode::none;
    EXPECT_CHECKS(in_child([&](Checks &check) {
        check.that(enter(policy).empty());
        check.that(forks());
        check.that(opens(outside / "old", O_RDWR));
    }));
}

TEST_F(Sandbox, PolicySurvivesAJsonRoundTrip) {
    policy.mode = Mode::strict;
    policy.allow = {"gpu", "video"};
    policy.readable = {"/a", "/b"};
    policy.environment = {"GIVEN"};
    policy.memory_bytes = 1ull << 40;
    policy.makes_shared_memory = true;
    policy.usb_device = "046d:0825:A";
    const Policy read = policy_from_json(to_json(policy));
    EXPECT_EQ(to_json(read), to_json(policy));
    EXPECT_EQ(read.writable, policy.writable);
    EXPECT_EQ(read.environment, policy.environment);
    EXPECT_EQ(read.usb_device, policy.usb_device);
    EXPECT_TRUE(read.meets("usb"));
    EXPECT_FALSE(read.allows("usb"));
    EXPECT_TRUE(read.allows("gpu"));
    EXPECT_FALSE(read.allows("network"));
    EXPECT_THROW(policy_from_json({{"mode", 1}}), nlohmann::json::exception);
}
