// SPDX-License-Identifier: Apache-2.0
#include "conformance/slow_disk.hpp"

#include "base/unique_fd.hpp"
#include "conformance/test.hpp"

#include <cerrno>
#include <future>
#include <linux/seccomp.h>
#include <poll.h>
#include <seccomp.h>
#include <sys/stat.h>
#include <thread>
#include <unistd.h>

namespace arhost::conformance {
namespace {

constexpr const char *writes[] = {"write", "writev",   "pwrite64",        "pwritev",   "pwritev2", "fdatasync",
                                  "fsync", "sendfile", "copy_file_range", "ftruncate", "fallocate"};

// From here on the kernel asks before each of the calling thread's writes; where to answer, or negative.
int listen_to_writes() {
    const std::unique_ptr<void, void (*)(scmp_filter_ctx)> filter(seccomp_init(SCMP_ACT_ALLOW), seccomp_release);
    bool failed = !filter;
    for (const char *call : writes)
        failed =
            failed || seccomp_rule_add(filter.get(), SCMP_ACT_NOTIFY, seccomp_syscall_resolve_name(call), 0) != 0;
    return failed || seccomp_load(filter.get()) != 0 ? -1 : seccomp_notify_fd(filter.get());
}

bool is_file(int fd) {
    struct stat status {};
    return ::fstat(fd, &status) == 0 && S_ISREG(status.st_mode);
}

} // namespace

void SlowDisk::under(const std::function<void(SlowDisk &)> &work) {
    SlowDisk disk;
    std::promise<int> listening;
    std::future<void> done = std::async(std::launch::async, [&] {
        const int listener = listen_to_writes();
        listening.set_value(listener);
        // Refused to go on, the kernel has no such call once the listener is closed.
        if (listener >= 0 && (::write(-1, "", 0) == 0 || errno != ENOSYS))
            work(disk);
    });
    const base::UniqueFd listener(listening.get_future().get());
    const auto is_done = [&] { return done.wait_for(0s) == std::future_status::ready; };
    if (listener.get() < 0 || !disk.serve(listener.get(), is_done))
        throw Skip("this kernel does not let a process hold up its own writes");
    done.get();
}

bool SlowDisk::serve(int listener, const std::function<bool()> &is_done) {
    seccomp_notif *asked = nullptr;
    seccomp_notif_resp *answer = nullptr;
    if (seccomp_notify_alloc(&asked, &answer) != 0)
        throw std::bad_alloc();
    bool refused = false; // as by kernels before 5.5
    while (!refused && !is_done()) {
        pollfd ready{listener, POLLIN, 0};
        *asked = {}; // or the kernel refuses it
        if (::poll(&ready, 1, 2) != 1 || seccomp_notify_receive(listener, asked) != 0)
            continue;
        if (is_file(static_cast<int>(asked->data.args[0])) && is_due_.exchange(false))
            std::this_thread::sleep_for(100ms);
        *answer = {asked->id, 0, 0, SECCOMP_USER_NOTIF_FLAG_CONTINUE};
        refused = seccomp_notify_respond(listener, answer) != 0 && errno == EINVAL; // not: who asked is gone
    }
    seccomp_notify_free(asked, answer);
    return !refused;
}

} // namespace arhost::conformance
