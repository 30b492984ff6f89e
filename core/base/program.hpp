// SPDX-License-Identifier: Apache-2.0
//
// Utilities that the command-line programs share.
#pragma once

#include <filesystem>
#include <functional>
#include <stdexcept>
#include <string>

namespace arhost::base {

enum ExitStatus { success = 0, failed = 1, invalid_input = 2, interrupted = 130 }; // docs/config.md

// Thrown if the user's input is invalid: the command line, a configuration or another file.
struct InvalidInput : std::runtime_error {
    using std::runtime_error::runtime_error;
};

// Establishes a known state, independent of the parent process. Reopens standard streams that are closed, so that no
// socket gets descriptor 0, 1 or 2; printing to a standard output that was closed fails. Resets the signal handling.
// Ignores SIGPIPE and SIGXFSZ, so that the failing system calls return an error instead.
void prepare_process();

// Prints the error as a single line, even if a file name in it contains a line break. Returns `status`.
int print_error(const std::string &why, ExitStatus status);

// Returns the exit status of `command`. Prints the exception that it throws, if any, and flushes stdout.
int exit_status_of(const std::function<int()> &command);

// own_folder() is the folder of this executable, which also contains the programs that arhost starts. own_prefix() is
// the folder above it: the executable is <prefix>/bin/arhost.
std::filesystem::path own_prefix();
std::filesystem::path own_folder();

} // namespace arhost::base
