// SPDX-License-Identifier: Apache-2.0
//
// A file of lines. Each line is written by one write(2), so that a reader sees whole lines even after a crash. The
// final content does not depend on restarts of the sink.
#pragma once

#include "sink_common/files.hpp"

#include <functional>
#include <optional>
#include <string_view>

namespace arhost::files {

class LineFile {
public:
    LineFile(const Host &host, std::filesystem::path path) : host_(host), path_(std::move(path)) {}

    // `first_sequence`: see arhost_sink_setup. At the start of a run (0) an older file stays until the first line is
    // appended, since the run may still fail. After a restart the file is truncated before the first line for which
    // `keep` returns false.
    void start(std::uint64_t first_sequence, const std::function<bool(std::string_view line)> &keep);

    bool empty() const { return end_ == 0; } // no lines yet
    // `lines`: whole lines with line ends. All of them are written or, if the disk is full, none.
    void append(std::string_view lines);

private:
    void open();

    Host host_;
    std::filesystem::path path_;
    std::optional<File> file_;
    std::uint64_t end_ = 0; // offset of the end of the last whole line
};

} // namespace arhost::files
