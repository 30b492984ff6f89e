/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A working tracker that attempts one kind of attack at one frame. It logs each attempt as "NAME: what: stopped" or
 * "NAME: what: SUCCEEDED"; the harm of attacks that succeed is limited.
 */
#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#include <arhost/arhost.h>

#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/filter.h>
#include <net/if.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/file.h>
#include <sys/inotify.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/mount.h>
#include <sys/msg.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/sem.h>
#include <sys/shm.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <sys/xattr.h>
#include <time.h>
#include <unistd.h>

enum { control = 3, doorbell = 4 };

struct arhost_instance {
    const arhost_host *host;
    char attack[64], target[1024];
    int64_t at;
    arhost_marker_config marker; /* the first of the configuration */
    arhost_intrinsics lens;
    int32_t tracked;
};
typedef struct arhost_instance tracker;

static void report(const tracker *self, const char *what, int succeeded) {
    char text[256];
    const char *why = succeeded ? "" : strerror(errno);
    snprintf(text, sizeof text, "%s: %s: %s%s%s", self->attack, what, succeeded ? "SUCCEEDED" : "stopped",
             succeeded ? "" : ", ", why);
    self->host->log(self->host, ARHOST_SEVERITY_INFO, text);
}

/* Returns the host's pid, which the test provides: getppid() would return the launcher's pid. */
static pid_t host_pid(void) {
    const char *text = getenv("HOSTILE_HOST");
    return text ? (pid_t)atoi(text) : getppid();
}

/* Returns the launcher's pid, or that of the process in its PID namespace that has a copy of the launcher's memory.
 */
static pid_t launcher_pid(void) {
    return getppid() ? getppid() : 1;
}

/* Whether the folder of another process is visible in /proc. */
static int sees_processes(void) {
    DIR *folder = opendir("/proc");
    struct dirent *entry;
    int found = 0;
    while (folder && (entry = readdir(folder)))
        found |= isdigit(entry->d_name[0]) && atoi(entry->d_name) != getpid();
    if (folder)
        closedir(folder);
    return found;
}

/* Whether the name of the control group is visible: in a namespace, all are "/". */
static int sees_control_group(void) {
    FILE *groups = fopen("/proc/self/cgroup", "r");
    char line[4096];
    int found = 0;
    while (groups && fgets(line, sizeof line, groups))
        found |= !strstr(line, ":/\n");
    if (groups)
        fclose(groups);
    return found;
}

/* Whether memory that it shares with the host becomes executable. */
static int executes_shared_memory(void) {
    FILE *maps = fopen("/proc/self/maps", "r");
    char line[512];
    unsigned long begin, end;
    int found = 0;
    while (maps && !found && fgets(line, sizeof line, maps))
        found = strstr(line, "memfd:arhost") && sscanf(line, "%lx-%lx", &begin, &end) == 2 &&
                mprotect((void *)begin, end - begin, PROT_READ | PROT_EXEC) == 0;
    if (maps)
        fclose(maps);
    return found;
}

static int opens(const char *file, int flags) {
    const int fd = open(file, flags | O_CLOEXEC, 0600);
    if (fd >= 0)
        close(fd);
    return fd >= 0;
}

static int lists(const char *file, const char *text) {
    FILE *lines = fopen(file, "r");
    char line[1024];
    int found = 0;
    while (lines && fgets(line, sizeof line, lines))
        found |= strstr(line, text) != NULL;
    if (lines)
        fclose(lines);
    return found;
}

/* The test listens on a socket whose name begins like that of the target, and on a TCP port. */
static void read_network_files(const tracker *self, const char *folder, const char *const what[2]) {
    char file[96];
    snprintf(file, sizeof file, "%s/net/unix", folder);
    report(self, what[0], lists(file, self->target));
    snprintf(file, sizeof file, "%s/net/tcp", folder);
    report(self, what[1], lists(file, " 0A ")); /* state: listening */
}

static void read_files(const tracker *self) {
    char file[64];
    report(self, "a file outside its list", opens(self->target, O_RDONLY));
    report(self, "the passwords", opens("/etc/shadow", O_RDONLY));
    snprintf(file, sizeof file, "/proc/%d/environ", (int)host_pid());
    report(self, "the host's environment", opens(file, O_RDONLY));
    snprintf(file, sizeof file, "/proc/%d/maps", (int)host_pid());
    report(self, "the host's addresses", opens(file, O_RDONLY));
    snprintf(file, sizeof file, "/proc/%d/mountinfo", (int)launcher_pid());
    report(self, "the launcher's mounts", opens(file, O_RDONLY));
    report(self, "the processes", sees_processes());
    report(self, "the keys", opens("/proc/keys", O_RDONLY));
    report(self, "the kernel's command line", opens("/proc/cmdline", O_RDONLY));
    report(self, "the kernel's settings", opens("/proc/sys/kernel/hostname", O_RDONLY));
    report(self, "the control group", sees_control_group());
    read_network_files(self, "/proc/self", (const char *const[]){"the names of sockets", "the connections"});
    snprintf(file, sizeof file, "/proc/self/task/%d", (int)gettid());
    read_network_files(self, file,
                       (const char *const[]){"the names of sockets by a thread", "the connections by a thread"});
}

