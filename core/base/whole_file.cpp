// SPDX-License-Identifier: Apache-2.0
#include "base/whole_file.hpp"

#include "base/file_identity.hpp"
#include "base/write_all.hpp"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <poll.h>
#include <stdexcept>
#include <sys/stat.h>
#include <unistd.h>

namespace arhost::base {
namespace {

namespace fs = std::filesystem;

// Which of this process's streams the file is; -1: neither.
int standard_stream(const fs::path &file) {
    struct stat there {
    }, stream{};
    for (const int fd : {STDOUT_FILENO, STDERR_FILENO})
        if (::stat(file.c_str(), &there) == 0 && ::fstat(fd, &stream) == 0 && there.st_dev == stream.st_dev &&
            there.st_ino == stream.st_ino)
            return fd;
    return -1;
}

// The file's own, or what a new one gets.
mode_t mode_of(const fs::path &file) {
    struct stat status {};
    if (::stat(file.c_str(), &status) == 0)
        return status.st_mode & 0777;
    const mode_t mask = ::umask(0);
    ::umask(mask);
    return 0666 & ~mask;
}

} // namespace

WholeFile::WholeFile(const fs::path &file, int signals) : file_(file), signals_(signals) {
    if (file.empty())
        return;
    std::error_code error;
    const fs::file_status status = fs::status(file_, error);
    if (fs::is_directory(status))
        throw std::runtime_error("can't write " + file.string() + ": it is a folder");
    if (status.type() == fs::file_type::none) // a link that leads in a circle
        refuse(error.value());
    if (const int fd = standard_stream(file_); fd >= 0)
        fd_.reset(::fcntl(fd, F_DUPFD_CLOEXEC, 3));
    else if (fs::exists(status) && !fs::is_regular_file(status))
        open_stream();
    else
        open_beside();
    if (!fd_)
        refuse(errno);
}

// A pipe may have no reader yet.
void WholeFile::open_stream() {
    constexpr int a_while_ms = 20;
    constexpr int flags = O_WRONLY | O_APPEND | O_NOCTTY | O_CLOEXEC;
    while (fd_.reset(::open(file_.c_str(), flags | O_NONBLOCK)), !fd_ && errno == ENXIO && fs::is_fifo(file_)) {
        pollfd ready{signals_, POLLIN, 0};
        ::poll(&ready, 1, a_while_ms);
        if (const int signal = take_signal(signals_))
            throw Interrupted(signal, "interrupted while it waited for a reader of " + file_.string());
    }
    if (fd_)
        ::fcntl(fd_.get(), F_SETFL, O_APPEND);
}

// Without a name, where the file system has that: nothing is left of it whatever ends this process.
void WholeFile::open_beside() {
    file_ = real_path(file_); // a link stays one
    replaces_ = true;
    const mode_t mode = mode_of(file_);
    fd_.reset(::open(file_.parent_path().c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, mode));
    if (!fd_) {
        std::string beside = file_.string() + ".XXXXXX.tmp";
        fd_.reset(::mkostemps(beside.data(), 4, O_CLOEXEC));
        if (fd_)
            temporary_ = beside;
    }
    if (fd_)
        ::fchmod(fd_.get(), mode);
}

void WholeFile::name_beside() {
    const std::string nameless = "/proc/self/fd/" + std::to_string(fd_.get());
    for (int i = 0; temporary_.empty(); ++i) {
        const std::string beside = file_.string() + "." + std::to_string(i) + ".tmp";
        if (::linkat(AT_FDCWD, nameless.c_str(), AT_FDCWD, beside.c_str(), AT_SYMLINK_FOLLOW) == 0)
            temporary_ = beside;
        else if (errno != EEXIST)
            refuse(errno);
    }
}

WholeFile::~WholeFile() {
    std::error_code ignored;
    if (!temporary_.empty())
        fs::remove(temporary_, ignored);
}

void WholeFile::write(const std::string &text) {
    if (!fd_)
        return;
    try {
        write_all(fd_.get(), text, signals_);
    } catch (const std::system_error &error) {
        refuse(error.code().value());
    }
    if (replaces_)
        name_beside();
    if (::close(fd_.release()) != 0) // NFS tells only now
        refuse(errno);
    if (replaces_ && ::rename(temporary_.c_str(), file_.c_str()) != 0)
        refuse(errno);
    temporary_.clear();
}

void WholeFile::refuse(int error) const {
    throw std::runtime_error("can't write " + file_.string() + ": " + std::strerror(error));
}

} // namespace arhost::base
