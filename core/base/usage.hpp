// SPDX-License-Identifier: Apache-2.0
//
// What a program's command line says of itself where it is wrong. For CLI::App::failure_message.
#pragma once

#include "base/text.hpp"

#include <CLI/CLI.hpp>

#include <string>

namespace arhost::base {

// Arguments may stand in it, and must not steer a terminal.
inline std::string usage_failure(const CLI::App *, const CLI::Error &error) {
    return printable(error.what()) + "\nRun with --help for more information.\n";
}

} // namespace arhost::base
