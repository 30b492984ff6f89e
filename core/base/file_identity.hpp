// SPDX-License-Identifier: Apache-2.0
//
// Which file a path leads to, as workers tell it to the host, which looks at no path that a worker names.
#pragma once

#include <filesystem>
#include <string>

namespace arhost::base {

// Two paths lead to one file where either is the same.
struct FileIdentity {
    std::string path; // real
    std::string node; // "device:inode"; the path again where no file is there
};

FileIdentity identity_of(const std::filesystem::path &file);

// The same for all paths to a file, links included; absolute.
std::filesystem::path real_path(const std::filesystem::path &file);

} // namespace arhost::base
