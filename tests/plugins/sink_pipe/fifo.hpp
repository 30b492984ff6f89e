// SPDX-License-Identifier: Apache-2.0
//
// The reader's end of a FIFO.
#pragma once

#include "base/unique_fd.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <string>

namespace arhost::test {

inline std::filesystem::path make_fifo(const std::filesystem::path &path) {
    std::filesystem::create_directories(path.parent_path());
    if (::mkfifo(path.c_str(), 0600) != 0)
        base::throw_errno("mkfifo");
    return path;
}

class FifoReader {
public:
    // Waits until a program opens the FIFO for writing.
    explicit FifoReader(const std::filesystem::path &path)
        : fd_(base::checked(::open(path.c_str(), O_RDONLY | O_CLOEXEC), "open a FIFO")) {}

    // Returns `size` bytes, or fewer at the end of the stream.
    std::string read(std::size_t size) const {
        std::string bytes(size, '\0');
        std::size_t used = 0;
        for (ssize_t count = 1; used < size && count > 0;
             used += static_cast<std::size_t>(std::max<ssize_t>(count, 0)))
            count = ::read(fd_.get(), bytes.data() + used, size - used);
        bytes.resize(used);
        return bytes;
    }
    std::string read_all() const {
        std::string all;
        for (std::string part; !(part = read(1 << 16)).empty();)
            all += part;
        return all;
    }

private:
    base::UniqueFd fd_;
};

// The number of times that `part` occurs.
inline std::size_t count_of(const std::string &text, const std::string &part) {
    std::size_t count = 0;
    for (std::size_t at = 0; (at = text.find(part, at)) != std::string::npos; at += part.size())
        ++count;
    return count;
}

} // namespace arhost::test
