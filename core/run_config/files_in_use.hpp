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
// hard links to the same file. All functions throw yaml::Error, whose position is that of the output.
class FilesInUse {
public:
    // Registers a file or folder that the run reads. `file` must be an absolute path.
    void read(const std::filesystem::path &file);
    void read_numbered(const std::filesystem::path &file_or_pattern);
    // Registers an output. It is not known yet which plugins write numbered files. Therefore a name like
    // frame-%04d.png must not match a file that the run reads, but may match the file of another output.
    void write(const yaml::Node &output);

    // Checks a file that a worker has reported as read. To be called after all calls of write(). Only compares names
    // and inode numbers and does not access the file, because the worker is not trusted.
    void check_read(const base::FileIdentity &file) const;
    // Throws if an output would overwrite `file`, one of arhost's own programs, libraries and plugins. To be called
    // after all calls of write().
    void protect(const base::FileIdentity &file) const;

private:
    struct Use {
        std::string path;
        std::optional<yaml::Node> output; // the output that writes the file; nullopt if the run reads the file
        bool by_pattern = false;          // the output's name is a pattern that matches the file
    };
    const Use *find(const base::FileIdentity &file) const;
    void add(const base::FileIdentity &file, const std::optional<yaml::Node> &output, bool by_pattern = false);

    std::map<std::string, Use> uses_; // each file has two keys: its real path and its "device:inode"
};

// An output file of a component whose plugin is known.
struct OutputFile {
    yaml::Node path;
    bool is_numbered; // the plugin has ARHOST_SINK_CAPABILITY_NUMBERED_FILES, so the path may be a pattern
};

// Throws yaml::Error if a pattern can produce the name of another output's file.
void expect_distinct(const std::vector<OutputFile> &outputs);

} // namespace arhost::run_config
