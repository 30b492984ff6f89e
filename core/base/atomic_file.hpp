// SPDX-License-Identifier: Apache-2.0
//
// Atomic file replacement, opened up front.
#pragma once

#include "base/unique_fd.hpp"

#include <filesystem>
#include <string>

namespace arhost::base {

// The constructor opens a temporary file, so that an unwritable path is found before the work; write() renames it to
// the target. Pipes, devices, and a file that is this process's stdout or stderr are written to directly.
class AtomicFile {
public:
    // An empty path: does nothing. `signals`: a signalfd. Throws std::runtime_error.
    explicit AtomicFile(const std::filesystem::path &file, int signals = -1);
    ~AtomicFile(); // removes the temporary file unless written
    AtomicFile(const AtomicFile &) = delete;
    AtomicFile &operator=(const AtomicFile &) = delete;

    // May be called once. Throws std::runtime_error, or Interrupted (base/write_all.hpp) if a signal arrives while
    // the write blocks.
    void write(const std::string &text);

private:
    [[noreturn]] void fail(int error) const;
    void open_temporary();

    std::filesystem::path file_, temporary_;
    int signals_;
    UniqueFd fd_;
};

} // namespace arhost::base
