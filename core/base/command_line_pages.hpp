// SPDX-License-Identifier: Apache-2.0
//
// Man pages and shell completions, generated from the definitions of a command line.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace arhost::base {

struct PageOption {
    std::vector<std::string> names; // "-v", "--verbose"; empty if the option is only positional
    std::string positional;         // "FILE"; "" if the option is not positional
    std::string value;              // placeholder of the value; "" for a flag
    std::string help;
    std::vector<std::string> choices; // the valid values; empty if there are others
    bool is_required = false, is_repeatable = false;
};

struct PageCommand {
    std::string name; // "check"; for a program its full name, such as "arhost conform"
    std::string description;
    bool is_program; // the program of this name ("arhost-conform" for "conform") defines its options
    std::vector<PageOption> options;
};

// Returns the text for `kind`, which is man, bash, zsh or fish; "" for other kinds. Placeholders determine which
// values are completed: FILE and PLUGIN as files, FOLDER and DIR as folders, choices as they are.
std::string generate_page(std::string_view kind, const PageCommand &program,
                          const std::vector<PageCommand> &commands);

} // namespace arhost::base