/* Names, sizes and attributes of files that the plugin may not read. */
static void read_metadata(const tracker *self) {
    char other[1100], text[64];
    struct stat status;
    report(self, "a file's size", stat(self->target, &status) == 0);
    report(self, "whether a file exists", access(self->target, F_OK) == 0);
    report(self, "a link's target", readlink(strcat(strcpy(other, self->target), ".alias"), text, sizeof text) > 0);
    report(self, "attributes", listxattr(self->target, text, sizeof text) >= 0);
    report(self, "an attribute", getxattr(self->target, "user.none", text, sizeof text) >= 0 || errno == ENODATA);
    report(self, "the names in a folder", opens(getenv("HOSTILE_FOLDER"), O_RDONLY | O_DIRECTORY));
    report(self, "the names in the root folder", opens("/", O_RDONLY | O_DIRECTORY) && access("/home", F_OK) == 0);
    report(self, "watch a folder", inotify_add_watch(inotify_init1(0), getenv("HOSTILE_FOLDER"), IN_ALL_EVENTS) >= 0);
}

/* System V objects that the test has created. */
static void reach_system_v_objects(const tracker *self) {
    const int shared = atoi(getenv("HOSTILE_SHM")), queue = atoi(getenv("HOSTILE_QUEUE")),
              semaphores = atoi(getenv("HOSTILE_SEMAPHORES"));
    struct msqid_ds about_queue;
    struct shmid_ds about;
    report(self, "attach memory", shmat(shared, NULL, 0) != (void *)-1);
    report(self, "memory's owner", shmctl(shared, IPC_STAT, &about) == 0);
    report(self, "list memory", shmctl(0, SHM_INFO, &about) >= 0);
    report(self, "a queue's owner", msgctl(queue, IPC_STAT, &about_queue) == 0);
    report(self, "send a message",
           msgsnd(queue, &(struct {
                      long type;
                      char text[8];
                  }){1, "x"},
                  1, IPC_NOWAIT) == 0);
    report(self, "read a message",
           msgrcv(queue, &(struct {
                      long type;
                      char text[64];
                  }){0, ""},
                  64, 0, IPC_NOWAIT) >= 0);
    report(self, "a semaphore", semctl(semaphores, 0, GETVAL) >= 0);
    report(self, "new memory", shmget(IPC_PRIVATE, 4096, IPC_CREAT | 0600) >= 0);
}

/* Each attempt uses a different file name, so that a successful attempt does not affect the next one. */
static void write_files(const tracker *self) {
    char other[1100];
    report(self, "an old file", opens(self->target, O_WRONLY));
    report(self, "chmod", chmod(self->target, 0777) == 0);
    report(self, "chown", chown(self->target, getuid(), getgid()) == 0);
    report(self, "truncate", truncate(self->target, 0) == 0);
    report(self, "a new file", opens(strcat(strcpy(other, self->target), ".new"), O_WRONLY | O_CREAT));
    report(self, "link", link(self->target, strcat(strcpy(other, self->target), ".link")) == 0);
    report(self, "symlink", symlink(self->target, strcat(strcpy(other, self->target), ".symlink")) == 0);
    report(self, "mkdir", mkdir(strcat(strcpy(other, self->target), ".folder"), 0700) == 0);
    report(self, "mkfifo", mkfifo(strcat(strcpy(other, self->target), ".pipe"), 0600) == 0);
    report(self, "rename", rename(self->target, strcat(strcpy(other, self->target), ".renamed")) == 0);
    report(self, "unlink", unlink(strcat(strcpy(other, self->target), ".other")) == 0);
}

/* Not every machine has all of these devices. */
static void open_devices(const tracker *self) {
    const char *const devices[] = {"/dev/ptmx", "/dev/kmsg", "/dev/fuse", "/dev/mem", "/dev/loop0", "/dev/video0"};
    size_t i;
    for (i = 0; i < sizeof devices / sizeof *devices; ++i)
        report(self, devices[i], opens(devices[i], O_RDONLY | O_NOCTTY));
}

static int file_has(const char *file, const char *text) {
    static char bytes[1 << 16];
    const int fd = open(file, O_RDONLY | O_CLOEXEC);
    const ssize_t size = fd < 0 ? 0 : read(fd, bytes, sizeof bytes);
    if (fd >= 0)
        close(fd);
    return size > 0 && memmem(bytes, (size_t)size, text, strlen(text)) != NULL;
}

static void read_environment(const tracker *self) {
    char file[64];
    errno = ENOENT;
    report(self, "a secret variable", getenv("HOSTILE_SECRET") != NULL);
    report(self, "a secret that begins like a driver's variable", getenv("VK_TOKEN") != NULL);
    report(self, "a secret that begins like a linker's variable", getenv("LD_ACCESS_TOKEN") != NULL);
    report(self, "the initial environment", file_has("/proc/self/environ", "HOSTILE_SECRET="));
    snprintf(file, sizeof file, "/proc/%d/environ", (int)launcher_pid());
    report(self, "the launcher's environment", file_has(file, "HOSTILE_SECRET="));
}

/* Connects to a Unix socket. The test listens on a path and on an abstract name. */
static int connects(const tracker *self, int is_abstract) {
    struct sockaddr_un address = {AF_UNIX, {0}};
    const int fd = socket(AF_UNIX, SOCK_STREAM, 0);
    int length, result;
    if (fd < 0)
        return 0;
    length = snprintf(address.sun_path + is_abstract, sizeof address.sun_path - 1, "%s.socket", self->target);
    result = connect(fd, (struct sockaddr *)&address, (socklen_t)(sizeof(sa_family_t) + (size_t)(length + 1)));
    close(fd);
    return result == 0;
}

