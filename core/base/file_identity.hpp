// SPDX-License-Identifier: Apache-2.0
//
// Identifies files that workers read. The workers compute the identities, because the host must not access paths that
// an untrusted worker names.
#pragma once

#include <filesystem>
#include <string>

namespace arhost::base {

// Two paths lead to the same file if their `path` or their `node` is equal.
struct FileIdentity {
    std::string path; // see real_path
    std::string node; // "device:inode", or the path if the file does not exist
};

FileIdentity identity_of(const std::filesystem::path &file);

// Returns the absolute path with all symbolic links resolved, including dangling ones.
std::filesystem::path real_path(const std::filesystem::path &file);

} // namespace arhost::base
