// SPDX-License-Identifier: Apache-2.0
//
// The files that the run has written, for downloads.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace arhost::web {

// Returns the path of the file with this number. `answer`: the host's answer to the command "status".
std::optional<std::string> path_of_file(const std::string &answer, const std::string &number);

// A file that is being sent.
class RunFile {
public:
    // Opens a regular file, not through a link. Throws std::runtime_error.
    explicit RunFile(const std::string &path);
    ~RunFile();
    RunFile(const RunFile &) = delete;
    RunFile &operator=(const RunFile &) = delete;

    std::uint64_t size() const { return size_; }
    std::ptrdiff_t read(std::uint64_t offset, char *to, std::size_t size) const; // -1: error

private:
    int fd_;
    std::uint64_t size_;
};

// Returns the value of the header Content-Disposition for a file with this path.
std::string disposition_of(const std::string &path);

} // namespace arhost::web
