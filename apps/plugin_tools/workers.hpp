// SPDX-License-Identifier: Apache-2.0
//
// The workers of a command-line tool.
#pragma once

#include "ipc/reactor.hpp"
#include "supervise/launcher.hpp"
#include "supervise/process.hpp"

#include <filesystem>

namespace arhost::plugin_tools {

std::filesystem::path built_in_plugins(); // folder

// Starts workers and prints what they log to stderr.
class Workers {
public:
    Workers();
    supervise::Context &context() { return context_; }

private:
    supervise::Launcher launcher_;
    ipc::Reactor reactor_;
    supervise::Context context_;
};

} // namespace arhost::plugin_tools
