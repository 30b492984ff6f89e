// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <string>

namespace arhost::base {

// A folder for temporary files, which the destructor deletes. `name`: the beginning of the folder's name. `parent`:
// the folder that contains it; empty: that of the system.
class TemporaryFolder {
public:
    explicit TemporaryFolder(const std::string &name, std::filesystem::path parent = {}) {
        std::error_code error;
        if (parent.empty())
            parent = std::filesystem::temp_directory_path(error);
        if (error)
            throw std::runtime_error(
                "the folder for temporary files does not exist; set TMPDIR to an existing folder");
        std::string pattern = parent / (name + "-XXXXXX");
        if (!::mkdtemp(pattern.data()))
            throw std::runtime_error("cannot create a folder in " + parent.string() + ": " + std::strerror(errno));
        path_ = pattern;
    }
    ~TemporaryFolder() {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }
    TemporaryFolder(const TemporaryFolder &) = delete;
    TemporaryFolder &operator=(const TemporaryFolder &) = delete;
    const std::filesystem::path &path() const { return path_; }

private:
    std::filesystem::path path_;
};

} // namespace arhost::base
