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

// Ensures that no output overwrites a file that the run reads or that another output writes. Detects symbolic and
// hard links to the same file. A numbered file name (frame-%04d.png) represents all existing files that match it. All
// functions throw yaml::Error, whose position is that of the output.
class FilesInUse {
public:
    // Registers a file or folder that the run reads. `file` must be an absolute path.
    void read(const std::filesystem::path &file);
    void read_numbered(const std::filesystem::path &file_or_pattern);
    // Registers an output; its value is a file name or a pattern.
    void write(const yaml::Node &output);

    // Checks a file that a worker has reported as read. To be called after all calls of write(). Only compares names
    // and inode numbers and does not access the file, because the worker is not trusted.
    void check_read(const base::FileIdentity &file) const;

private:
    struct Use {
        std::string path;
        std::optional<yaml::Node> output; // the output that writes the file; nullopt if the run reads the file
    };
    const Use *find(const base::FileIdentity &file) const;
    void add(const base::FileIdentity &file, const std::optional<yaml::Node> &output);

    std::vector<yaml::Node> outputs_;
    std::map<std::string, Use> uses_; // each file has two keys: its real path and its "device:inode"
};

} // namespace arhost::run_config