static void open_sockets(const tracker *self) {
    int ends[2];
    struct ifreq interfaces[16];
    struct ifconf list = {sizeof interfaces, {(void *)interfaces}};
    struct sock_filter all = {BPF_RET | BPF_K, 0, 0, 0xffffffff};
    const struct sock_fprog program = {1, &all};
    int pidfd;
    socklen_t size = sizeof pidfd;
    report(self, "network interfaces", ioctl(control, SIOCGIFCONF, &list) == 0 && list.ifc_len > 0);
    report(self, "a pair of another family", socketpair(AF_INET, SOCK_STREAM, 0, ends) == 0 || errno == EOPNOTSUPP);
    report(self, "internet", socket(AF_INET, SOCK_STREAM, 0) >= 0);
    report(self, "datagrams", socket(AF_INET6, SOCK_DGRAM, 0) >= 0);
    report(self, "netlink", socket(AF_NETLINK, SOCK_RAW, 0) >= 0);
    report(self, "packets", socket(AF_PACKET, SOCK_RAW, 0) >= 0);
    report(self, "virtual machines", socket(AF_VSOCK, SOCK_STREAM, 0) >= 0);
    report(self, "a family with upper bits set", syscall(SYS_socket, 0x100000000l | AF_INET, SOCK_STREAM, 0) >= 0);
    report(self, "a path", connects(self, 0));
    report(self, "an abstract name", connects(self, 1));
    report(self, "a pair that can send anywhere", socketpair(AF_UNIX, SOCK_DGRAM, 0, ends) == 0);
    /* A listening socket that was shut down connects by this flag. Other sockets ignore it. */
    report(self, "a connection by sending",
           socketpair(AF_UNIX, SOCK_STREAM, 0, ends) == 0 && sendto(ends[0], "x", 1, MSG_FASTOPEN, NULL, 0) == 1);
    report(self, "a filter", setsockopt(control, SOL_SOCKET, SO_ATTACH_FILTER, &program, sizeof program) == 0);
    report(self, "the host's process", getsockopt(control, SOL_SOCKET, 77 /* SO_PEERPIDFD */, &pidfd, &size) == 0);
}

/* The terminal that arhost was started in. */
static void use_terminal(const tracker *self) {
    const int terminal = open(getenv("HOSTILE_TERMINAL"), O_RDWR | O_NOCTTY | O_CLOEXEC);
    int fd, inherited = 0;
    report(self, "open the terminal", terminal >= 0);
    report(self, "open its own terminal", opens("/dev/tty", O_RDWR | O_NOCTTY));
    for (fd = 0; fd < 16; ++fd)
        inherited |= isatty(fd);
    report(self, "an inherited terminal", inherited);
    report(self, "type", ioctl(terminal, TIOCSTI, "x") == 0);
    report(self, "the foreground group", tcsetpgrp(terminal, getpgrp()) == 0);
    report(self, "another session's group", getsid(0) != getpid() && getpgrp() != getpid());
}

