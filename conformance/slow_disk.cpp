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

// Makes the kernel report each write of the calling thread. Returns the listener's descriptor, or a negative value.
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

void SlowDisk::run(const std::function<void(SlowDisk &)> &work) {
    SlowDisk disk;
    std::promise<int> listening;
    std::future<void> done = std::async(std::launch::async, [&] {
        const int listener = listen_to_writes();
        listening.set_value(listener);
        // If serve() fails, the closed listener makes this write fail with ENOSYS.
        if (listener >= 0 && (::write(-1, "", 0) == 0 || errno != ENOSYS))
            work(disk);
    });
    const base::UniqueFd listener(listening.get_future().get());
    const auto is_done = [&] { return done.wait_for(0s) == std::future_status::ready; };
    if (listener.get() < 0 || !disk.serve(listener.get(), is_done))
        throw Skip("this kernel does not support delaying writes");
    done.get();
}

bool SlowDisk::serve(int listener, const std::function<bool()> &is_done) {
    seccomp_notif *request = nullptr;
    seccomp_notif_resp *response = nullptr;
    if (seccomp_notify_alloc(&request, &response) != 0)
        throw std::bad_alloc();
    bool unsupported = false; // by kernels before 5.5
    while (!unsupported && !is_done()) {
        pollfd ready{listener, POLLIN, 0};
        *request = {}; // required by the kernel
        if (::poll(&ready, 1, 2) != 1 || seccomp_notify_receive(listener, request) != 0)
            continue;
        if (is_file(static_cast<int>(request->data.args[0])) && delay_pending_.exchange(false))
            std::this_thread::sleep_for(100ms);
        *response = {request->id, 0, 0, SECCOMP_USER_NOTIF_FLAG_CONTINUE};
        unsupported =
            seccomp_notify_respond(listener, response) != 0 && errno == EINVAL; // other errors: the thread has ended
    }
    seccomp_notify_free(request, response);
    return !unsupported;
}

} // namespace arhost::conformance
