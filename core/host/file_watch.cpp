// SPDX-License-Identifier: Apache-2.0
#include "host/file_watch.hpp"

#include <cerrno>
#include <cstring>
#include <sys/inotify.h>
#include <system_error>
#include <unistd.h>

namespace arhost::host {

namespace {

constexpr std::chrono::milliseconds quiet_time{200};

} // namespace

FileWatch::FileWatch(ipc::Reactor &reactor, std::function<void(const Files &)> changed)
    : reactor_(reactor), changed_(std::move(changed)),
      inotify_(base::checked(::inotify_init1(IN_CLOEXEC | IN_NONBLOCK), "inotify_init1")),
      events_(reactor.watch(inotify_.get(), [this] { on_events(); })) {}

void FileWatch::add(const Files &files) {
    int error = 0;
    std::filesystem::path unwatched;
    for (const std::filesystem::path &file : files) {
        files_.insert(file);
        const std::filesystem::path folder = file.parent_path();
        // Returns the existing descriptor if the folder is already watched.
        const int watch =
            ::inotify_add_watch(inotify_.get(), folder.c_str(), IN_CLOSE_WRITE | IN_MOVED_TO | IN_MOVE_SELF);
        if (watch >= 0) {
            folders_[watch].insert(folder);
        } else if (errno == ENOSPC || errno == ENOMEM) { // otherwise, the path is not that of a readable file
            error = errno;
            unwatched = folder;
        }
    }
    if (error)
        throw std::system_error(error, std::generic_category(), "cannot watch the folder " + unwatched.string());
}

void FileWatch::on_events() {
    alignas(inotify_event) char buffer[4096];
    ssize_t size = 0;
    bool is_new = false;
    while ((size = ::read(inotify_.get(), buffer, sizeof buffer)) > 0) {
        for (ssize_t at = 0; at < size;) {
            inotify_event event;
            std::memcpy(&event, buffer + at, sizeof event);
            const char *const name = buffer + at + sizeof event;
            at += static_cast<ssize_t>(sizeof event + event.len);
            const auto folder = folders_.find(event.wd);
            if (event.mask & IN_Q_OVERFLOW ||
                (event.mask & (IN_IGNORED | IN_MOVE_SELF) && folder != folders_.end())) {
                ::inotify_rm_watch(inotify_.get(), event.wd);
                folders_.erase(event.wd);
                is_incomplete_ = is_new = true;
                continue;
            }
            if (event.len == 0 || folder == folders_.end())
                continue;
            for (const std::filesystem::path &each : folder->second)
                if (const auto file = each / name; files_.contains(file)) {
                    pending_.insert(file);
                    is_new = true;
                }
        }
    }
    if (is_new)
        quiet_ = reactor_.at(reactor_.now() + quiet_time, [this] { report(); });
}

void FileWatch::report() {
    if (std::exchange(is_incomplete_, false)) {
        pending_ = files_;
        try {
            add(pending_);
        } catch (const std::system_error &) { // without watches left, the other files are still watched
        }
    }
    changed_(std::exchange(pending_, {}));
}

} // namespace arhost::host