/* Executes memory that it has written: the last step of an attack through a defect of a parser. */
static void execute_data(const tracker *self) {
    enum { read_write = PROT_READ | PROT_WRITE, read_execute = PROT_READ | PROT_EXEC, all = read_write | PROT_EXEC };
    const size_t page = (size_t)sysconf(_SC_PAGESIZE);
    void *const code = (void *)((uintptr_t)&execute_data & ~(page - 1));
    const int library = open("/bin/true", O_RDONLY | O_CLOEXEC);
    void *const data = mmap(NULL, page, read_write, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    report(self, "writable code", mmap(NULL, page, all, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) != MAP_FAILED);
    report(self, "new code", mmap(NULL, page, read_execute, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) != MAP_FAILED);
    report(self, "a file's code, writable", mmap(NULL, page, all, MAP_PRIVATE, library, 0) != MAP_FAILED);
    report(self, "a file's code, shared", mmap(NULL, page, read_execute, MAP_SHARED, library, 0) != MAP_FAILED);
    report(self, "data", mprotect(data, page, read_execute) == 0);
    report(self, "data, still writable", mprotect(data, page, all) == 0);
    report(self, "data, with a key", syscall(SYS_pkey_mprotect, data, page, read_execute, -1) == 0);
    report(self, "the stack",
           mprotect((void *)((uintptr_t)&page & ~(page - 1)), page, read_execute | PROT_WRITE) == 0);
    report(self, "its own code, writable", mprotect(code, page, all) == 0);
    report(self, "its own code through /proc", opens("/proc/self/mem", O_RDWR));
    report(self, "all data, by a personality", syscall(SYS_personality, 0x0400000 /* READ_IMPLIES_EXEC */) >= 0);
    report(self, "the host's memory", executes_shared_memory());
}

/* Calls that reach the kernel or change the view of the file system. */
static void enter_kernel(const tracker *self) {
    static const struct {
        const char *name;
        long number, arguments[3];
    } calls[] = {
        {"a user namespace", SYS_unshare, {CLONE_NEWUSER, 0, 0}},
        {"a mount namespace", SYS_unshare, {CLONE_NEWNS, 0, 0}},
        {"chroot", SYS_chroot, {(long)"/", 0, 0}},
        {"bpf", SYS_bpf, {0, 0, 0}},
        {"userfaultfd", SYS_userfaultfd, {1, 0, 0}},
        {"io_uring", SYS_io_uring_setup, {1, 0, 0}},
        {"perf_event_open", SYS_perf_event_open, {0, 0, 0}},
        {"a keyring", SYS_keyctl, {0, -3, 1}},
        {"the kernel's log", SYS_syslog, {10, 0, 0}},
        {"a file by handle", SYS_open_by_handle_at, {-1, 0, 0}},
        {"a quota", SYS_quotactl, {0, 0, 0}},
        {"another personality", SYS_personality, {0x0040000, 0, 0}},
        {"a fanotify group", SYS_fanotify_init, {0, 0, 0}},
        {"a mount", SYS_mount, {(long)"none", (long)"/tmp", (long)"tmpfs"}},
        {"a module", SYS_finit_module, {-1, (long)"", 0}},
        {"a file lock", SYS_flock, {control, LOCK_EX | LOCK_NB, 0}},
    };
    size_t i;
    for (i = 0; i < sizeof calls / sizeof *calls; ++i) {
        const long result =
            syscall(calls[i].number, calls[i].arguments[0], calls[i].arguments[1], calls[i].arguments[2], 0, 0, 0);
        report(self, calls[i].name, result >= 0 || (errno != EPERM && errno != ENOSYS && errno != EACCES));
    }
}

static void make_processes(const tracker *self) {
    char *arguments[] = {(char *)"true", NULL};
    int i, made = 0;
    for (i = 0; i < 100; ++i) {
        const pid_t child = fork();
        if (child == 0)
            _exit(0);
        if (child > 0) {
            ++made;
            waitpid(child, NULL, 0);
        }
    }
    report(self, "fork", made > 0);
    report(self, "a namespace", unshare(CLONE_NEWUSER) == 0);
    execv("/bin/true", arguments); /* does not return on success */
    report(self, "exec", 0);
}

static void trace_host(const tracker *self) {
    static char byte;
    struct iovec mine = {&byte, 1}, theirs = {&byte, 1};
    char file[64];
    report(self, "attach", ptrace(PTRACE_SEIZE, host_pid(), NULL, NULL) == 0);
    report(self, "attach to the launcher", ptrace(PTRACE_SEIZE, launcher_pid(), NULL, NULL) == 0);
    report(self, "read memory", process_vm_readv(host_pid(), &mine, 1, &theirs, 1, 0) > 0 || errno == EFAULT);
    report(self, "write memory", process_vm_writev(host_pid(), &mine, 1, &theirs, 1, 0) > 0 || errno == EFAULT);
    snprintf(file, sizeof file, "/proc/%d/mem", (int)host_pid());
    report(self, "open memory", opens(file, O_RDWR));
    snprintf(file, sizeof file, "/proc/%d/mem", (int)launcher_pid());
    report(self, "open the launcher's memory", opens(file, O_RDWR));
    report(self, "take a descriptor", syscall(SYS_pidfd_getfd, syscall(SYS_pidfd_open, host_pid(), 0), 1, 0) >= 0);
}

static void signal_host(const tracker *self) {
    const struct rlimit second = {1, 1};
    const struct f_owner_ex owner = {F_OWNER_PID, host_pid()};
    cpu_set_t processor;
    siginfo_t info;
    memset(&info, 0, sizeof info);
    info.si_code = SI_QUEUE;
    CPU_ZERO(&processor);
    CPU_SET(0, &processor);
    report(self, "kill", kill(host_pid(), SIGKILL) == 0);
    report(self, "reach the launcher", kill(launcher_pid(), 0) == 0); /* killing it would kill this worker too */
    report(self, "reach all", kill(-1, 0) == 0);
    report(self, "join the host's group", setpgid(0, getpgid(host_pid())) == 0);
    report(self, "tkill", syscall(SYS_tkill, host_pid(), SIGKILL) == 0);
    report(self, "tgkill", syscall(SYS_tgkill, host_pid(), host_pid(), SIGKILL) == 0);
    report(self, "queue", syscall(SYS_rt_sigqueueinfo, host_pid(), SIGKILL, &info) == 0);
    report(self, "pidfd",
           syscall(SYS_pidfd_send_signal, syscall(SYS_pidfd_open, host_pid(), 0), SIGKILL, NULL, 0) == 0);
    report(self, "a descriptor's owner", fcntl(control, F_SETOWN_EX, &owner) == 0);
    report(self, "a descriptor's signal", fcntl(control, F_SETSIG, SIGKILL) == 0);
    report(self, "a limit", prlimit(host_pid(), RLIMIT_CPU, &second, NULL) == 0);
    report(self, "a priority", setpriority(PRIO_PROCESS, (id_t)host_pid(), 19) == 0);
    report(self, "a processor", sched_setaffinity(host_pid(), sizeof processor, &processor) == 0);
}

/* Used with `allow: [processes]`: a child has the same restrictions as the plugin, and the plugin may signal it. */
static void signal_from_a_child(const tracker *self) {
    int status = 0;
    const pid_t child = fork();
    if (child == 0)
        _exit(kill(host_pid(), SIGKILL) == 0 ? 0 : errno);
    waitpid(child, &status, 0);
    errno = WEXITSTATUS(status);
    report(self, "a child's kill", child > 0 && status == 0);
}
static void signal_own_child(const tracker *self) {
    const pid_t child = fork();
    if (child == 0)
        for (;;)
            pause();
    self->host->log(self->host, ARHOST_SEVERITY_INFO,
                    child > 0 && kill(child, SIGKILL) == 0 && waitpid(child, NULL, 0) == child ? "its child ends"
                                                                                               : "its child lives");
}

static void *wait_forever(void *nothing) {
    for (;;)
        pause();
    return nothing;
}

static void fill_memory(const tracker *self) {
    enum { step = 16 << 20, max_mib = 512 };
    size_t taken = 0;
    int fd;
    while (taken < max_mib) {
        char *bytes = malloc(step);
        if (!bytes)
            break;
        memset(bytes, 1, step);
        taken += step >> 20;
    }
    report(self, "half a GiB", taken >= max_mib);
    report(self, "shared", mmap(NULL, step, PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0) != MAP_FAILED);
    report(self, "a stack",
           mmap(NULL, (size_t)400 << 20, PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_GROWSDOWN, -1, 0) !=
               MAP_FAILED);
    fd = open("/dev/zero", O_RDWR | O_CLOEXEC);
    report(self, "shared zeros", fd >= 0 && mmap(NULL, step, PROT_WRITE, MAP_SHARED, fd, 0) != MAP_FAILED);
    fd = memfd_create("hostile", 0);
    report(self, "a memfd", fd >= 0);
    /* Reading them would need 300 MiB of page tables. */
    report(self, "page tables",
           mmap(NULL, (size_t)150 << 30, PROT_READ, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0) !=
               MAP_FAILED);
}

/* Small stacks, so that the limit of memory does not stop this. */
static void start_threads(const tracker *self) {
    const long many = 1200 + 4 * sysconf(_SC_NPROCESSORS_ONLN);
    long threads = 0;
    pthread_t thread;
    pthread_attr_t small;
    pthread_attr_init(&small);
    pthread_attr_setstacksize(&small, 16 << 10);
    while (threads < many && pthread_create(&thread, &small, wait_forever, NULL) == 0)
        ++threads;
    report(self, "a thousand threads", threads == many);
}

/* Resources that the kernel counts per user, and memory in the kernel. */
static void exhaust_user(const tracker *self) {
    enum { many = 3000, big = 8 << 20 };
    const struct rlimit endless = {RLIM_INFINITY, RLIM_INFINITY}, more = {4096, 4096};
    const struct linger long_wait = {1, 120};
    const int size = big;
    int ends[2], made, found;
    unsigned long io = 0;
    socklen_t length = sizeof found;
    timer_t timer;
    union sigval value = {0};
    sigset_t blocked;
    for (made = 0; made < many && inotify_init1(0) >= 0;)
        ++made;
    report(self, "inotify instances", made > 0);
    for (made = 0; made < many && timer_create(CLOCK_MONOTONIC, NULL, &timer) == 0;)
        ++made;
    report(self, "timers", made == many);
    sigemptyset(&blocked);
    sigaddset(&blocked, SIGRTMIN + 5);
    pthread_sigmask(SIG_BLOCK, &blocked, NULL);
    for (made = 0; made < many && sigqueue(getpid(), SIGRTMIN + 5, value) == 0;)
        ++made;
    report(self, "queued signals", made == many);
    report(self, "epoll watches", epoll_create1(EPOLL_CLOEXEC) >= 0);
    report(self, "a lingering close",
           socketpair(AF_UNIX, SOCK_STREAM, 0, ends) == 0 &&
               setsockopt(ends[0], SOL_SOCKET, SO_LINGER, &long_wait, sizeof long_wait) == 0);
    report(self, "AIO events", syscall(SYS_io_setup, 10000, &io) == 0);
    report(self, "a larger pipe", pipe(ends) == 0 && fcntl(ends[1], F_SETPIPE_SZ, 1 << 20) >= 1 << 20);
    report(self, "a larger socket buffer",
           socketpair(AF_UNIX, SOCK_STREAM, 0, ends) == 0 &&
               setsockopt(ends[0], SOL_SOCKET, SO_SNDBUF, &size, sizeof size) == 0 &&
               getsockopt(ends[0], SOL_SOCKET, SO_SNDBUF, &found, &length) == 0 && found > 212992);
    report(self, "a larger stack", setrlimit(RLIMIT_STACK, &endless) == 0);
    report(self, "more descriptors", setrlimit(RLIMIT_NOFILE, &more) == 0);
    report(self, "real-time priority",
           sched_setscheduler(0, SCHED_FIFO, &(struct sched_param){.sched_priority = 1}) == 0);
    report(self, "a higher priority", setpriority(PRIO_PROCESS, 0, -5) == 0);
}

static void fill_disk(const tracker *self) {
    const char *const folders[][2] = {{"the working folder", "."},
                                      {"the home folder", getenv("HOSTILE_HOME") ? getenv("HOSTILE_HOME") : "."},
                                      {"/tmp", "/tmp"},
                                      {"/var/tmp", "/var/tmp"},
                                      {"/dev/shm", "/dev/shm"},
                                      {"/run", "/run"},
                                      {"/", "/"}};
    size_t i;
    for (i = 0; i < sizeof folders / sizeof *folders; ++i) {
        char file[1100];
        snprintf(file, sizeof file, "%s/hostile-%d", folders[i][1], (int)getpid());
        const int fd = open(file, O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
        report(self, folders[i][0], fd >= 0 && write(fd, file, sizeof file) > 0);
        if (fd >= 0) {
            close(fd);
            unlink(file);
        }
    }
}

/* Sends bytes together with a file descriptor. */
static ssize_t send_with_descriptor(int socket, char *bytes, size_t size, int fd, int flags) {
    _Alignas(struct cmsghdr) char ancillary[CMSG_SPACE(sizeof(int))] = {0};
    struct iovec part = {bytes, size};
    struct msghdr message = {0};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = ancillary;
    message.msg_controllen = sizeof ancillary;
    CMSG_FIRSTHDR(&message)->cmsg_level = SOL_SOCKET;
    CMSG_FIRSTHDR(&message)->cmsg_type = SCM_RIGHTS;
    CMSG_FIRSTHDR(&message)->cmsg_len = CMSG_LEN(sizeof(int));
    memcpy(CMSG_DATA(CMSG_FIRSTHDR(&message)), &fd, sizeof fd);
    return sendmsg(socket, &message, flags);
}

/* Keeps as many descriptors as possible: open ones, and ones in unread messages. */
static void hold_descriptors(const tracker *self) {
    enum { pairs = 20 };
    struct rlimit limit;
    int held = 0, in_flight = 0, pair[pairs][2], i, fd;
    getrlimit(RLIMIT_NOFILE, &limit);
    limit.rlim_cur = limit.rlim_max;
    setrlimit(RLIMIT_NOFILE, &limit);
    for (i = 0; i < pairs; ++i)
        (void)!socketpair(AF_UNIX, SOCK_STREAM, 0, pair[i]);
    while (held < 5000 && (fd = open("/dev/null", O_RDONLY)) >= 0)
        ++held;
    report(self, "more than 1024", held > 1024);
    for (i = 0; i < pairs;) {
        char byte = 0;
        if (send_with_descriptor(pair[i][1], &byte, sizeof byte, pair[i][0], MSG_DONTWAIT) < 0)
            ++i;
        else
            ++in_flight;
    }
    report(self, "a thousand in flight", in_flight > 1000);
}

/* Calls `visit` for each mapping of memory shared with the host. */
static void each_shared(const tracker *self, void (*visit)(const tracker *, void *, size_t, int writable)) {
    FILE *maps = fopen("/proc/self/maps", "r");
    char line[512], mode[8];
    unsigned long begin, end;
    while (maps && fgets(line, sizeof line, maps))
        if (strstr(line, "memfd:arhost") && sscanf(line, "%lx-%lx %7s", &begin, &end, mode) == 3)
            visit(self, (void *)begin, end - begin, mode[1] == 'w');
    if (maps)
        fclose(maps);
}

static void scribble_on(const tracker *self, void *bytes, size_t size, int writable) {
    if (writable)
        memset(bytes, 0xa5, size);
    else
        report(self, "make input writable", mprotect(bytes, size, PROT_READ | PROT_WRITE) == 0);
}

typedef struct {
    volatile uint32_t *words;
    size_t count;
} memory;
static memory memories[64];
static size_t memory_count;

static void note_memory(const tracker *self, void *bytes, size_t size, int writable) {
    (void)self;
    if (writable && memory_count < sizeof memories / sizeof *memories)
        memories[memory_count++] = (memory){bytes, size / sizeof(uint32_t)};
}

/* Changes each word between valid and invalid values, so that a word may change between the host's check and its use.
 */
static void *race(void *unused) {
    uint32_t flip = 1;
    size_t i, j, twice;
    for (;; flip = flip * 1664525u + 1013904223u)
        for (twice = 0; twice < 2; ++twice)
            for (i = 0; i < memory_count; ++i)
                for (j = 0; j < memories[i].count; ++j)
                    memories[i].words[j] ^= flip;
    return unused;
}

static void race_the_host(const tracker *self) {
    pthread_t thread;
    each_shared(self, note_memory);
    if (pthread_create(&thread, NULL, race, NULL) == 0)
        self->host->log(self->host, ARHOST_SEVERITY_INFO, "the race has started");
}

static void truncate_one(const tracker *self, void *bytes, size_t size, int writable) {
    char file[128];
    int fd;
    snprintf(file, sizeof file, "/proc/self/map_files/%lx-%lx", (unsigned long)bytes, (unsigned long)bytes + size);
    fd = open(file, O_RDWR | O_CLOEXEC);
    report(self, "open and truncate", fd >= 0 && ftruncate(fd, 0) == 0);
    if (writable)
        madvise(bytes, size,
                MADV_REMOVE); /* reading a hole returns zeros, which is harmless, but a contract violation */
}

/* Makes the host check the rings now, before a response corrects the ring positions. */
static void trigger_check(void) {
    (void)!write(doorbell, "", 1);
    for (;;)
        pause();
}

/* Changes all flags of the inherited descriptors and fills their buffers. */
static void change_flags(const tracker *self) {
    const int small = 1;
    int fd, i;
    (void)self;
    for (fd = 0; fd <= doorbell; ++fd) {
        fcntl(fd, F_SETFL, 0);
        fcntl(fd, F_SETFL, O_NONBLOCK | O_ASYNC | O_DIRECT);
        setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &small, sizeof small);
        setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &small, sizeof small);
    }
    for (i = 0; i < 100000; ++i)
        if (write(STDOUT_FILENO, "\n", 1) < 0)
            break;
    for (fd = 0; fd <= doorbell; ++fd)
        fcntl(fd, F_SETFL, 0);
    report(self, "block the host", 0);
}

