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

// That no file is written which the run reads, or writes elsewhere, whatever names it has: links of both kinds lead
// to it, and of a printf pattern (frame-%04d.png) each file that is there. All throw yaml::Error about the output.
class FilesInUse {
public:
    // Absolute; a folder too, which no output replaces.
    void read(const std::filesystem::path &file);
    void read_numbered(const std::filesystem::path &file_or_pattern);
    // What `output` names, file or pattern.
    void write(const yaml::Node &output);

    // Of a file that a worker tells of, once all that is written is known. Compares alone: the worker may lie.
    void check_read(const base::FileIdentity &file) const;

private:
    struct Use {
        std::string path;
        std::optional<yaml::Node> output; // that writes it; none: it is read
    };
    const Use *find(const base::FileIdentity &file) const;
    void add(const base::FileIdentity &file, const std::optional<yaml::Node> &output);

    std::vector<yaml::Node> outputs_;
    std::map<std::string, Use> uses_; // by real path, and by device and inode
};

} // namespace arhost::run_config
