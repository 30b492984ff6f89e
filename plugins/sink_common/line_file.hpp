// SPDX-License-Identifier: Apache-2.0
//
// A file of lines. Each line is written by one write(2), so readers see only whole lines, even after a crash.
// Restarts of the sink do not affect the final content.
#pragma once

#include "sink_common/files.hpp"

#include <functional>
#include <optional>
#include <string_view>

namespace arhost::files {

class LineFile {
public:
    LineFile(const Host &host, std::filesystem::path path) : host_(host), path_(std::move(path)) {}

    // Opens the file. For `first_sequence`, see arhost_sink_setup. If it is 0, a run starts. An older file then
    // remains until the first line is appended, because the run may still fail. If it is not 0, the sink was
    // restarted; the file is truncated before the first line for which `keep` returns false.
    void start(std::uint64_t first_sequence, const std::function<bool(std::string_view line)> &keep);

    bool empty() const { return end_ == 0; } // whether the file has no lines yet
    // `lines` must be whole lines with line ends. Writes all of them or, if the disk is full, none.
    void append(std::string_view lines);

private:
    void open();

    Host host_;
    std::filesystem::path path_;
    std::optional<File> file_;
    std::uint64_t end_ = 0; // offset of the end of the last whole line
};

} // namespace arhost::files
