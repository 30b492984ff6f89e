// SPDX-License-Identifier: Apache-2.0
//
// The definitions of a command line as JSON, from which the build generates man pages and shell completions
// (tools/command_line_pages).
#pragma once

#include <nlohmann/json.hpp>

#include <string>
#include <vector>

namespace arhost::command_line {

struct OptionDescription {
    std::vector<std::string> names; // "-v", "--verbose"; empty if the option is only positional
    std::string positional;         // "FILE"; "" if the option is not positional
    std::string value;              // placeholder of the value; "" for a flag
    std::string help;
    std::vector<std::string> choices; // the valid values; empty if there are others
    bool is_required = false, is_repeatable = false;
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(OptionDescription, names, positional, value, help, choices, is_required,
                                   is_repeatable)

struct CommandDescription {
    std::string name; // "check"; for a program its full name, such as "arhost conform"
    std::string description;
    bool is_program = false; // the program of this name ("arhost-conform" for "conform") defines its options
    std::vector<OptionDescription> options;
    std::vector<CommandDescription> commands;
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(CommandDescription, name, description, is_program, options, commands)

} // namespace arhost::command_line