static void say(const char *text, size_t size) {
    (void)!send(control, text, size, MSG_NOSIGNAL);
}
static void say_text(const char *text) {
    say(text, strlen(text));
}

/* Makes the host log a line for each message. */
static void send_failures(void) {
    int i;
    for (i = 0; i < 5000; ++i)
        say_text("{\"type\": \"failed\", \"status\": -8, \"text\": \"a failure after the start\"}");
}

/* Sends valid messages that are expensive to parse: 120 KB of numbers each. The host ends this process long before
 * the last one. */
static void send_large_messages(void) {
    static char text[120 << 10];
    const char head[] = "{\"type\": \"log\", \"severity\": 1, \"text\": \"\", \"numbers\": [0";
    size_t used = sizeof head - 1;
    int i;
    memcpy(text, head, used);
    for (; used + 4 < sizeof text; used += 2)
        memcpy(text + used, ",0", 2);
    memcpy(text + used, "]}", 2);
    for (i = 0; i < 4000; ++i)
        say(text, used + 2);
}

/* Sends many small messages. */
static void send_small_messages(void) {
    int i;
    for (i = 0; i < 2000000; ++i)
        say_text("{\"type\": \"detached\"}");
}

/* Sends an open file to the host, which must release it. */
static void send_descriptor(void) {
    char text[] = "{\"type\": \"detached\"}";
    (void)!send_with_descriptor(control, text, sizeof text - 1, open("/dev/null", O_RDONLY | O_CLOEXEC),
                                MSG_NOSIGNAL);
    for (;;)
        pause();
}

