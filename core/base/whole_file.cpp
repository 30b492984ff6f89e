// SPDX-License-Identifier: Apache-2.0
#include "base/whole_file.hpp"

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

WholeFile::WholeFile(const fs::path &file) : file_(file) {
    if (file.empty())
        return;
    std::error_code ignored;
    const fs::file_status status = fs::status(file_, ignored);
    if (fs::is_directory(status))
        throw std::runtime_error("can't write " + file.string() + ": it is a folder");
    if (const int fd = standard_stream(file_); fd >= 0) {
        fd_.reset(::fcntl(fd, F_DUPFD_CLOEXEC, 3));
    } else if (fs::exists(status) && !fs::is_regular_file(status)) {
        fd_.reset(::open(file_.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC));
    } else {
        file_ = real_path(file_); // a link stays one
        std::string beside = file_.string() + ".XXXXXX.tmp";
        fd_.reset(::mkostemps(beside.data(), 4, O_CLOEXEC));
        if (fd_) {
            temporary_ = beside;
            ::fchmod(fd_.get(), mode_of(file_));
        }
    }
    if (!fd_)
        refuse(errno);
}

WholeFile::~WholeFile() {
    std::error_code ignored;
    if (!temporary_.empty())
        fs::remove(temporary_, ignored);
}

void WholeFile::write(const std::string &text, int signals) {
    if (!fd_)
        return;
    try {
        write_all(fd_.get(), text, signals);
    } catch (const std::system_error &error) {
        refuse(error.code().value());
    }
    if (::close(fd_.release()) != 0) // NFS tells only now
        refuse(errno);
    if (!temporary_.empty() && ::rename(temporary_.c_str(), file_.c_str()) != 0)
        refuse(errno);
    temporary_.clear();
}

void WholeFile::refuse(int error) const {
    throw std::runtime_error("can't write " + file_.string() + ": " + std::strerror(error));
}

} // namespace arhost::base
