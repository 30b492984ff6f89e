// SPDX-License-Identifier: Apache-2.0
//
// Checks files with the user's permissions before a plugin opens them. The errors of a plugin would describe the view
// from its sandbox, for example "permission denied" for a file that does not exist.
#pragma once

#include "sandbox/sandbox.hpp"
#include "yaml/yaml.hpp"

namespace arhost::run_config {

// Throws yaml::Error if the input file at `node` does not exist or cannot be read. For a numbered file name whose
// literal name does not exist, throws if no file matches it, or if `policy` hides its folder (allow_read_files).
void expect_readable(const yaml::Node &node, const sandbox::Policy &policy);

// Throws yaml::Error if the output file at `node` is write-protected, or if no file can be created in its folder.
// Creates and changes nothing. Paths in /dev and /proc are not checked.
void expect_writable(const yaml::Node &node);

// Throws yaml::Error if the output file at `node` needs a new folder in '/': as root, a misspelled path would create
// it.
void expect_folder_near_another(const yaml::Node &node);

// Returns "; did you mean 'NAME'?" if the folder of `file` contains a similar name, otherwise "". Omits `extension`
// at the end of NAME.
std::string hint_at_similar_name(const std::filesystem::path &file, std::string_view extension = "");

} // namespace arhost::run_config