static void print_lines(void) {
    int i;
    for (i = 0; i < 20000; ++i)
        printf("line %d\n", i);
    fflush(stdout);
}

static void flood_output(void) {
    static char text[1 << 20];
    int i;
    memset(text, 'x', sizeof text);
    text[sizeof text - 1] = '\n';
    for (i = 0; i < 32; ++i)
        fwrite(text, 1, sizeof text, stdout);
    fflush(stdout);
}

/* Fills the pipe to the host at once, and aborts when the host has read or discarded everything. */
static void print_burst(void) {
    static char text[60 << 10];
    int unread = 1;
    memset(text, 'x', sizeof text);
    for (size_t i = 99; i < sizeof text; i += 100)
        text[i] = '\n';
    strcpy(text + sizeof text - 25, "\nthe reason of the crash");
    text[sizeof text - 1] = '\n';
    if (write(1, text, sizeof text) != (ssize_t)sizeof text)
        return;
    while (ioctl(1, FIONREAD, &unread) == 0 && unread > 0)
        usleep(1000);
    abort();
}

/* Repeats the first message of the worker, so that the host sets up the plugin again. */
static void say_hello(void) {
    say_text("{\"type\": \"hello\", \"sandbox\": \"\", \"descriptor\": {\"kind\": 2, \"id\": \"hostile\", "
             "\"name\": \"\", \"version\": \"\", \"vendor\": \"\", \"licence\": \"\", \"description\": \"\", "
             "\"capabilities\": 0, \"options\": [], \"needs\": []}}");
}

