// SPDX-License-Identifier: Apache-2.0
//
// Identity of a file as workers report it: the host does not access paths that a worker names.
#pragma once

#include <filesystem>
#include <string>

namespace arhost::base {

// Two paths name the same file if either member is equal.
struct FileIdentity {
    std::string path; // real path
    std::string node; // "device:inode", or the path if the file does not exist
};

FileIdentity identity_of(const std::filesystem::path &file);

// Absolute and free of links, dangling ones included.
std::filesystem::path real_path(const std::filesystem::path &file);

} // namespace arhost::base
