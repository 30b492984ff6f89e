// SPDX-License-Identifier: Apache-2.0
#include "base/atomic_file.hpp"

#include "base/file_identity.hpp"
#include "base/write_all.hpp"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <stdexcept>
#include <sys/stat.h>
#include <unistd.h>

namespace arhost::base {
namespace {

namespace fs = std::filesystem;

// Returns STDOUT_FILENO or STDERR_FILENO if `file` is the file behind that descriptor, otherwise -1.
int standard_stream(const fs::path &file) {
    for (const int fd : {STDOUT_FILENO, STDERR_FILENO})
        if (identity_of(file).node == identity_of("/proc/self/fd/" + std::to_string(fd)).node)
            return fd;
    return -1;
}

// Returns the permissions of `file`. If it does not exist, returns the permissions with which open(2) would create
// it.
mode_t permissions_of(const fs::path &file) {
    struct stat status {};
    if (::stat(file.c_str(), &status) == 0)
        return status.st_mode & 0777;
    const mode_t mask = ::umask(0);
    ::umask(mask);
    return 0666 & ~mask;
}

} // namespace

AtomicFile::AtomicFile(const fs::path &file, int signals) : file_(file), signals_(signals) {
    if (file.empty())
        return;
    std::error_code error;
    const fs::file_status status = fs::status(file_, error);
    if (fs::is_directory(status))
        throw std::runtime_error("cannot write " + file.string() + ": it is a folder");
    if (status.type() == fs::file_type::none) // for example a circular symbolic link
        fail(error.value());
    if (const int fd = standard_stream(file_); fd >= 0)
        fd_.reset(::fcntl(fd, F_DUPFD_CLOEXEC, 3));
    else if (fs::exists(status) && !fs::is_regular_file(status))
        fd_.reset(::open(file_.c_str(), O_WRONLY | O_APPEND | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    else
        open_temporary();
    if (!fd_)
        fail(errno);
}

void AtomicFile::open_temporary() {
    file_ = real_path(file_); // if `file_` is a symbolic link, replaces its target, not the link
    std::string name = file_.string() + ".XXXXXX.tmp";
    fd_.reset(::mkostemps(name.data(), 4, O_CLOEXEC));
    if (fd_) {
        temporary_ = name;
        ::fchmod(fd_.get(), permissions_of(file_));
    }
}

AtomicFile::~AtomicFile() {
    std::error_code ignored;
    if (!temporary_.empty())
        fs::remove(temporary_, ignored);
}

void AtomicFile::write(const std::string &text) {
    if (!fd_)
        return;
    try {
        write_all(fd_.get(), text, signals_);
    } catch (const std::system_error &error) {
        fail(error.code().value());
    }
    if (::close(fd_.release()) != 0) // NFS may report write errors here
        fail(errno);
    if (!temporary_.empty() && ::rename(temporary_.c_str(), file_.c_str()) != 0)
        fail(errno);
    temporary_.clear();
}

void AtomicFile::fail(int error) const {
    throw std::runtime_error("cannot write " + file_.string() + ": " + std::strerror(error));
}

} // namespace arhost::base
