// SPDX-License-Identifier: Apache-2.0
//
// Atomic replacement of a file. Errors such as missing permissions are reported before the caller starts its work.
#pragma once

#include "base/unique_fd.hpp"

#include <filesystem>
#include <string>

namespace arhost::base {

// The constructor creates a temporary file in the folder of the target, so it throws if the path is not writable.
// write() fills the temporary file and renames it to the target. If the target is a pipe, a device, or the file
// behind this process's stdout or stderr, write() writes to it directly.
class AtomicFile {
public:
    // If `file` is empty, all functions do nothing. `signals`: a signalfd whose signals interrupt write(), or -1.
    // Throws std::runtime_error.
    explicit AtomicFile(const std::filesystem::path &file, int signals = -1);
    ~AtomicFile(); // removes the temporary file unless write() has renamed it
    AtomicFile(const AtomicFile &) = delete;
    AtomicFile &operator=(const AtomicFile &) = delete;

    // May be called only once. Throws Interrupted (base/write_all.hpp) if a signal arrives while the write blocks,
    // and std::runtime_error for other errors.
    void write(const std::string &text);

private:
    [[noreturn]] void fail(int error) const;
    void open_temporary();

    std::filesystem::path file_, temporary_;
    int signals_;
    UniqueFd fd_;
};

} // namespace arhost::base
