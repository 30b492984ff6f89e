// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/file_identity.hpp"
#include "yaml/yaml.hpp"

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace arhost::run_config {

// Ensures that an output overwrites no file that the run reads or that another output writes, also via symbolic or
// hard links. A printf pattern (frame-%04d.png) stands for each matching file that exists. All functions throw
// yaml::Error about the output.
class FilesInUse {
public:
    // Absolute path of a file or folder.
    void read(const std::filesystem::path &file);
    void read_numbered(const std::filesystem::path &file_or_pattern);
    // `output`: file or pattern.
    void write(const yaml::Node &output);

    // For a file that a worker reports, after all calls of write(). Compares only, as the worker is not trusted.
    void check_read(const base::FileIdentity &file) const;

private:
    struct Use {
        std::string path;
        std::optional<yaml::Node> output; // the writer; nothing: the file is read
    };
    const Use *find(const base::FileIdentity &file) const;
    void add(const base::FileIdentity &file, const std::optional<yaml::Node> &output);

    std::vector<yaml::Node> outputs_;
    std::map<std::string, Use> uses_; // keys: real path, and device:inode
};

} // namespace arhost::run_config
