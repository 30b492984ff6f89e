// SPDX-License-Identifier: Apache-2.0
#include "sink_common/pipe_stream.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <cstring>
#include <utility>

namespace arhost::pipe {
namespace {

constexpr auto poll_interval = std::chrono::milliseconds(20);

Failure io_failure(const std::string &what) {
    return Failure(ARHOST_STATUS_ERROR_IO, what + ": " + std::strerror(errno));
}

} // namespace

void PipeStream::check() const {
    if (is_standard_output())
        return;
    const std::string start = "path: '" + path_ + "' ";
    struct stat status {};
    if (::stat(path_.c_str(), &status) != 0)
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      start + (errno == ENOENT ? "does not exist; create it with 'mkfifo " + path_ + "'"
                                               : std::string("cannot be accessed: ") + std::strerror(errno)));
    if (!S_ISFIFO(status.st_mode))
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      start + "is not a FIFO; name one that 'mkfifo' has created, or use 'sink_video' for a file");
    if (::access(path_.c_str(), W_OK) != 0)
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      start + "cannot be written: " + std::strerror(errno) + "; change its permissions");
}

void PipeStream::open(bool after_another) {
    if (is_standard_output())
        return open_standard_output();
    if (after_another)
        wait_for_end_of_earlier_stream();
    for (bool reported = false;; wait("waiting for a reader")) {
        fd_ = ::open(path_.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC);
        if (fd_ < 0 && errno != ENXIO && errno != EINTR) // ENXIO: there is no reader
            throw io_failure("cannot open " + name());
        if (fd_ < 0) {
            if (!std::exchange(reported, true))
                host_.info("waiting for a program to read " + name());
            continue;
        }
        int unread = 0;
        if (::ioctl(fd_, FIONREAD, &unread) != 0 || unread == 0)
            return;
        close();
        wait_for_end_of_earlier_stream();
    }
}

void PipeStream::open_standard_output() {
    if (content_ == Content::binary && ::isatty(STDOUT_FILENO))
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      "path: standard output is a terminal; connect it to a program, as in 'arhost … | ffplay -'");
    fd_ = STDOUT_FILENO;
}

// The reader sees the end of a stream when it reads while the FIFO is empty and no program has it open for writing.
void PipeStream::wait_for_end_of_earlier_stream() {
    constexpr auto time_to_read = std::chrono::seconds(1);
    const int fd = ::open(path_.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC); // reading does not delay the end
    if (fd < 0)
        throw io_failure("cannot open " + name());
    const struct Close {
        int fd;
        ~Close() { ::close(fd); }
    } closing{fd};
    host_.info("waiting until the reader of " + name() + " has seen the end of an earlier stream");
    const auto now = [] { return std::chrono::steady_clock::now(); };
    for (auto empty_since = now(); now() - empty_since < time_to_read; wait("waiting for the end of a stream"))
        if (int unread = 0; ::ioctl(fd, FIONREAD, &unread) == 0 && unread > 0)
            empty_since = now();
}

bool PipeStream::write(std::span<const std::uint8_t> bytes) {
    // Standard output may be shared with other programs, so it must not become non-blocking. If poll(2) reports room
    // in a pipe, then a write of PIPE_BUF bytes does not block.
    const std::size_t most = is_standard_output() ? PIPE_BUF : SIZE_MAX;
    bool reported = false;
    for (const auto started = std::chrono::steady_clock::now(); !bytes.empty();) {
        pollfd ready{fd_, POLLOUT, 0};
        constexpr int timeout_ms = 100;
        const int count = ::poll(&ready, 1, timeout_ms);
        if (count < 0 && errno != EINTR)
            throw io_failure("cannot write to " + name());
        if (count <= 0) {
            wait("waiting for the reader");
            constexpr auto report_after = std::chrono::seconds(3);
            if (std::chrono::steady_clock::now() - started > report_after && !std::exchange(reported, true))
                host_.info("waiting for the reader of " + name() + ", which has paused");
            continue;
        }
        if (!(ready.revents & POLLOUT) && ready.revents & (POLLERR | POLLHUP))
            return false;
        const ssize_t written = ::write(fd_, bytes.data(), std::min(bytes.size(), most));
        if (written >= 0)
            bytes = bytes.subspan(static_cast<std::size_t>(written));
        else if (errno == EPIPE || errno == ECONNRESET)
            return false;
        else if (errno != EAGAIN && errno != EINTR)
            throw io_failure("cannot write to " + name());
    }
    return true;
}

void PipeStream::close() {
    if (is_open() && !is_standard_output())
        ::close(fd_);
    fd_ = -1;
}

void PipeStream::wait(const char *what) const {
    host_.progress(-1, what);
    if (!host_.wait_until(std::chrono::steady_clock::now() + poll_interval))
        throw Failure(ARHOST_STATUS_ERROR_CANCELLED, "stopped waiting for the reader of " + name());
}

} // namespace arhost::pipe