/* A message whose type is so long that the host must not log it in full. Each process tracks one frame first, so that
 * the host restarts it at once. */
static void send_huge_type(void) {
    static char text[120 << 10];
    const int head = snprintf(text, sizeof text, "{\"type\": \"");
    memset(text + head, 'x', sizeof text - (size_t)head);
    memcpy(text + sizeof text - 2, "\"}", 2);
    say(text, sizeof text);
    for (;;)
        pause();
}

static void report_progress_forever(const tracker *self) {
    for (;;)
        self->host->progress(self->host, 0.5, "still busy");
}

static void attack(const tracker *self) {
    const char *name = self->attack;
    size_t i;
    if (!strcmp(name, "read"))
        read_files(self);
    else if (!strcmp(name, "metadata"))
        read_metadata(self);
    else if (!strcmp(name, "system_v"))
        reach_system_v_objects(self);
    else if (!strcmp(name, "terminal"))
        use_terminal(self);
    else if (!strcmp(name, "kernel"))
        enter_kernel(self);
    else if (!strcmp(name, "code"))
        execute_data(self);
    else if (!strcmp(name, "exhaust"))
        exhaust_user(self);
    else if (!strcmp(name, "write"))
        write_files(self);
    else if (!strcmp(name, "devices"))
        open_devices(self);
    else if (!strcmp(name, "environment"))
        read_environment(self);
    else if (!strcmp(name, "sockets"))
        open_sockets(self);
    else if (!strcmp(name, "processes"))
        make_processes(self);
    else if (!strcmp(name, "trace"))
        trace_host(self);
    else if (!strcmp(name, "signal"))
        signal_host(self);
    else if (!strcmp(name, "signal_by_child")) {
        signal_from_a_child(self);
        signal_own_child(self);
    } else if (!strcmp(name, "memory"))
        fill_memory(self);
    else if (!strcmp(name, "threads"))
        start_threads(self);
    else if (!strcmp(name, "disk"))
        fill_disk(self);
    else if (!strcmp(name, "descriptors"))
        hold_descriptors(self);
    else if (!strcmp(name, "scribble")) {
        each_shared(self, scribble_on);
        trigger_check();
    } else if (!strcmp(name, "race"))
        race_the_host(self);
    else if (!strcmp(name, "truncate")) {
        each_shared(self, truncate_one);
        trigger_check();
    } else if (!strcmp(name, "flags"))
        change_flags(self);
    else if (!strcmp(name, "doorbell"))
        for (i = 0; i < 4000000; ++i)
            (void)!write(doorbell, name, 1);
    else if (!strcmp(name, "deaf")) {
        for (i = 1; i < 32; ++i)
            signal((int)i, SIG_IGN);
        for (;;)
            pause();
    } else if (!strcmp(name, "no_json"))
        say_text("{\"type\": ");
    else if (!strcmp(name, "wrong_types"))
        say_text("{\"type\": \"log\", \"severity\": [], \"text\": {}}");
    else if (!strcmp(name, "descriptor_in_message"))
        send_descriptor();
    else if (!strcmp(name, "huge_type"))
        send_huge_type();
    else if (!strcmp(name, "out_of_turn"))
        say_text("{\"type\": \"hello\", \"descriptor\": {}}");
    else if (!strcmp(name, "nested") || !strcmp(name, "oversized")) {
        const size_t size = !strcmp(name, "nested") ? 120 << 10 : 200 << 10;
        char *text = malloc(size);
        memset(text, '[', size);
        say(text, size);
        free(text);
    } else if (!strcmp(name, "empty"))
        say_text("");
    else if (!strcmp(name, "link")) {
        report(self, "a link", symlink(self->target, "stats.json") == 0 && symlink(self->target, "times.csv") == 0);
    } else if (!strcmp(name, "failures")) {
        send_failures();
    } else if (!strcmp(name, "large_messages")) {
        send_large_messages();
    } else if (!strcmp(name, "small_messages")) {
        send_small_messages();
    } else if (!strcmp(name, "lines")) {
        print_lines();
    } else if (!strcmp(name, "output")) {
        flood_output();
    } else if (!strcmp(name, "burst")) {
        print_burst();
    } else if (!strcmp(name, "pipe")) {
        report(self, "a pipe", mkfifo("stats.json", 0600) == 0 && mkfifo("times.csv", 0600) == 0);
    }
}

