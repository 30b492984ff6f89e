// SPDX-License-Identifier: Apache-2.0
//
// The plugins that a command queries, each in its own worker.
#pragma once

#include "command_line/command_line.hpp"
#include "sandbox/sandbox.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace arhost::plugin_tools {

class Selection {
public:
    void add_names(arhost::command_line::CommandLine &app, const std::string &help); // PLUGIN
    void add_reads(arhost::command_line::CommandLine &app);                          // --reads

    // Returns the files of the plugins; of all plugins if none is named. Throws base::InvalidInput.
    std::vector<std::filesystem::path> files() const;
    sandbox::Policy policy() const; // permits to read the folders of --reads

private:
    std::vector<std::string> names_;
    std::vector<std::filesystem::path> reads_;
};

} // namespace arhost::plugin_tools
