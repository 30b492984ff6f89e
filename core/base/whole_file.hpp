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
    // output or error, is written to and not replaced. Throws std::runtime_error where it can't be written, and
    // Interrupted (base/write_all.hpp) where a pipe has no reader until a signal comes to `signals`, a signalfd.
    explicit WholeFile(const std::filesystem::path &file, int signals = -1);
    ~WholeFile(); // removes what has not become whole
    WholeFile(const WholeFile &) = delete;
    WholeFile &operator=(const WholeFile &) = delete;

    void write(const std::string &text); // once; throws likewise

private:
    [[noreturn]] void refuse(int error) const;
    void open_stream();
    void open_beside();
    void name_beside();

    std::filesystem::path file_, temporary_; // beside it, once it has a name
    int signals_;
    bool replaces_ = false;
    UniqueFd fd_;
};

} // namespace arhost::base
