// SPDX-License-Identifier: Apache-2.0
//
// A file that is written once: tried before the work that it tells of, and whole after it or as it was before.
#pragma once

#include "base/unique_fd.hpp"

#include <filesystem>
#include <string>

namespace arhost::base {

class WholeFile {
public:
    // "": none is wanted. What is not a regular file (a pipe, a device), and a file that is this process's standard
    // output or error, is written to and not replaced. Throws std::runtime_error where it can't be written.
    explicit WholeFile(const std::filesystem::path &file);
    ~WholeFile(); // removes what has not become whole
    WholeFile(const WholeFile &) = delete;
    WholeFile &operator=(const WholeFile &) = delete;

    // Once; throws likewise, and as write_all (base/write_all.hpp) does where a signal comes.
    void write(const std::string &text, int signals = -1);

private:
    [[noreturn]] void refuse(int error) const;

    std::filesystem::path file_, temporary_; // beside it; none for what is not replaced
    UniqueFd fd_;
};

} // namespace arhost::base
