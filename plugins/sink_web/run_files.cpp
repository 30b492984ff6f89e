// SPDX-License-Identifier: Apache-2.0
#include "run_files.hpp"

#include <nlohmann/json.hpp>

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <stdexcept>
#include <sys/stat.h>
#include <unistd.h>

namespace arhost::web {

std::optional<std::string> path_of_file(const std::string &answer, const std::string &number) {
    const auto json = nlohmann::json::parse(answer, nullptr, false);
    if (json.is_object() && json.contains("status"))
        for (const auto &file : json["status"].at("files"))
            if (std::to_string(file.at("number").get<std::uint64_t>()) == number)
                return file.at("file").get<std::string>();
    return std::nullopt;
}

RunFile::RunFile(const std::string &path)
    : fd_(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NOCTTY | O_NONBLOCK)), size_(0) {
    if (fd_ < 0)
        throw std::runtime_error(std::strerror(errno));
    struct stat status {};
    if (::fstat(fd_, &status) != 0 || !S_ISREG(status.st_mode)) {
        ::close(fd_);
        throw std::runtime_error("it is not a regular file");
    }
    size_ = static_cast<std::uint64_t>(status.st_size);
}

RunFile::~RunFile() {
    ::close(fd_);
}

std::ptrdiff_t RunFile::read(std::uint64_t offset, char *to, std::size_t size) const {
    ssize_t got = -1;
    do
        got = ::pread(fd_, to, size, static_cast<off_t>(offset));
    while (got < 0 && errno == EINTR);
    return got;
}

std::string disposition_of(const std::string &path) {
    std::string name = path.substr(path.rfind('/') + 1);
    for (char &c : name)
        if (c < ' ' || c > '~' || c == '"' || c == '\\')
            c = '_';
    return "attachment; filename=\"" + name + "\"";
}

} // namespace arhost::web