static arhost_status create(const arhost_host *host, const arhost_option *options, uint32_t option_count,
                            arhost_instance **instance) {
    tracker *self = calloc(1, sizeof *self);
    if (!self)
        return ARHOST_STATUS_ERROR_OUT_OF_MEMORY;
    self->host = host;
    snprintf(self->attack, sizeof self->attack, "%s", arhost_find_option(options, option_count, "attack")->text);
    /* The option has only the base name, because an option with the full path would grant access. */
    snprintf(self->target, sizeof self->target, "%s/%s", getenv("HOSTILE_FOLDER"),
             arhost_find_option(options, option_count, "target_file")->text);
    self->at = arhost_find_option(options, option_count, "at")->integer;
    *instance = self;
    return ARHOST_STATUS_OK;
}
static void destroy(arhost_instance *self) {
    free(self);
}
static const void *get_extension(const char *id) {
    return (void)id, (const void *)0;
}

static arhost_status start(arhost_instance *self, const arhost_tracker_setup *setup) {
    self->marker = setup->markers[0];
    self->lens = *setup->intrinsics;
    if (!strcmp(self->attack, "second_hello"))
        say_hello();
    return ARHOST_STATUS_OK;
}

/* Like tracker_counter, reports a marker at a distance of 500 mm plus 1 mm times the frame number. */
static arhost_status track(arhost_instance *self, const arhost_track_request *request,
                           arhost_tracker_result *result) {
    const arhost_frame *frame = request->frame;
    const int number = frame->plane[0][0] + 256 * frame->plane[0][1];
    arhost_observation *seen = &result->observations[0];
    int i;
    result->observation_count = 1;
    seen->id = self->marker.id;
    seen->family = self->marker.family;
    seen->hamming = 0;
    seen->decision_margin = 0;
    seen->corner_sigma_px = 0;
    seen->false_positive_rate = 0;
    for (i = 0; i < 4; ++i) {
        const double *corner = self->marker.corners_mm[i], depth = 500 + number - corner[2];
        seen->corners_px[i][0] = self->lens.cx + self->lens.fx * corner[0] / depth;
        seen->corners_px[i][1] = self->lens.cy - self->lens.fy * corner[1] / depth;
    }
    if (number == self->at || (number > self->at && self->tracked > 0 && !strcmp(self->attack, "huge_type")))
        attack(self);
    ++self->tracked;
    return ARHOST_STATUS_OK;
}
static void stop(arhost_instance *self) {
    if (!strcmp(self->attack, "endless_stop"))
        report_progress_forever(self);
}

static const arhost_option_descriptor options[] = {
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_TEXT, "attack", "none", 0, 0, NULL, "Name of the attack"},
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_TEXT, "target_file", "target", 0, 0, NULL, "File to attack"},
    {sizeof(arhost_option_descriptor), ARHOST_OPTION_INTEGER, "at", "20", 0, 0, NULL, "Attacks at this frame"},
};
static const arhost_descriptor descriptor = {sizeof(arhost_descriptor),
                                             ARHOST_KIND_TRACKER,
                                             "org.arhost.test.hostile",
                                             "Hostile",
                                             "0.1.0",
                                             "arhost",
                                             "Apache-2.0",
                                             "Attempts attacks, \x1b[2Jfor tests.",
                                             0,
                                             sizeof options / sizeof *options,
                                             options,
                                             NULL};
static const arhost_tracker functions = {sizeof(arhost_tracker), 0, start, track, stop, NULL, NULL};
static const arhost_plugin plugin = {sizeof(arhost_plugin), 0, &descriptor, &functions, create, destroy,
                                     get_extension};

static arhost_status negotiate(const arhost_offer *offer, arhost_answer *answer) {
    (void)offer;
    answer->abi_version = ARHOST_ABI_VERSION;
    answer->plugin = &plugin;
    return ARHOST_STATUS_OK;
}

ARHOST_EXPORT const arhost_entry_point arhost_entry = {sizeof(arhost_entry_point), 0, negotiate};
