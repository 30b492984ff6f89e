// SPDX-License-Identifier: Apache-2.0
#include "sink_common/files.hpp"

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <utility>

namespace arhost::files {
namespace {

const char *advice_for(int error_number) {
    switch (error_number) {
    case ENOSPC:
    case EDQUOT:
        return "free some space, or choose another path";
    case EFBIG:
        return "raise the limit on file sizes (ulimit -f), or choose another path";
    case EACCES:
    case EPERM:
    case EROFS:
        return "choose a writable path";
    case ENOTDIR:
    case EEXIST:
        return "a part of the path is a file, not a folder";
    case EISDIR:
        return "the path is a folder; add a file name";
    default:
        return "choose another path";
    }
}

// Throws unless `fd` is a regular file. The sinks truncate or replace their files, which is impossible for pipes and
// devices.
void require_regular_file(int fd, const std::filesystem::path &path) {
    struct stat status {};
    if (::fstat(fd, &status) != 0 || !S_ISREG(status.st_mode)) {
        ::close(fd);
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      "'" + path.string() + "' is not a regular file; choose another path");
    }
}

// Returns whether only a change of the configuration or of permissions helps. The host must then not retry.
bool is_permanent(int error_number) {
    switch (error_number) {
    case EACCES:
    case EPERM:
    case EROFS:
    case ENOENT:
    case ENOTDIR:
    case EEXIST:
    case EISDIR:
    case ENAMETOOLONG:
    case ELOOP:
        return true;
    default:
        return false;
    }
}

} // namespace

Failure io_failure(const std::string &what, const std::filesystem::path &file, int error_number) {
    return Failure(is_permanent(error_number) ? ARHOST_STATUS_ERROR_CONFIGURATION : ARHOST_STATUS_ERROR_IO,
                   what + " '" + file.string() + "': " + std::strerror(error_number) + " (" +
                       advice_for(error_number) + ")");
}

void make_parent_folders(const std::filesystem::path &file) {
    std::error_code error;
    if (file.has_parent_path())
        std::filesystem::create_directories(file.parent_path(), error);
    if (error)
        throw io_failure("cannot create the folder", file.parent_path(), error.value());
}

void check_can_write(const std::filesystem::path &file) {
    if (const int fd = ::open(file.c_str(), O_WRONLY | O_CLOEXEC | O_NONBLOCK); fd >= 0) {
        require_regular_file(fd, file);
        ::close(fd);
        return;
    }
    if (errno != ENOENT)
        throw io_failure("cannot open", file, errno);
    std::error_code error;
    if (std::filesystem::is_symlink(
            std::filesystem::symlink_status(file, error))) { // `file` is a dangling link, so check its target
        std::filesystem::path target = std::filesystem::read_symlink(file, error);
        return check_can_write(target.is_absolute() ? target : file.parent_path() / target);
    }
    const int fd = ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (fd < 0)
        throw io_failure("cannot open", file, errno);
    ::close(fd);
    remove_file(file); // open() created it
}

void remove_file(const std::filesystem::path &file) {
    if (::unlink(file.c_str()) != 0 && errno != ENOENT)
        throw io_failure("cannot delete", file, errno);
}

std::filesystem::path hidden_sibling(const std::filesystem::path &file, std::string_view suffix) {
    return file.parent_path() / std::string(".").append(file.filename().string()).append(suffix);
}

File::File(std::filesystem::path path, int open_flags)
    : path_(std::move(path)), fd_(::open(path_.c_str(), open_flags | O_CLOEXEC | O_NONBLOCK, 0666)) {
    if (fd_ < 0)
        throw io_failure("cannot open", path_, errno);
    require_regular_file(fd_, path_);
}

File::~File() {
    if (fd_ >= 0)
        ::close(fd_);
}

File::File(File &&other) noexcept : path_(std::move(other.path_)), fd_(std::exchange(other.fd_, -1)) {}

std::uint64_t File::size() const {
    struct stat status {};
    if (::fstat(fd_, &status) != 0)
        throw io_failure("cannot read", path_, errno);
    return static_cast<std::uint64_t>(status.st_size);
}

void File::append(std::span<const std::uint8_t> bytes) {
    while (!bytes.empty()) {
        const ssize_t written = ::write(fd_, bytes.data(), bytes.size());
        if (written >= 0)
            bytes = bytes.subspan(static_cast<std::size_t>(written));
        else if (errno != EINTR)
            throw io_failure("cannot write", path_, errno);
    }
}

void File::write_at(std::uint64_t offset, std::span<const std::uint8_t> bytes) {
    while (!bytes.empty()) {
        const ssize_t written = ::pwrite(fd_, bytes.data(), bytes.size(), static_cast<off_t>(offset));
        if (written >= 0) {
            bytes = bytes.subspan(static_cast<std::size_t>(written));
            offset += static_cast<std::uint64_t>(written);
        } else if (errno != EINTR) {
            throw io_failure("cannot write", path_, errno);
        }
    }
}

void File::read_at(std::uint64_t offset, std::span<std::uint8_t> bytes) const {
    while (!bytes.empty()) {
        const ssize_t got = ::pread(fd_, bytes.data(), bytes.size(), static_cast<off_t>(offset));
        if (got > 0) {
            bytes = bytes.subspan(static_cast<std::size_t>(got));
            offset += static_cast<std::uint64_t>(got);
        } else if (got == 0) {
            throw Failure(ARHOST_STATUS_ERROR_IO,
                          "'" + path_.string() + "' became shorter while arhost was using it");
        } else if (errno != EINTR) {
            throw io_failure("cannot read", path_, errno);
        }
    }
}

void File::truncate(std::uint64_t size) {
    if (::ftruncate(fd_, static_cast<off_t>(size)) != 0)
        throw io_failure("cannot truncate", path_, errno);
}

void replace_file(const std::filesystem::path &target, const std::filesystem::path &scratch,
                  std::span<const std::uint8_t> bytes) {
    try {
        File(scratch, O_WRONLY | O_CREAT | O_TRUNC).append(bytes);
        if (::rename(scratch.c_str(), target.c_str()) != 0)
            throw io_failure("cannot write", target, errno);
    } catch (const Failure &) {
        ::unlink(scratch.c_str()); // do not leave a partial file
        throw;
    }
}

} // namespace arhost::files
